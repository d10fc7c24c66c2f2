"""The command line: `jaxdamp fit` and `jaxdamp demo`, the two jobs that need no code, and `jaxdamp laws`."""

from jaxdamp.cli.commands import app


__all__ = ["app"]
