"""Steps for many designs of a vehicle: as many as the steepest needs; and which of them no step can follow."""

import dataclasses
from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping
from typing import Generic, TypeVar, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Scalar
from jaxdamp.parameters import named_parameters
from jaxdamp.simulation.stability import LARGEST, MOST, each_needs
from jaxdamp.vehicles import AbstractVehicle


K = TypeVar("K")
PIECE = 1024  # designs that are looked at side by side


@final
@dataclasses.dataclass(frozen=True)
class Designs(Generic[K]):
    """The designs of a vehicle with other numbers, and what they ask of steps between two instants.

    Arguments:
        build: the vehicle with some of its numbers replaced; or several of them, such as one in each condition.
        dt: spacing of the instants [s].
        several: whether these are several, with an axis for them in front of all numbers.
    """

    build: Callable[[dict[K, Scalar | float]], AbstractVehicle]
    dt: float
    several: bool = False

    def needed(self, numbers: Mapping[K, float | int]) -> float | int:
        """The substeps that a design needs, however many; infinite for what no vehicle can be."""
        try:
            return max(self._counts(self.build(dict(numbers)), self.several))
        except ValueError:
            return np.inf

    def steepest(self, values: Mapping[K, Iterable[float | int]]) -> int:
        """The most substeps that a combination of values needs, however many; 1 without any.

        Values that no step can follow where all other numbers are those of the vehicle are left out.
        """
        alone = {name: [x for x in of if self.needed({name: x}) <= MOST] for name, of in values.items()}
        chosen, most = dict[K, float](), 1
        for name in [*alone] * min(len(alone), 2):  # twice, as the steepest value may depend on numbers after it
            for value in alone[name]:
                there = {**chosen, name: value}
                count = self.needed(there)
                if most <= count < np.inf:
                    chosen, most = there, int(count)
        return most

    def each(self, columns: Mapping[K, np.ndarray]) -> np.ndarray:
        """The substeps that each of many designs needs, however many, each of which a vehicle can be."""
        count, indices = len(next(iter(columns.values()))), list[int]()
        for first in range(0, count, PIECE):
            piece = {name: jnp.asarray(column[first : first + PIECE]) for name, column in columns.items()}
            indices += self._counts(eqx.filter_vmap(self.build)(piece), 1 + self.several)
        return np.array(indices).reshape(count, -1).max(axis=1)

    def _counts(self, vehicles: AbstractVehicle, axes: int) -> list[int]:
        """The substeps of each of several vehicles with so many axes in front of their numbers."""
        counts = list[int]()

        def look(vehicle: AbstractVehicle) -> float:
            counts.extend(each_needs(vehicle, self.dt, np.inf))
            return 0.0

        for _ in range(axes):
            look = eqx.filter_vmap(look)
        look(vehicles)
        return counts


def steepest_between(designs: Designs[str], vehicle: AbstractVehicle, columns: Mapping[str, np.ndarray]) -> int:
    """The most substeps of designs between the ends of values of a vehicle's parameters (`Designs.steepest`)."""
    inside = {name: column[can_follow(designs, vehicle, name, column)] for name, column in columns.items()}
    return designs.steepest({name: (column.min(), column.max()) for name, column in inside.items() if column.size})


def can_follow(
    designs: Designs[str], vehicle: AbstractVehicle, name: str, column: np.ndarray, most: float | int = MOST
) -> np.ndarray:
    """For which values of one parameter a vehicle needs at most so many substeps.

    From the vehicle's own value on a parameter only gets steeper in each direction, or less steep.
    """

    def beyond(value: float) -> bool:
        return designs.needed({name: value}) > most

    first, follows = named_parameters(vehicle, [name])[0], np.ones(column.shape, bool)
    if first.value.ndim:
        return follows
    ordered = np.unique(column)
    middle = int(np.searchsorted(ordered, float(first.value)))
    for side in (ordered[middle:], ordered[:middle][::-1]):
        if side.size and beyond(side[-1]):
            follows &= ~np.isin(column, side[bisect_left(side, True, key=beyond) :])
    return follows


def too_steep(
    designs: Designs[str], vehicle: AbstractVehicle, columns: Mapping[str, np.ndarray], steps: int
) -> np.ndarray:
    """Which of many points so many substeps cannot follow: a text, empty where they can."""
    reasons, said = np.full(len(next(iter(columns.values()))), "", dtype=object), "a law is too steep for"
    steps_said = f"{said} {steps} step{'s' * (steps > 1)} in {designs.dt:g} s: pass a shorter `dt`"
    for name, column in columns.items():
        left = np.flatnonzero(reasons == "")
        wrong = left[~can_follow(designs, vehicle, name, column[left], steps / LARGEST)]
        reasons[wrong] = f"with such a {name} {steps_said}"
    left = np.flatnonzero(reasons == "")
    inside = {name: column[left] for name, column in columns.items()}
    if len(columns) > 1 and left.size and steepest_between(designs, vehicle, inside) * LARGEST > steps:
        reasons[left[designs.each(inside) * LARGEST > steps]] = f"with these values together {steps_said}"
    return reasons
