"""The numbers that a tuning may change, and the range of each."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, final

import numpy as np

from jaxdamp import _checks
from jaxdamp.parameters import (
    FreeParameters,
    Parameter,
    free_parameters,
    match_paths,
    name_patterns,
    parameters,
    weight,
)


Pair = tuple[float, float]
FACTOR = 3.0  # by which a number may fall or rise if nobody gives bounds
INSIDE = 1e-6  # share of its start by which a number stays off the open ends of its domain
NO_BOUND = (-math.inf, math.inf)


@final
@dataclasses.dataclass(frozen=True)
class SearchRange:
    """Free numbers with the closed range of each, in physical units and double precision.

    Attributes:
        free: the free parameters of the vehicle.
        start: the value of each number to start from.
        scale: the magnitude of each start, one where it is zero.
        lower: the smallest allowed value of each number.
        upper: the largest allowed value of each number.
        origin: where the two bounds of each number come from: `"default"`, `"given"` or `"domain"`.
    """

    free: FreeParameters
    start: np.ndarray
    scale: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    origin: tuple[tuple[str, str], ...]

    def side(self, values: np.ndarray) -> list[str]:
        """The bound that each value lies on: `"lower"`, `"upper"`, or nothing."""
        slack = 2 * INSIDE * self.scale
        low, high = values <= self.lower + slack, values >= self.upper - slack
        return ["lower" if at_low else "upper" if at_high else "" for at_low, at_high in zip(low, high, strict=True)]


def search_range(
    vehicle: Any,
    over: Sequence[str] | Mapping[str, Any],
    freeze: Sequence[str],
    bounds: Mapping[str, Any] | None,
) -> SearchRange:
    """The free parameters and their ranges.

    Raises:
        ValueError: names that fit no parameter, or no free one; bounds of a wrong shape, given twice, or without the
            start between them.
    """
    in_over, names = (over, list(over)) if isinstance(over, Mapping) else ({}, over)
    free = free_parameters(vehicle, over=name_patterns("over", names), freeze=freeze)
    paths = [p.path for p in free.chosen]
    given = _given("over", in_over, vehicle, paths)
    more = _given("bounds", bounds or {}, vehicle, paths)
    twice = [path for path in more if given.get(path) is not None]
    if twice:
        remedy = "Give the bounds in one place."
        _checks.refuse("bounds", "leave out what `over` gives bounds for", ", ".join(twice), remedy)
    given = {path: given.get(path) or more.get(path) for path in paths}
    start = np.concatenate([np.ravel(np.asarray(p.value, np.float64)) for p in free.chosen])
    scale = np.where(start == 0.0, 1.0, np.abs(start))
    lower, upper, origin = [], [], []
    position = 0
    for p in free.chosen:
        for index in range(p.value.size):
            low, high, where = _one_range(p, index, scale[position], given[p.path])
            lower.append(low)
            upper.append(high)
            origin.append(where)
            position += 1
    return SearchRange(free, start, scale, np.array(lower), np.array(upper), tuple(origin))


def _given(argument: str, bounds: Mapping[str, Any], vehicle: Any, free: Sequence[str]) -> dict[str, Pair | None]:
    """Bounds by path, an open side infinite. Of two names for one parameter the later counts."""
    known, found = [p.path for p in parameters(vehicle)], {}
    for name, bound in bounds.items():
        named = match_paths(known, [name])
        chosen = [path for path in named if path in free]
        if not chosen:
            remedy = f"The free parameters are {', '.join(free)}: add it to `over`, or leave its bounds out."
            _checks.refuse(f"{argument}[{name!r}]", "bound a parameter that is free", "one that is not", remedy)
        found |= dict.fromkeys(chosen, _pair(argument, name, bound))
    return found


def _pair(argument: str, name: str, bound: Any) -> Pair:
    """A lower and an upper bound as numbers."""
    if bound is None:
        return NO_BOUND
    label = f"{argument}[{name!r}]"
    must = "be a lower and an upper bound, as `(1000.0, 5000.0)`, or None for no bound"
    if not isinstance(bound, Sequence | np.ndarray) or isinstance(bound, str) or len(bound) != 2:
        _checks.refuse(label, must, repr(bound), "To keep a parameter as it is, name it in `freeze`.")
    try:
        lower, upper = (side if side is None else float(side) for side in bound)
    except (TypeError, ValueError):
        _checks.refuse(label, must, repr(bound), "A side that should stay open is None.")
    pair = (-math.inf if lower is None else lower, math.inf if upper is None else upper)
    if not pair[0] < pair[1]:
        _checks.refuse(label, "have a lower bound below the upper one", repr(bound))
    return pair


def _one_range(p: Parameter, index: int, scale: float, given: Pair | None) -> tuple[float, float, tuple[str, str]]:
    """The range of one number of a parameter: what its domain and its bounds have in common."""
    value = float(np.ravel(np.asarray(p.value, np.float64))[index])
    if given is not None and not given[0] <= value <= given[1]:
        remedy = "Start inside the bounds or widen them."
        name = p.path if p.value.ndim == 0 else f"{p.path}[{index}]"
        _checks.refuse(name, f"start between {given[0]:g} and {given[1]:g} [{p.unit or '-'}]", value, remedy)
    low, high = _default(p, value) if given is None else given
    source = "default" if given is None else "given"
    edges = p.domain.lower + INSIDE * scale, p.domain.upper - INSIDE * scale
    where = source if low > edges[0] else "domain", source if high < edges[1] else "domain"
    return min(max(low, edges[0]), value), max(min(high, edges[1]), value), where


def _default(p: Parameter, value: float) -> Pair:
    """A range in proportion to the start.

    A third to three times the start, where a number keeps its sign (rates, forces, velocities, exponents, knots); as
    far below the start as above it, where its sign is free (coefficients, offsets); no bound where the start is zero
    or says nothing, as of the weights of a network.
    """
    if value == 0.0 or p.domain == weight:
        return NO_BOUND
    keeps_sign = p.domain.lower >= 0.0 or p.domain.upper <= 0.0 or p.domain.steps is not None
    far = FACTOR * value
    low, high = (value / FACTOR, far) if keeps_sign else (2.0 * value - far, far)
    return min(low, high), max(low, high)
