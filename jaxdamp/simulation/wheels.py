"""How a road reaches the wheels of a vehicle: one axle after the other, unless asked otherwise."""

from collections.abc import Callable
from typing import Literal, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._display import display
from jaxdamp._traced import depends
from jaxdamp._types import Scalar, Signal
from jaxdamp.roads import AbstractRoad, Columns, delayed
from jaxdamp.vehicles import AbstractVehicle


WRITE = "`roads.delayed(road, positions=vehicle.axle_positions, speed=...)`"


@final
class AxleTiming(eqx.Module):
    """When each axle of a vehicle meets the road; printed, a sentence.

    Attributes:
        kind: "delayed", "in phase", "by wheel" (each wheel has a motion of its own), or "one axle".
        names: Of the axles, first to last.
        delays: Of each axle behind the front of the vehicle [s], where they are delayed.
        speed: Of the vehicle [m/s], where it is known.
    """

    kind: Literal["delayed", "in phase", "by wheel", "one axle"] = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)
    delays: Float[Array, " axles"] | None = None
    speed: Scalar | None = None

    def __str__(self) -> str:
        if self.kind == "one axle":
            return "one axle"
        if self.kind == "in phase":
            return "all axles in phase, as asked"
        if self.kind == "by wheel":
            return "each wheel moved by its own column of the road"
        delays = None if self.delays is None else _checks.concrete(self.delays)
        if delays is None or delays.ndim != 1:
            return "axles one after the other"
        speed = None if self.speed is None else _checks.concrete(self.speed)
        if len(self.names) == 2 and delays[0] == 0:
            place = "" if speed is None else f" ({delays[1] * speed:.4g} m at {display().speed(float(speed))})"
            return f"{self.names[1]} axle {delays[1]:.3g} s behind the {self.names[0]}{place}"
        place = "" if speed is None else f" ({_listed(delays * speed)} m at {display().speed(float(speed))})"
        return f"axles {_listed(delays)} s behind the front of the vehicle{place}"


def _listed(values: np.ndarray) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def axle_timing(vehicle: AbstractVehicle, road: AbstractRoad) -> AxleTiming:
    """When each axle of the vehicle meets the road."""
    names = vehicle.layout.axle_names
    road = at_axles(vehicle, road)
    columns = road.columns
    if len(names) == 1:
        return AxleTiming("one axle", names)
    if columns.kind == "delayed":
        return AxleTiming("delayed", names, columns.delays, road.speed)
    return AxleTiming("in phase" if columns.kind == "in phase" else "by wheel", names)


def delays_by_itself(vehicle: AbstractVehicle, road: AbstractRoad) -> bool:
    """Whether the delay from axle to axle follows from the vehicle and the road's speed, without being asked for."""
    return road.columns.kind == "road" and max(vehicle.layout.axles) > 0


def at_axles(vehicle: AbstractVehicle, road: AbstractRoad) -> AbstractRoad:
    """The road with columns for every axle of the vehicle, delayed by its speed unless it says otherwise.

    Raises:
        ValueError: columns that do not fit the wheels, several axles on a road without a speed.
    """
    _refuse_misfit(vehicle, road.columns)
    if not delays_by_itself(vehicle, road):
        return road
    if road.speed is None:
        must = f"have one speed under a vehicle of {max(vehicle.layout.axles) + 1} axles, which delays the rear ones"
        remedy = f"Write {WRITE} to drive over it, or `roads.in_phase(road)` to move all axles together."
        _checks.refuse("road", must, "given over time, or made for several speeds", remedy)
    return delayed(road, positions=vehicle.axle_positions)


def heights_under_wheels(vehicle: AbstractVehicle, road: AbstractRoad, time: Signal) -> Float[Array, "time wheels"]:
    """The height [m] under each wheel at each `time` [s]; a single track goes under both sides of an axle."""
    road = at_axles(vehicle, road)
    columns, heights = road.columns, road.height(time)
    if columns.kind == "by wheel":
        return heights
    axles = np.array(vehicle.layout.axles)
    side = np.array([np.sum(axles[:i] == axle) for i, axle in enumerate(axles)])
    first = axles * columns.tracks if columns.kind == "delayed" else np.zeros_like(axles)
    chosen = first + (side if columns.tracks > 1 else 0)
    if np.array_equal(chosen, np.arange(heights.shape[1])):
        return heights
    return jnp.take(heights, chosen, axis=1, mode="clip")


def moves_axles(build: Callable[[PyTree], AbstractVehicle], values: PyTree) -> bool:
    """Whether the axle positions of the vehicle built from values depend on them; conservative within inner calls.

    Arguments:
        build: function of the values that gives the vehicle.
        values: what the vehicle is built from.
    """
    return depends(lambda values: build(values).axle_positions, values)


def _refuse_misfit(vehicle: AbstractVehicle, columns: Columns) -> None:
    """Refuse columns that are not one for each wheel, or one or each side for each axle, of the vehicle."""
    names, axles = vehicle.layout.wheels, vehicle.layout.axles
    called, count = f" ({', '.join(names)})" if any(names) else "", max(axles) + 1
    if columns.kind == "by wheel":
        if columns.tracks != len(names):
            remedy = f"Tracks side by side need a speed: give the profile one, write {WRITE} or `roads.in_phase(road)`."
            _checks.refuse("road", f"have a column for each of {len(names)} wheel(s){called}", columns, remedy)
        return
    if columns.delays is not None and columns.delays.size != count:
        must = f"have tracks for each of the vehicle's {count} axle(s){called}"
        _checks.refuse("road", must, columns, f"Leave out `delayed`, or write {WRITE}.")
    sides = [axles.count(axle) for axle in range(count)]
    if columns.tracks > 1 and any(side != columns.tracks for side in sides):
        must = f"have one track, or one for each wheel of an axle: the vehicle has {len(names)} wheel(s){called}"
        must += f" on {count} axle(s)"
        remedy = "Where a wheel stands for both sides, give a single track; left and right wheels have `FullCar`s."
        _checks.refuse("road", must, columns, remedy)
