"""The command line: the jobs that need no code, and lists of laws and vehicles."""

import gc
import signal
from typing import TYPE_CHECKING

from jaxdamp.cli import interrupt, streams


if TYPE_CHECKING:
    from jaxdamp.cli.application import app


__all__ = ["app", "main"]


def main() -> None:
    """Run the command line as a program of its own; Ctrl-C is answered from the first import on."""
    gc.set_threshold(100_000, 20, 100)  # traced programs make millions of objects without cycles
    gc.disable()  # until all is imported, which stays
    streams.write_plainly()
    with interrupt.watched(then=signal.SIG_IGN):  # nothing is left to stop while the process ends
        from jaxdamp.cli.application import app

        app(prog_name="jaxdamp")


def __getattr__(name: str) -> object:
    """The application is loaded when it is first used, so that `main` comes before all other imports."""
    if name == "app":
        from jaxdamp.cli.application import app

        return app
    raise AttributeError(f"module 'jaxdamp.cli' has no attribute {name!r}")
