"""One line of progress, for work that has taken longer than two seconds and that somebody is watching."""

import sys
import time
from types import TracebackType
from typing import final


@final
class Progress:
    """`with Progress("Fitting") as progress: progress("besinger, 2 of 5")` writes over one line of the terminal.

    Nothing is shown before two seconds have gone by, nor where the output goes to a file. In a notebook the line is
    written below the cell.
    """

    def __init__(self, label: str, delay: float = 2.0) -> None:
        self._label, self._due, self._width = label, time.monotonic() + delay, 0
        self._stream = sys.stdout if "ipykernel" in sys.modules else sys.stderr
        self._watched = "ipykernel" in sys.modules or self._stream.isatty()

    def __enter__(self) -> "Progress":
        return self

    def __call__(self, text: str) -> None:
        """Show the label and a text, in place of the last one."""
        if self._watched and time.monotonic() >= self._due:
            self._write(f"{self._label}: {text}")

    def _write(self, line: str) -> None:
        self._stream.write("\r" + line.ljust(self._width))
        self._stream.flush()
        self._width = len(line)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Wipe the line."""
        if self._width:
            self._write("")
            self._stream.write("\r")
            self._stream.flush()
