"""`sweep`: one function at many points."""

import dataclasses
import os
import re
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, final

import numpy as np
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._progress import Progress
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Scalar
from jaxdamp.sweeps.axes import AbstractPoints, as_points
from jaxdamp.sweeps.devices import choose_devices, is_first, largest, several
from jaxdamp.sweeps.file import SweepFile
from jaxdamp.sweeps.function import HasDomain, HasLanes, HasPrinted, HasSideBySide, HasUnits, Traced, trace
from jaxdamp.sweeps.program import Program, forget_errors, prepare, quiet, with_chunk
from jaxdamp.sweeps.table import Table, extent


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
        seconds, some_failed, some_full = largest(time.perf_counter() - start, bool(error), full)
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


if TYPE_CHECKING:
    import xarray


BAR = 20  # characters
COMPILED, PRINTED = "compiled by XLA", "printed as C"


@of_known_numbers
def sweep(
    function: Callable[[dict[str, Scalar]], Mapping[str, Array]],
    over: Mapping[str, object] | AbstractPoints,
    *,
    chunk: int | None = None,
    devices: int | Sequence[object] | None = None,
    gradients: bool | Literal["forward", "reverse"] = False,
    file: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> "xarray.Dataset":
    """Compute a function at every point of a grid, a list or a sample: all cores, or all GPUs, many points at a time.

    A point at which a result is not finite, or at which the function raises while it runs (`equinox.error_if`), does
    not stop the sweep: what is not finite becomes NaN, and a warning at the end says how many points failed, where and
    why. The coordinate `failed` marks them, `reason` says why, `attrs["failed_points"]` counts them. Points that the
    function itself calls out of its domain, as a `Ride` does with a negative mass, are not computed, and fail too.

    A processor counts as one device until `jaxdamp.configure()` is called, before anything is computed. In several
    processes joined by `jax.distributed`, every process makes the same call and gets all the results.

    Arguments:
        function: a pure JAX function from a point, a mapping from the names of the axes to scalars, to results by name:
            numbers, or arrays of fixed shape. An equinox module that is called so is compiled once for all values of
            its arrays; arrays that a plain function closes over are compiled in. It may say more of itself
            (`sweeps.SweepFunction`): `units` of results and axes, which label the results; `lanes`, the number of
            points that are computed side by side on a CPU; `derivatives`, the modes that pass; `side_by_side()`, a form
            that is compiled in its place; `out_of_domain(columns)`, a text for each of many points, empty for those
            that can be computed.
        over: values for each axis, whose every combination is taken (the last axis runs fastest); or
            `jaxdamp.sweeps.points`, `random` or `sobol`. The function gets them as floating numbers.
        chunk: points computed side by side on one device; chosen to fit into the memory if left out.
        devices: how many devices (of each process), or which; all of them if left out.
        gradients: also the exact derivative of each scalar result `r` by each axis, as `d_r` along the dimension
            `parameter`. True chooses between `"forward"`, for few axes, and `"reverse"`, for many, which needs more
            memory.
        file: a netCDF file (`.nc`) for the results, written every ten seconds or so. The same sweep goes on from it
            after an interruption.
        progress: called with the number of points done and of all points; a line in the terminal if it is left out.

    Returns:
        The results by name with the axes as dimensions (for a list, along `point`). Of a `Ride`, `attrs["loop"]` says
        by what its loop was compiled at the end: XLA, or the C compiler where a long sweep found that to be faster; the
        numbers are the same to rounding.

    Raises:
        ValueError: axes that are no numbers, a function that does not know an axis or returns no named numbers, no
            point inside the function's domain, a file of another sweep.

    >>> data = sweep(lambda p: {"product": p["a"] * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0, 5.0]})
    >>> float(data["product"].sel(a=2.0, b=5.0))
    10.0
    """
    if not callable(function):
        remedy = "The call is `sweep(function, over)`, such as `sweep(Ride(car, road), {'damper.rate': [1e3, 2e3]})`."
        _checks.refuse("function", "be a function of a point", _checks.described(function), remedy)
    if gradients not in (False, True, "forward", "reverse"):
        _checks.refuse("gradients", "be False, True, 'forward' or 'reverse'", repr(gradients))
    points = as_points(over)
    function = function.side_by_side() if isinstance(function, HasSideBySide) else function
    traced = trace(function, points.names, gradients)
    table = Table.empty(points, traced, function.units if isinstance(function, HasUnits) else {})
    stored = None if file is None else SweepFile(file, table)
    if stored is not None:
        stored.resume()
    _leave_out(function, table)
    left = np.flatnonzero(~table.done)
    loop = COMPILED
    if left.size:
        program = prepare(traced, len(left), chunk, devices, _lanes(function))
        runner = Runner(program, points, lambda: _printed(function, traced, len(left), chunk, devices))
        with Progress("Sweeping") as shown, quiet():
            try:
                for indices, results in runner.results(left):
                    table.fill(indices, results, runner.error)
                    if stored is not None:
                        stored.save()
                    _tell(progress, shown, int(table.done.sum()), points.count, runner.rate)
            finally:
                if stored is not None:
                    stored.save(now=True)
            runner.close()
        loop = COMPILED if runner.program.traced is traced else PRINTED
    table.warn()
    data = table.label()
    return data.assign_attrs(loop=loop) if isinstance(function, HasPrinted) else data


def _printed(function: object, traced: Traced, count: int, chunk: int | None, devices: object) -> Program | None:
    """The program with its loop printed as C, if the function has one that this machine can compile."""
    on_cpu = choose_devices(devices)[0].platform == "cpu" and not several()
    printed = function.printed_side_by_side() if isinstance(function, HasPrinted) else None
    if printed is None or traced.mode is not None or not on_cpu:
        return None
    try:
        with warnings.catch_warnings(action="ignore"):  # of axes, which were given before
            printed_trace = trace(printed, list(traced.axes), False)._replace(fingerprint=traced.fingerprint)
        return prepare(printed_trace, count, chunk, devices, _lanes(printed))
    except NotImplementedError:
        return None


def _lanes(function: object) -> int | None:
    return function.lanes if isinstance(function, HasLanes) else None


def _leave_out(function: object, table: Table) -> None:
    """Mark the points that the function cannot take; refuse if that is all of them."""
    if not isinstance(function, HasDomain):
        return
    columns = table.points.columns(np.arange(table.points.count))
    reasons = np.asarray(function.out_of_domain(columns), dtype=object)
    if np.all(reasons != ""):
        remedy = "Sweep over values that it can have."
        must = f"hold a point that can be computed ({'; '.join(dict.fromkeys(reasons))})"
        _checks.refuse("over", must, f"{extent(columns)}, all outside", remedy)
    table.leave_out(reasons)


def _tell(progress: Callable[[int, int], None] | None, shown: Progress, done: int, total: int, rate: float) -> None:
    if progress is not None:
        progress(done, total)
    elif is_first():
        full = BAR * done // total
        remaining = (total - done) / rate
        time_left = (
            f"{remaining:.0f} s"
            if remaining < 120
            else f"{remaining / 60:.0f} min"
            if remaining < 7200
            else f"{remaining / 3600:.1f} h"
        )
        shown(f"{'█' * full}{'·' * (BAR - full)} {100 * done // total} %, {done} of {total} points, {time_left} left")
