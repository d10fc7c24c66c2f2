"""Takes the points of a sweep through its compiled program, call after call."""

import dataclasses
import re
import time
from collections.abc import Callable, Iterator
from typing import final

import numpy as np

from jaxdamp.sweeps import processes
from jaxdamp.sweeps.axes import AbstractPoints
from jaxdamp.sweeps.program import Program, forget_errors, with_chunk


CALL = 0.3  # s that one call of the program should take
LONG = 60.0  # s of work left: compiling another program and comparing takes 4 to 10, and may save a fifth of them
TURNS = 3  # calls of each program before one of them is chosen; the fastest counts, other work only adds time


@dataclasses.dataclass
class _Pace:
    """A program and how fast it is."""

    program: Program
    rounds: int = 1  # chunks of the next call on each device
    calls: int = 0
    seconds: float = np.inf  # of a point, in the fastest call

    @property
    def capacity(self) -> int:
        """Points of the next call."""
        return self.program.capacity(self.rounds)


@final
class Runner:
    """Takes points through a program, in calls of a useful length; points that raise are found by halving.

    If the sweep takes long, another program of the same function is compiled. Both take calls in turn, and the faster
    one does the rest.

    Arguments:
        program: to begin with.
        points: of the sweep.
        other: makes the other program; None if there is none.

    Attributes:
        rate: points a second.
        error: what the function raised last.
    """

    def __init__(
        self, program: Program, points: AbstractPoints, other: Callable[[], Program | None] = lambda: None
    ) -> None:
        self._paces, self._points = [_Pace(program)], points
        self._other: Callable[[], Program | None] | None = other
        self._raised = False
        self.rate, self.error = 1.0, ""

    @property
    def program(self) -> Program:
        """The one that takes the next call, the faster one if two were compared."""
        return min(self._paces, key=lambda pace: pace.calls).program

    def results(self, left: np.ndarray) -> Iterator[tuple[np.ndarray, dict[str, np.ndarray] | None]]:
        """The points in pieces with their results; None where the function raises."""
        while left.size:
            pace = self._next(left.size)
            pending, left = [left[: pace.capacity]], left[pace.capacity :]
            while pending:
                indices = pending.pop()
                values, full = self._call(pace, indices)
                if values is None and full and pace.program.layout.chunk > 1:  # out of memory
                    pieces = max(-(-len(indices) // pace.program.capacity(1)), 1)
                    pending += np.array_split(indices, pieces)[::-1]
                elif values is None and len(indices) > 1:
                    pending += np.array_split(indices, 2)[::-1]
                else:
                    yield indices, values

    def _next(self, left: int) -> _Pace:
        """The program whose turn it is."""
        if self._other and self._paces[0].calls >= TURNS and left * self._paces[0].seconds > LONG:
            other, self._other = self._other(), None
            if other is not None:
                self._paces.append(_Pace(other))
        if all(pace.calls >= TURNS for pace in self._paces):
            self._paces = [min(self._paces, key=lambda pace: pace.seconds)]
        return min(self._paces, key=lambda pace: pace.calls)

    def _call(self, pace: _Pace, indices: np.ndarray) -> tuple[dict[str, np.ndarray] | None, bool]:
        """Results, or None and whether for want of memory, in which case the next calls take half the chunk."""
        start, results, error = time.perf_counter(), {}, ""
        try:
            results = pace.program.start(self._points.columns(indices))
        except (RuntimeError, FloatingPointError) as raised:
            error = str(raised) or repr(raised)
        full = "RESOURCE_EXHAUSTED" in error
        seconds, some_failed, some_full = processes.largest(time.perf_counter() - start, bool(error), full)
        if not some_failed:
            self._adapt(pace, len(indices), float(seconds))
            return pace.program.collect(results, len(indices)), False
        if some_full and pace.program.layout.chunk > 1:
            old = pace.program
            pace.program, pace.rounds = with_chunk(old.traced, old.layout.mesh, old.layout.chunk // 2), 1
        self._raised = True
        self.error = _last_line(error)
        return None, bool(some_full)

    def close(self) -> None:
        """Leave nothing behind that raises later."""
        if self._raised:
            forget_errors(self.program.layout.mesh)

    def _adapt(self, pace: _Pace, size: int, seconds: float) -> None:
        """Make the next call as long as it should be, but at most four times as long as this one."""
        self.rate = size / seconds
        rounds = -(-size // pace.program.capacity(1))
        pace.rounds = min(max(int(rounds * min(CALL / seconds, 4.0)), 1), pace.program.layout.rounds)
        pace.calls, pace.seconds = pace.calls + 1, min(pace.seconds, seconds / size)


def _last_line(error: str) -> str:
    """What a user wrote into an error, out of the report of a callback that raised."""
    lines = [line for line in error.splitlines() if re.match(r"\S*(Error|Exception)\S*: ", line)]
    line = (lines or error.strip().splitlines() or [""])[-1]
    return re.sub(r"^\S*Equinox\S*: ", "", line)
