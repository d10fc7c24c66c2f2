"""Steps for many designs of a vehicle: as many as the steepest needs; and which of them no step can follow."""

from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

import numpy as np

from jaxdamp.parameters import named_parameters, replace
from jaxdamp.simulation.stability import LARGEST, substeps_needed
from jaxdamp.vehicles import AbstractVehicle


K = TypeVar("K")


def steepest(
    design: Callable[[dict[K, float]], AbstractVehicle], values: Mapping[K, Iterable[float]], dt: float
) -> int:
    """The most substeps that a design needs, of those that steps of dt [s] can follow; 1 without any.

    Arguments:
        design: the vehicle with some of its numbers replaced.
        values: to be tried of each number.
        dt: spacing of the instants [s].
    """
    chosen, most = dict[K, float](), 1
    for name in [*values] * min(len(values), 2):  # twice, as the steepest value may depend on numbers after it
        for value in values[name]:
            there = {**chosen, name: value}
            count = _needed(lambda there=there: design(there), dt) or 0
            if count >= most:
                chosen, most = there, count
    return most


def steepest_between(vehicle: AbstractVehicle, columns: Mapping[str, np.ndarray], dt: float) -> int:
    """The same of a vehicle between the ends of values of its parameters, names as in `parameters.replace`."""
    inside = {name: column[can_follow(vehicle, name, column, dt)] for name, column in columns.items()}
    ends = {name: (float(column.min()), float(column.max())) for name, column in inside.items() if column.size}
    return steepest(lambda point: replace(vehicle, point), ends, dt)


def can_follow(
    vehicle: AbstractVehicle, name: str, column: np.ndarray, dt: float, steps: float | int = np.inf
) -> np.ndarray:
    """For which values of one parameter a vehicle is stable with so many substeps, or as many as an engine takes.

    From the vehicle's own value on a parameter only gets steeper in each direction, or less steep.
    """

    def beyond(value: float) -> bool:
        count = _needed(lambda: replace(vehicle, {name: value}), dt)
        return count is None or LARGEST * count > steps

    first, follows = named_parameters(vehicle, [name])[0], np.ones(column.shape, bool)
    if first.value.ndim:
        return follows
    ordered = np.unique(column)
    middle = int(np.searchsorted(ordered, float(first.value)))
    for side in (ordered[middle:], ordered[:middle][::-1]):
        if side.size and beyond(side[-1]):
            follows &= ~np.isin(column, side[bisect_left(side, True, key=beyond) :])
    return follows


def _needed(design: Callable[[], AbstractVehicle], dt: float) -> int | None:
    """The substeps that a design needs; None for what no vehicle can be, or no step can follow."""
    try:
        return substeps_needed(design(), dt)
    except ValueError:
        return None
