"""Points and angles of a vehicle as linear functions of its coordinates."""

from collections.abc import Mapping, Sequence
from typing import Any, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._types import ScalarLike


def _is_one(coefficient: object) -> bool:
    return isinstance(coefficient, float) and coefficient == 1.0


@final
class Point(eqx.Module):
    """Σ coefficient · coordinate: the height of a point [m] or an angle [rad], for small angles.

    Points can be added, subtracted and scaled: the extension of a link is `body.at(1.2) - wheel.at()`. `Body.at` gives
    points, `Body.pitch` and `Body.roll` give angles.

    Attributes:
        terms: the coefficient of each coordinate, by its name.

    >>> twist = Point({"roll": 1.0}) - (Point({"z_left": 1.0}) - Point({"z_right": 1.0})) * 0.5
    >>> twist.terms
    {'roll': 1.0, 'z_left': -0.5, 'z_right': 0.5}
    """

    terms: dict[str, Any]

    def __add__(self, other: "Point") -> "Point":
        terms = dict(self.terms)
        for name, coefficient in other.terms.items():
            terms[name] = terms[name] + coefficient if name in terms else coefficient
        return Point(terms)

    def __mul__(self, factor: ScalarLike | int) -> "Point":
        return Point({name: factor * coefficient for name, coefficient in self.terms.items()})

    __rmul__ = __mul__

    def __neg__(self) -> "Point":
        return self * -1.0

    def __sub__(self, other: "Point") -> "Point":
        return self + -other

    def of(self, values: Mapping[str, Any]) -> Any:
        """Its value for given values of the coordinates by name, such as a mode shape.

        >>> Point({"z_sprung": 1.0, "pitch": -1.0}).of({"z_sprung": 0.5, "pitch": 0.25})
        0.25
        """
        return sum(coefficient * values[name] for name, coefficient in self.terms.items())


def matrix(points: Sequence[Point], coordinates: Sequence[str]) -> Float[Array, "points coordinates"]:
    """The coefficients of points, one row each, in the order of the coordinates; other coordinates are ignored."""
    numbers: list[Any] = [0.0, 1.0]  # each entry is one of these: a gather compiles faster than a stack of rows
    entries = np.zeros((len(points), len(coordinates)), dtype=int)
    column = {name: j for j, name in enumerate(coordinates)}
    for i, point in enumerate(points):
        for name, coefficient in point.terms.items():
            if name in column:
                entries[i, column[name]] = 1 if _is_one(coefficient) else len(numbers)
                numbers += [] if _is_one(coefficient) else [coefficient]
    return jnp.stack([jnp.asarray(number, dtype=float) for number in numbers])[entries]
