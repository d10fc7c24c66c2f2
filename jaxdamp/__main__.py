"""`python -m jaxdamp`: the command line."""

from jaxdamp.cli import main


if __name__ == "__main__":
    main()
