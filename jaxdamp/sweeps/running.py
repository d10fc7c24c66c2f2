"""A function over points while it is computed: its trace, its program, and calls of a useful length."""

import dataclasses
import functools
import re
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import final

import jax
import numpy as np

from jaxdamp._warned import warn
from jaxdamp.sweeps.axes import AbstractListed, AbstractPoints, Columns, Points
from jaxdamp.sweeps.function import (
    Gradients,
    HasDomain,
    HasLanes,
    HasPrinted,
    HasReach,
    HasSequence,
    HasSideBySide,
    HasUnits,
    PointFunction,
    Traced,
    trace,
)
from jaxdamp.sweeps.program import Program, choose_devices, forget_errors, prepare, with_chunk
from jaxdamp.sweeps.table import Table


CALL = 0.3  # s that one call of the program should take
LONG = 60.0  # s of work left: compiling another program and comparing takes 4 to 10, and may save a fifth of them
SPREAD = 4096  # points that show the range of those that are computed when they are needed
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

    If the sweep takes long and there is another program of the same function, both take calls in turn, and the faster
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

    def results(self, left: np.ndarray, later: int = 0) -> Iterator[tuple[np.ndarray, dict[str, np.ndarray] | None]]:
        """The points in pieces with their results, None where the function raises; `later` more points may follow."""
        while left.size:
            pace = self._next(left.size + later)
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
        if not error:
            self._adapt(pace, len(indices), time.perf_counter() - start)
            return pace.program.collect(results, len(indices)), False
        if full and pace.program.layout.chunk > 1:
            old = pace.program
            pace.program, pace.rounds = with_chunk(old.traced, old.layout.mesh, old.layout.chunk // 2), 1
        self._raised = True
        self.error = _last_line(error)
        return None, full

    def close(self) -> None:
        """Leave nothing behind that raises later."""
        if self._raised:
            forget_errors(self.program.layout.mesh)
            self._raised = False

    def _adapt(self, pace: _Pace, size: int, seconds: float) -> None:
        """Make the next call as long as it should be, but at most four times as long as this one."""
        self.rate = size / seconds
        rounds = -(-size // pace.program.capacity(1))
        pace.rounds = min(max(int(rounds * min(CALL / seconds, 4.0)), 1), pace.program.layout.rounds)
        pace.calls, pace.seconds = pace.calls + 1, min(pace.seconds, seconds / size)


def _of_machine(error: BaseException | None) -> bool:
    """Whether the machine refused something, not what was asked for; between the two JAX puts its own stack trace."""
    return error is not None and (isinstance(error, OSError) or _of_machine(error.__cause__))


def _last_line(error: str) -> str:
    """What a user wrote into an error, out of the report of a callback that raised."""
    lines = [line for line in error.splitlines() if re.match(r"\S*(Error|Exception)\S*: ", line)]
    line = (lines or error.strip().splitlines() or [""])[-1]
    return re.sub(r"^\S*Equinox\S*: ", "", line)


COMPILED, PRINTED = "compiled by XLA", "printed as C"


@final
class Computation:
    """What a sweep computes; pickled, it leaves behind what it traced.

    Arguments:
        function: of a point.
        points: at which it is computed.
        gradients: as in `jaxdamp.sweep`.
        chunk: points side by side on a device.
        devices: as in `jaxdamp.sweep`.
    """

    def __init__(
        self,
        function: PointFunction,
        points: AbstractPoints,
        gradients: Gradients = False,
        chunk: int | None = None,
        devices: int | Sequence[object] | None = None,
    ) -> None:
        self.given, self.points = function, points
        self._gradients: Gradients = gradients
        self._chunk, self._devices = chunk, devices

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in vars(self).items() if name not in ("function", "traced")}

    @functools.cached_property
    def is_sequence(self) -> bool:
        """Whether the points are computed one after the other: so few that most of the time is that of compiling."""
        few = isinstance(self.given, HasSequence) and self.points.count <= self.given.sequential_points
        return few and self._chunk is None

    @functools.cached_property
    def function(self) -> PointFunction:
        """The form of the function that is compiled."""
        function = self.given.reaching(_spread(self.points)) if isinstance(self.given, HasReach) else self.given
        if self.is_sequence or not isinstance(function, HasSideBySide):
            return function
        return function.side_by_side()

    @functools.cached_property
    def traced(self) -> Traced:
        """The function as a program of arrays."""
        return trace(self.function, self.points.names, self._gradients)

    def empty(self, indices: np.ndarray | None = None) -> Table:
        """A table of all points, or of some."""
        points = self.points if indices is None else Points(self.points.columns(indices))
        return Table.empty(points, self.traced, self.function.units if isinstance(self.function, HasUnits) else {})

    def leave_out(self, table: Table) -> bool:
        """Mark the points of a table that the function cannot take; whether that is all of them."""
        if not isinstance(self.function, HasDomain):
            return False
        columns = table.points.columns(np.arange(table.points.count))
        reasons = np.asarray(self.function.out_of_domain(columns), dtype=object)
        table.leave_out(reasons)
        return bool(np.all(reasons != ""))

    def runner(self, count: int) -> Runner:
        """Runs calls of about so many points: of few one after the other, of many by a printed loop if there is one.

        A long sweep compares it with that of XLA, as other work on the machine may turn that round.
        """

        def compiled() -> Program:
            chunk = 1 if self.is_sequence else self._chunk
            return prepare(self.traced, count, chunk, self._devices, _lanes(self.function), quickly=self.is_sequence)

        printed = self._printed(count)
        return Runner(compiled(), self.points) if printed is None else Runner(printed, self.points, compiled)

    def _printed(self, count: int) -> Program | None:
        """The program with its loop printed as C, if the function has one that this machine can compile."""
        function, traced = self.function, self.traced
        if self.is_sequence or traced.mode is not None or not isinstance(function, HasPrinted):
            return None
        printed = function.printed_side_by_side()
        if printed is None:
            return None
        try:
            with (
                jax.default_device(choose_devices(self._devices)[0]),  # for which it is printed
                warnings.catch_warnings(action="ignore"),  # of axes, which were given before
            ):
                printed_trace = trace(printed, list(traced.axes), False)._replace(fingerprint=traced.fingerprint)
                return prepare(printed_trace, count, self._chunk, self._devices, _lanes(printed), quickly=True)
        except NotImplementedError as error:
            if _of_machine(error):
                warn(f"{error} This sweep goes on with the loop of XLA.")
            return None

    @property
    def can_be_printed(self) -> bool:
        """Whether the function has a loop that may be printed."""
        return isinstance(self.function, HasPrinted)

    def loop(self, runner: Runner) -> str:
        """By what the loop of the function was compiled at the end."""
        told = isinstance(self.function, HasPrinted) and self.function.is_printed
        return PRINTED if told or runner.program.traced is not self.traced else COMPILED


def _spread(points: AbstractPoints) -> Columns:
    """The values of the axes: all that are listed, or those of some points all over."""
    if isinstance(points, AbstractListed):
        return points.values
    return points.columns(np.unique(np.linspace(0, points.count - 1, SPREAD).astype(int)))


def _lanes(function: object) -> int | None:
    return function.lanes if isinstance(function, HasLanes) else None
