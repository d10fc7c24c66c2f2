"""The scale that motions alone cannot show: all masses, rates and forces larger by one factor."""

import re
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd
from jaxdamp.parameters import FreeParameters


UNSEEN = 1e-6  # change of the channels when the scale is doubled, relative to them, that counts as none


class FreeScale(NamedTuple):
    """Numbers that may all grow by one factor without any change of the channels, and the one that is held.

    Attributes:
        names: of the numbers; empty if the records show the scale.
        held: index of the number held, the first mass if there is one; None if none can be.
    """

    names: tuple[str, ...] = ()
    held: int | None = None


def force_powers(free: FreeParameters) -> Float[np.ndarray, " free"]:
    """How often each number's unit contains a force or a mass: 1 for N/m and kg, −1 for K/J, 0 for m/s.

    >>> from jaxdamp.parameters import free_parameters
    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> force_powers(free_parameters(quarter_car_000(), over=["sprung_mass", "rate"])).tolist()
    [1.0, 1.0]
    """
    return np.array([_power(p.unit) for p in free.owners], float)


def _power(unit: str) -> int:
    above, _, below = unit.partition("/")
    return sum(sign * len(re.findall(r"\b(?:N|kg|Pa|J|W)\b", part)) for sign, part in ((1, above), (-1, below)))


def free_scale(problem: Problem, point: SearchEnd) -> FreeScale:
    """Whether all masses, rates and forces may grow by one factor, from the derivatives at a point.

    They may not where a force is measured, or where one of them is frozen.
    """
    free = problem.free
    powers = force_powers(free)
    change = float(np.linalg.norm(point.jacobian @ (powers * point.values)))
    if not np.any(powers) or not change < UNSEEN * problem.level:
        return FreeScale()
    single = [i for i, p in enumerate(free.owners) if powers[i] and p.value.ndim == 0]
    masses = [i for i in single if free.owners[i].unit == "kg"]
    names = tuple(name for name, power in zip(free.names, powers, strict=True) if power)
    return FreeScale(names, next(iter([*masses, *single]), None))


def without(problem: Problem, end: SearchEnd, held: int | None) -> tuple[Problem, SearchEnd]:
    """The problem and its minimum without the number that was held."""
    if held is None:
        return problem, end
    free, path = problem.free, problem.free.owners[held].path
    ties = tuple(pair for pair in free.ties if pair[1] != path)
    free = FreeParameters(free.tree, tuple(p for p in free.chosen if p.path != path), ties)
    rest = np.delete(end.values, held)
    return problem._replace(free=free), end._replace(values=rest, jacobian=np.delete(end.jacobian, held, axis=1))
