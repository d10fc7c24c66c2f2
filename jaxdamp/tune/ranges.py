"""The free parameters of a tuning and their ranges."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias, final

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp import _checks
from jaxdamp._random import sobol_points
from jaxdamp._tables import with_tied
from jaxdamp.dampers import AbstractDamper, not_identified
from jaxdamp.parameters import (
    Coordinates,
    FreeParameters,
    Parameter,
    free_parameters,
    get,
    match_parameters,
    match_paths,
    name_patterns,
    named_parameters,
    parameters,
    weight,
)
from jaxdamp.tune.limits import amount
from jaxdamp.tune.shape import curve_velocities


Pair = tuple[float, float]
FACTOR = 3.0  # default factor by which a number may decrease or increase
INSIDE = 1e-6  # distance from the open ends of a domain, relative to the unit of the coordinate
DAMPERS = ("**damper.**",)  # what is tuned by default, as far as it is adjustable
MOST_COMBINATIONS = 2000  # of choices, up to which all are driven if nothing else is free
MOST_CHOICES = 6  # numbers of which otherwise all combinations of two neighbours are tried
NO_BOUND = (-math.inf, math.inf)
MOST_NAMED = 2  # numbers without a range that are named
_ROUNDING = 1e-12  # of its unit, below which the end of a parameter is zero


@final
@dataclasses.dataclass(frozen=True)
class Choice:
    """The values that a parameter may take, in place of its bounds: clicks, or springs and shims of a catalogue.

    Arguments:
        values: two or more, in the unit of the parameter; of a vector, for each of its numbers.

    Raises:
        ValueError: fewer than two values, or such that are not finite.

    >>> Choice([2000.0, 1500.0, 2500.0]).values
    (1500.0, 2000.0, 2500.0)
    """

    values: tuple[float, ...]

    def __init__(self, values: Sequence[float] | Float[np.ndarray, " values"]) -> None:
        given = np.asarray(values)
        if given.ndim != 1 or given.dtype.kind not in "iuf" or not np.all(np.isfinite(given)) or len(set(given)) < 2:
            remedy = "Write `tune.Choice([1500.0, 2000.0, 2500.0])`."
            _checks.refuse("values", "be two or more finite numbers", _checks.described(values), remedy)
        object.__setattr__(self, "values", tuple(sorted({float(value) for value in given})))

    def around(self, value: float) -> list[float]:
        """The nearest values on both sides."""
        place = int(np.searchsorted(self.values, value))
        return list(dict.fromkeys([self.values[max(place - 1, 0)], self.values[min(place, len(self.values) - 1)]]))


Bound: TypeAlias = Sequence[float | int | None] | np.ndarray | Choice | None  # a lower and an upper one, or choices


class Change(NamedTuple):
    """One parameter before and after."""

    name: str  # path of the parameter
    before: float  # value of the start, in the unit
    after: float  # tuned value, in the unit
    unit: str  # in SI
    note: str  # "", "at its lower bound" or "at its upper bound"
    lower: float  # lower bound of the search
    upper: float  # upper bound of the search
    tied: tuple[str, ...] = ()  # the numbers that have the same value

    @property
    def remark(self) -> str:
        """The note, and the names of the numbers tied to this one."""
        return with_tied(self.note, self.tied)


@final
@dataclasses.dataclass(frozen=True)
class SearchRange:
    """Free numbers with the closed range of each, in physical units and double precision."""

    coordinates: Coordinates  # those of the search, whose free parameters are the vehicle's
    start: np.ndarray  # the value of each number to start from
    unit: np.ndarray  # the value of each number where its coordinate is one
    lower: np.ndarray  # the smallest allowed value of each number
    upper: np.ndarray  # the largest allowed value of each number
    origin: tuple[tuple[str, str], ...]  # of both bounds of each number: "default", "given", "domain" or "zero"
    choices: tuple[Choice | None, ...]  # the values allowed at the end; None for all between the bounds
    undetermined: tuple[str, ...] = ()  # the parameters left alone because no record determined them

    @property
    def is_choice(self) -> Bool[np.ndarray, " free"]:
        """Which numbers are choices."""
        return np.array([choice is not None for choice in self.choices])

    @property
    def is_held(self) -> Bool[np.ndarray, " free"]:
        """Which numbers stay at their start."""
        return self.lower == self.upper

    @property
    def free(self) -> FreeParameters:
        """The free parameters of the vehicle."""
        return self.coordinates.free

    def side(self, values: np.ndarray) -> list[str]:
        """The bound that each value is at: `"lower"`, `"upper"`, or nothing; choices and held numbers have none."""
        slack = np.where(self.is_choice | self.is_held, -np.inf, 2 * INSIDE * self.unit)
        low, high = values <= self.lower + slack, values >= self.upper - slack
        return ["lower" if at_low else "upper" if at_high else "" for at_low, at_high in zip(low, high, strict=True)]

    def notes_without_range(self, changes: Sequence[Change]) -> list[str]:
        """A sentence on numbers that left zero, to which no bound is in proportion; nothing without any."""
        left = [c for c, origin in zip(changes, self.origin, strict=True) if "zero" in origin and c.after != c.before]
        if not left:
            return []
        ends = [f"{c.name} ended at {amount(c.after, c.unit)}" for c in left[:MOST_NAMED]]
        more = f" and {len(left) - MOST_NAMED} more" * (len(left) > MOST_NAMED)
        bounds = f"`bounds={{{left[0].name.partition('[')[0]!r}: (lower, upper)}}`"
        return [f"{', '.join(ends)}{more}: zero, where a search starts, gives no range in proportion. Pass {bounds}."]

    def changes(self, values: np.ndarray) -> tuple[Change, ...]:
        """Every free number before and after, with its bounds."""
        free = self.free
        notes = [f"at its {side} bound" if side else "" for side in self.side(values)]
        ended = np.where(np.abs(values) < _ROUNDING * np.abs(self.unit), 0.0, values)
        columns = (free.names, self.start, ended, free.owners, notes, self.lower, self.upper, free.followers)
        return tuple(
            Change(name, float(before), float(after), p.unit, note, float(lower), float(upper), followers)
            for name, before, after, p, note, lower, upper, followers in zip(*columns, strict=True)
        )


def search_range(
    vehicle: object,
    over: Sequence[str] | Mapping[str, object] | None,
    freeze: Sequence[str],
    bounds: Mapping[str, object] | None,
    tie: Mapping[str, str] | None = None,
) -> SearchRange:
    """The free parameters and their ranges: of all dampers what can be changed and is known, if `over` is None."""
    over, undetermined = _adjustable(vehicle) if over is None else (over, ())
    in_over, names = (over, list(over)) if isinstance(over, Mapping) else ({}, over)
    free = free_parameters(vehicle, over=name_patterns("over", names), freeze=freeze, tie=tie)
    given, more = _given("over", in_over, free), _given("bounds", bounds or {}, free)
    twice = [path for path in more if path in given]
    if twice:
        remedy = "Give the bounds in one place."
        _checks.refuse("bounds", "leave out what `over` gives bounds for", ", ".join(twice), remedy)
    given |= more
    coordinates = Coordinates(free, smooth="none")
    start = np.asarray(free.values, np.float64)
    unit = np.concatenate([np.ravel(np.asarray(unit, np.float64)) for unit in coordinates.units])
    numbers = zip(free.names, free.owners, start, unit, strict=True)
    spans = {path: (one.values[0], one.values[-1]) if isinstance(one, Choice) else one for path, one in given.items()}
    still = _static_forces(vehicle, free)
    rows = [
        _one_range(name, p, float(value), size, spans.get(p.path), static)
        for (name, p, value, size), static in zip(numbers, still, strict=True)
    ]
    lower, upper, origin = zip(*rows, strict=True)
    choices = _choices(given, free)
    return SearchRange(coordinates, start, unit, np.array(lower), np.array(upper), origin, choices, undetermined)


def _static_forces(vehicle: object, free: FreeParameters) -> list[float | None]:
    """Of each number that is a force of a curve through points, that curve's force [N] at zero velocity."""
    static: list[float | None] = []
    for p in free.chosen:
        owner, _, name = p.path.rpartition(".")
        law, force = get(vehicle, owner) if owner else vehicle, None
        if isinstance(law, AbstractDamper) and name in law.constant_forces() and np.ndim(p.value) == 1:
            points = curve_velocities(law)
            force = None if points is None else float(np.interp(0.0, points, np.asarray(p.value, float)))
        static += [force] * p.value.size
    return static


def _choices(given: Mapping[str, Pair | Choice], free: FreeParameters) -> tuple[Choice | None, ...]:
    """The choice of each number, if it is one; refused where they are too many to be tried."""
    choices = tuple(one if isinstance(one := given.get(p.path), Choice) else None for p in free.owners)
    sizes = [len(one.values) for one in choices if one is not None]
    if len(sizes) > MOST_CHOICES and (len(sizes) < len(choices) or math.prod(sizes) > MOST_COMBINATIONS):
        must = f"have choices for up to {MOST_CHOICES} numbers, or choices alone with {MOST_COMBINATIONS} combinations"
        _checks.refuse("over", must, len(sizes), "Give bounds to the others, or tie numbers together.")
    return choices


def start_points(space: SearchRange, count: int, seed: int) -> np.ndarray:
    """So many starts, shape (count, free): the given one, and a Sobol sequence inside the bounds.

    Numbers between positive bounds are uniform in their logarithm. Without a bound, numbers are within three times
    their unit. The numbers of ordered vectors are sorted.
    """
    lower = np.where(np.isfinite(space.lower), space.lower, space.start - FACTOR * space.unit)
    upper = np.where(np.isfinite(space.upper), space.upper, space.start + FACTOR * space.unit)
    unit = sobol_points(seed, len(lower), 0, count - 1)
    points = lower + (upper - lower) * unit
    logarithmic = lower > 0
    ratio = upper[logarithmic] / lower[logarithmic]
    points[:, logarithmic] = lower[logarithmic] * ratio ** unit[:, logarithmic]
    end = 0
    for p in space.free.chosen:
        begin, end = end, end + p.value.size
        if p.domain.ordered:
            points[:, begin:end] = np.sort(points[:, begin:end], axis=1)
    return np.concatenate([space.start[None], points])


def _adjustable(vehicle: object) -> tuple[list[str], tuple[str, ...]]:
    """The parameters of the dampers that a workshop can change, and apart those that no record determined."""
    by_path = {p.path: p for p in parameters(vehicle)}
    inside = match_paths(list(by_path), DAMPERS)
    adjustable = [path for path in inside if by_path[path].adjustable]
    unknown = set(not_identified(vehicle))
    undetermined = tuple(path for path in adjustable if path in unknown)
    if len(undetermined) == len(adjustable):
        remedy = "Name parameters in `over` to move them nevertheless."
        records = " that the records of its fit determine" if undetermined else ""
        must = f"be given where no workshop can change a parameter of the dampers{records}"
        _checks.refuse("over", must, f"None, for {', '.join(inside)}", remedy)
    return [path for path in adjustable if path not in unknown], undetermined


def _given(argument: str, bounds: Mapping[str, object], free: FreeParameters) -> dict[str, Pair | Choice]:
    """Bounds by path, infinite without a bound. If two names match a parameter, the later one counts."""
    if not isinstance(bounds, Mapping) or not all(isinstance(name, str) for name in bounds):
        remedy = "Write `{'damper.rate': (1000.0, 5000.0)}`."
        _checks.refuse(argument, "be a mapping of parameters to bounds", _checks.described(bounds), remedy)
    every, leaders, by_path = named_parameters(free.tree, bounds), dict(free.ties), {}
    paths = [p.path for p in free.chosen]
    for name, bound in bounds.items():
        named = [leaders.get(path, path) for path in match_parameters(every, [name])]
        chosen = [path for path in named if path in paths]
        if not chosen:
            remedy = f"The free parameters are {', '.join(paths)}: add it to `over`, or leave its bounds out."
            _checks.refuse(f"{argument}[{name!r}]", "bound a parameter that is free", "one that is not", remedy)
        by_path |= dict.fromkeys(chosen, _pair(argument, name, bound))
    return by_path


def _pair(argument: str, name: str, bound: object) -> Pair | Choice:
    """A lower and an upper bound as numbers, or a choice."""
    if isinstance(bound, Choice):
        return bound
    if bound is None:
        return NO_BOUND
    label = f"{argument}[{name!r}]"
    must = "be a lower and an upper bound, as `(1000.0, 5000.0)`, or None for no bound"
    if not isinstance(bound, Sequence | np.ndarray) or isinstance(bound, str) or len(bound) != 2:
        _checks.refuse(label, must, repr(bound), "To hold a parameter at its start, name it in `freeze`.")
    try:
        lower, upper = (side if side is None else float(side) for side in bound)
    except (TypeError, ValueError):
        _checks.refuse(label, must, repr(bound), "Use None for a side without a bound.")
    pair = (-math.inf if lower is None else lower, math.inf if upper is None else upper)
    if not pair[0] < pair[1]:
        _checks.refuse(label, "have a lower bound below the upper one", repr(bound))
    return pair


def _one_range(
    name: str, p: Parameter, value: float, unit: float, given: Pair | None, static: float | None
) -> tuple[float, float, tuple[str, str]]:
    """The range of one number of a parameter: the intersection of its domain and its bounds."""
    if given is not None and not given[0] <= value <= given[1]:
        remedy = "Start inside the bounds or widen them."
        _checks.refuse(name, f"start between {given[0]:g} and {given[1]:g} [{p.unit or '-'}]", value, remedy)
    low, high = _default(p, value, static) if given is None else given
    source = "default" if given is None else "given"
    inside = 0.0 if p.command else INSIDE * unit
    edges = p.domain.lower + inside, p.domain.upper - inside
    end = "zero" if given is None and value == 0.0 and p.domain != weight and not p.command else "domain"
    ends = [end if math.isinf(edge) else "domain" for edge in edges]
    where = source if low > edges[0] else ends[0], source if high < edges[1] else ends[1]
    return min(max(low, edges[0]), value), max(min(high, edges[1]), value), where


def _default(p: Parameter, value: float, static: float | None) -> Pair:
    """The default range, in proportion to the start.

    One third to three times the start for numbers of one sign (rates, forces, velocities, exponents, knots); the same
    distance below the start as above it for numbers of either sign (coefficients, offsets); no bound but the domain if
    the start is zero or has no meaning, as for the weights of a network, and for commands between levels. Forces of a
    curve count from that at zero velocity, so that a point there, which no valve changes, is held.
    """
    if static is not None:
        ends = static + (value - static) / FACTOR, static + FACTOR * (value - static)
        return min(ends), max(ends)
    if value == 0.0 or p.domain == weight or (p.command and math.isfinite(p.domain.upper)):
        return NO_BOUND
    keeps_sign = p.domain.lower >= 0.0 or p.domain.upper <= 0.0 or p.domain.ordered
    far = FACTOR * value
    low, high = (value / FACTOR, far) if keeps_sign else (2.0 * value - far, far)
    return min(low, high), max(low, high)
