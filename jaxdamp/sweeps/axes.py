"""The points of a sweep: a grid, a list, a random or a Sobol sample over named axes."""

import dataclasses
import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import final

import numpy as np

from jaxdamp import _checks
from jaxdamp._random import sobol_points
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Dataset


Columns = dict[str, np.ndarray]
Ranges = Mapping[str, tuple[float, float]]
POINT = "point"  # the dimension of a list of points
PARAMETER = "parameter"  # the dimension of derivatives
_ROUNDING = 1e-12  # of the largest value, by which a result may change along an axis without effect


class AbstractPoints(ABC):
    """Points in an order, as columns of numbers by the name of their axis."""

    @property
    @abstractmethod
    def names(self) -> list[str]:
        """Names of the axes."""

    @property
    def count(self) -> int:
        """Number of points."""
        return int(np.prod(list(self.shape.values())))

    @property
    @abstractmethod
    def shape(self) -> dict[str, int]:
        """Dimensions of the results by name."""

    @abstractmethod
    def columns(self, indices: np.ndarray) -> Columns:
        """The coordinates of some of the points."""

    @property
    @abstractmethod
    def coordinates(self) -> dict[str, tuple[str, np.ndarray]]:
        """The labels of the results, as xarray takes them."""


@dataclasses.dataclass(frozen=True)
class AbstractListed(AbstractPoints):
    """Points from given values of the axes."""

    values: Columns

    @property
    def names(self) -> list[str]:
        """Names of the axes."""
        return list(self.values)


@final
@dataclasses.dataclass(frozen=True)
class Grid(AbstractListed):
    """Every combination of the values of the axes; the last axis runs fastest."""

    @property
    def shape(self) -> dict[str, int]:
        """One dimension for each axis."""
        return {name: len(values) for name, values in self.values.items()}

    def columns(self, indices: np.ndarray) -> Columns:
        """The coordinates of some of the points."""
        places = np.unravel_index(indices, tuple(self.shape.values()))
        return {name: values[i] for (name, values), i in zip(self.values.items(), places, strict=True)}

    @property
    def coordinates(self) -> dict[str, tuple[str, np.ndarray]]:
        """The values of each axis along itself."""
        return {name: (name, values) for name, values in self.values.items()}


@final
@dataclasses.dataclass(frozen=True)
class Points(AbstractListed):
    """Points one by one, along the dimension `point`."""

    @property
    def shape(self) -> dict[str, int]:
        """The one dimension."""
        return {POINT: len(next(iter(self.values.values())))}

    def columns(self, indices: np.ndarray) -> Columns:
        """The coordinates of some of the points."""
        return {name: values[indices] for name, values in self.values.items()}

    @property
    def coordinates(self) -> dict[str, tuple[str, np.ndarray]]:
        """The values of every axis along the dimension of the points."""
        return {name: (POINT, values) for name, values in self.values.items()}


@final
@dataclasses.dataclass(frozen=True)
class Computed(AbstractPoints):
    """Points along the dimension `point` that are computed when they are needed, and never all held."""

    axes: tuple[str, ...]
    number: int
    at: Callable[[np.ndarray], Columns]

    @property
    def names(self) -> list[str]:
        """Names of the axes."""
        return list(self.axes)

    @property
    def shape(self) -> dict[str, int]:
        """The one dimension."""
        return {POINT: self.number}

    def columns(self, indices: np.ndarray) -> Columns:
        """The coordinates of some of the points."""
        return self.at(indices)

    @property
    def values(self) -> Columns:
        """The values of every axis at all points."""
        return self.at(np.arange(self.number))

    @property
    def coordinates(self) -> dict[str, tuple[str, np.ndarray]]:
        """The values of every axis along the dimension of the points."""
        return {name: (POINT, values) for name, values in self.values.items()}


def points(
    values: Mapping[str, object] | Callable[[np.ndarray], Mapping[str, object]], count: int | None = None
) -> Points | Computed:
    """A list of points, or a rule that computes them.

    Arguments:
        values: numbers for each axis, equally many; the first of each make the first point. Or a function from the
            numbers of points, an array of integers, to the numbers for each axis at these points: so a sweep of any
            size holds only the points that it works on. A function at the top of a module can be sent to other
            processes.
        count: number of points, if a function is given.

    >>> points({"rate": [1000.0, 2000.0], "mass": [300.0, 250.0]}).count
    2
    >>> points(lambda i: {"rate": 1000.0 + 0.1 * i}, count=1_000_000).count
    1000000
    """
    if callable(values):
        if count is None:
            _checks.refuse("count", "be given with a function", None, "Write `points(function, count=1_000_000)`.")
        _check_count(count)
        computed = functools.partial(_computed, values)
        return Computed(tuple(computed(np.arange(1))), count, computed)
    listed = Points(_columns("values", values))
    lengths = {name: len(column) for name, column in listed.values.items()}
    if len(set(lengths.values())) > 1:
        _checks.refuse("values", "have equally many numbers for each axis", lengths, "A mapping by itself is a grid.")
    if count is not None and count != listed.count:
        _checks.refuse("count", "be left out with a list of points", count, f"The list has {listed.count}.")
    return listed


def _computed(function: Callable[[np.ndarray], Mapping[str, object]], indices: np.ndarray) -> Columns:
    """The points of a user's function, checked."""
    columns = _columns("values", function(indices))
    for name, column in columns.items():
        if column.shape != indices.shape:
            must = f"return one number for each of {indices.size} points"
            _checks.refuse("values", must, f"one that returns {column.size} as {name!r}")
    return columns


@of_known_numbers
def random(ranges: Ranges, count: int, *, seed: int = 0, log: bool | Sequence[str] = False) -> Computed:
    """Points drawn independently and uniformly between limits.

    They are drawn when they are needed: a point depends on the seed and its number alone.

    Arguments:
        ranges: lower and upper limit for each axis.
        count: number of points.
        seed: the same seed draws the same points.
        log: axes whose logarithm is uniform: all of them if True, or their names.

    >>> random({"rate": (1e3, 1e5)}, 100, log=True).count
    100
    """
    return _drawn(ranges, count, log, functools.partial(_uniform, seed, len(ranges)))


@of_known_numbers
def sobol(ranges: Ranges, count: int, *, seed: int = 0, log: bool | Sequence[str] = False) -> Computed:
    """Points of a scrambled Sobol sequence, which fill the space between limits more evenly than random ones.

    Its averages are best where the count is a power of two. They are computed when they are needed.

    Arguments:
        ranges: lower and upper limit for each axis.
        count: number of points.
        seed: of the scrambling; the same seed gives the same points.
        log: axes whose logarithm is uniform: all of them if True, or their names.

    >>> sobol({"rate": (1000.0, 2000.0), "mass": (200.0, 400.0)}, 64).count
    64
    """
    return _drawn(ranges, count, log, functools.partial(sobol_points, seed, len(ranges)))


def _uniform(seed: int, axes: int, first: int, count: int) -> np.ndarray:
    """Consecutive points of the unit cube: a generator that draws one number for each axis, point after point."""
    generator = np.random.PCG64(seed)
    generator.advance(first * axes)
    return np.random.Generator(generator).random((count, axes))


def as_points(over: object) -> AbstractPoints:
    """What `sweep` takes as `over`: points as they are, a mapping as a grid."""
    if isinstance(over, AbstractPoints):
        return over
    if not isinstance(over, Mapping):
        remedy = "Write {'damper.rate': [1000.0, 2000.0]}, or use `jaxdamp.sweeps.points`, `random` or `sobol`."
        _checks.refuse("over", "be a mapping from names to values, or points", repr(over), remedy)
    return grid(over)


def grid(over: Mapping[str, object]) -> Grid:
    """Every combination of the values of the axes.

    Arguments:
        over: the values of each axis, in the unit of its parameter.

    Raises:
        ValueError: an axis with a value twice.
    """
    columns = _columns("over", over)
    for name, column in columns.items():
        values, counts = np.unique(column, return_counts=True)
        if counts.max() > 1:
            repeated = f"{values[counts.argmax()]:g}, {counts.max()} times"
            _checks.refuse(f"over[{name!r}]", "have each value once", repeated, "Leave the others out.")
    return Grid(columns)


def _columns(argument: str, values: Mapping[str, object]) -> Columns:
    """The numbers of each axis as float64, checked."""
    if not values:
        _checks.refuse(argument, "have at least one axis", values)
    columns = {}
    for name, numbers in values.items():
        _check_name(argument, name)
        try:
            column = np.asarray(numbers, dtype=np.float64)
        except (TypeError, ValueError):
            remedy = "Sweep over the index of a choice, and let the function pick by it (`jax.lax.switch`)."
            _checks.refuse(f"{argument}[{name!r}]", "be numbers", repr(numbers), remedy)
        if column.ndim != 1 or not column.size:
            remedy = "Write [1.0, 2.0] or `numpy.linspace(1.0, 2.0, 11)`; one value alone is [1.0]."
            _checks.refuse(f"{argument}[{name!r}]", "be a sequence of one or more numbers", repr(numbers), remedy)
        _checks.finite(f"{argument}[{name!r}]", column)
        columns[name] = column
    return columns


def _check_name(argument: str, name: object) -> None:
    if not isinstance(name, str) or not name or "/" in name or name in (POINT, PARAMETER):
        must = f"have names without '/' as keys, other than {POINT!r} and {PARAMETER!r}"
        _checks.refuse(argument, must, f"one with {name!r}")


def _check_count(count: int) -> None:
    if count < 1:
        _checks.refuse("count", "be one or more", count)


def _check_ranges(ranges: Ranges) -> None:
    if not ranges:
        _checks.refuse("ranges", "have at least one axis", ranges)
    for name, pair in ranges.items():
        if np.shape(pair) != (2,) or not np.all(np.isfinite(pair)) or not pair[0] < pair[1]:
            _checks.refuse(f"ranges[{name!r}]", "be two finite numbers in increasing order", pair)


def _drawn(ranges: Ranges, count: int, log: bool | Sequence[str], unit: Callable[[int, int], np.ndarray]) -> Computed:
    """Points between limits from consecutive points of the unit cube."""
    _check_count(count)
    _check_ranges(ranges)
    chosen = list(ranges) if log is True else [] if log is False else [log] if isinstance(log, str) else list(log)
    for name in chosen:
        _checks.one_of("log", name, ranges)
        _checks.positive(f"ranges[{name!r}]", ranges[name], "Zero and negative numbers have no logarithm.")
    for name in ranges:
        _check_name("ranges", name)
    spans = {name: (float(low), float(high), name in chosen) for name, (low, high) in ranges.items()}
    return Computed(tuple(ranges), count, functools.partial(_between, spans, unit))


def _between(
    spans: Mapping[str, tuple[float, float, bool]], unit: Callable[[int, int], np.ndarray], indices: np.ndarray
) -> Columns:
    """The points of these numbers between the limits of their axes."""
    if not indices.size:
        return {name: np.zeros(0) for name in spans}
    first, last = int(indices.min()), int(indices.max())
    shares, columns = unit(first, last + 1 - first)[indices - first], {}
    for (name, (low, high, log)), share in zip(spans.items(), shares.T, strict=True):
        spread = low * (high / low) ** share if log else low + (high - low) * share
        columns[name] = np.clip(spread, low, high)
    return columns


def without_effect(data: Dataset) -> dict[str, list[str]]:
    """The axes of a grid along which a result does not change anywhere, but for rounding, by the name of the result.

    No value of such a parameter is better than another. Axes of one value, and points that are no grid, say nothing.

    Arguments:
        data: of `jaxdamp.sweep`.

    >>> import jaxdamp
    >>> data = jaxdamp.sweep(lambda p: {"area": 2.0 * p["a"] + 0.0 * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0]})
    >>> without_effect(data)
    {'area': ['b']}
    """
    idle = {}
    dims = [str(name) for name in data["failed"].dims if data.sizes[name] > 1 and name in data.coords]
    for name, result in data.data_vars.items():
        if result.dims != data["failed"].dims:
            continue
        size = _ROUNDING * float(np.abs(result).max())
        pairs = {over: result.count(over) > 1 for over in dims}
        flat = [
            over
            for over, compared in pairs.items()
            if compared.any() and bool(((result.max(over) - result.min(over)).where(compared, 0.0) <= size).all())
        ]
        if flat:
            idle[str(name)] = flat
    return idle
