"""One line of progress in the terminal or notebook, for work that takes longer than two seconds."""

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, final

from jaxdamp import _checks


BAR = 20  # characters


@final
class Progress:
    """`with Progress("Fitting") as progress: progress("besinger, 2 of 5")` writes over one line of the terminal.

    Nothing is shown during the first two seconds, or if the output is not a terminal. In a notebook the line is below
    the cell during the work and is not saved.
    """

    def __init__(self, label: str, delay: float = 2.0) -> None:
        self._label, self._due, self._width = label, time.monotonic() + delay, 0
        self._notebook, self._output = "ipykernel" in sys.modules, None
        self._stream = sys.stderr
        self._watched = self._notebook or self._stream.isatty()

    def __enter__(self) -> "Progress":
        return self

    def __call__(self, text: str) -> None:
        """Show the label and a text, in place of the last one."""
        if self._watched and time.monotonic() >= self._due:
            self._show(f"{self._label}: {text}")

    def _show(self, line: str) -> None:
        if self._notebook:
            self._output = _displayed(line, self._output)
            return
        self._stream.write("\r" + line.ljust(self._width))
        self._stream.flush()
        self._width = len(line)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Wipe the line."""
        if self._output is not None:
            _displayed("", self._output)
        elif self._width:
            self._show("")
            self._stream.write("\r")
            self._stream.flush()


def _displayed(line: str, output: Any) -> Any:
    """Show a line below the cell, in place of what an earlier output showed; gives the output."""
    from IPython.display import display

    content = {"text/plain": line}
    if output is None:
        return display(content, raw=True, display_id=True)
    output.update(content, raw=True)
    return output


def tell(
    progress: Callable[[int, int], None] | None,
    shown: Progress,
    done: int,
    total: int,
    rate: float,
    what: str = "points",
) -> None:
    """Say how far work of many points is, by the function of the caller or in a line with the time left."""
    if progress is not None and not callable(progress):
        _checks.refuse("progress", "be a function of two numbers, or None for a line in the terminal", repr(progress))
    if progress is not None:
        progress(done, total)
    else:
        full = BAR * done // total
        remaining = (total - done) / rate
        time_left = (
            f"{remaining:.0f} s"
            if remaining < 120
            else f"{remaining / 60:.0f} min"
            if remaining < 7200
            else f"{remaining / 3600:.1f} h"
        )
        shown(f"{'█' * full}{'·' * (BAR - full)} {100 * done // total} %, {done} of {total} {what}, {time_left} left")
