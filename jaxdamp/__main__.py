"""`python -m jaxdamp`: the command line."""

from jaxdamp.cli import main


main()
