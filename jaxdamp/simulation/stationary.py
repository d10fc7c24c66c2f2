"""The ride on a white road: metrics and reach of the vehicle in its stationary motion, with equivalent linear laws."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Scalar
from jaxdamp.dampers import Motion, RangeUse, range_use
from jaxdamp.metrics import Metric
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation.notes import named_laws
from jaxdamp.vehicles import (
    AbstractVehicle,
    EquivalentDamper,
    equivalent_dampers,
    linearise,
    nonlinear_variables,
    stationary_rms,
    with_weightings,
)


TRUSTED = (
    "RMS values are within 5 % of simulations, with hysteresis within 12 %, save friction that mostly sticks (stroke "
    "up to 17 % low). Laws of the velocity act by this slope alone: designs of equal slope count as equal."
)
DEVIATIONS = 3.0  # standard deviations of a stationary velocity that count as its reach
_POINTS = 2001


def stationary_metrics(vehicle: AbstractVehicle, road: WhiteRoad, metrics: Sequence[Metric]) -> dict[str, Scalar]:
    """Metrics that follow from the RMS of their channels, with linear laws equivalent to the vehicle's."""
    linear = linearise(vehicle, velocity_psd=road.velocity_psd, speed=road.speed)
    wanted: dict[str, list[str]] = {}
    for m in metrics:
        if m.weighting is not None:
            wanted.setdefault(m.weighting, []).append(m.channel)
    rms: dict[str | None, dict[str, Scalar]] = {None: stationary_rms(linear, road.velocity_psd, speed=road.speed)}
    lost = jnp.all(jnp.isinf(linear.feed_through))
    for weighting, channels in wanted.items():
        weighted = with_weightings(linear, [(name, weighting) for name in dict.fromkeys(channels)])
        levels = stationary_rms(weighted, road.velocity_psd, speed=road.speed)
        rms[weighting] = {name: jnp.where(lost, jnp.inf, value) for name, value in levels.items()}
    values = {}
    for m in metrics:
        assert m.statistic.of_rms is not None
        channel = m.channel if m.weighting is None else f"weighted_{m.channel}"
        values[m.name] = m.statistic.of_rms(rms[m.weighting][channel])
    return values


def refuse_without_stationary_motion(vehicle: AbstractVehicle, road: WhiteRoad) -> None:
    """Refuse a vehicle of which none was found, or that does not come to rest: all its metrics are infinite.

    Arguments:
        vehicle: with its laws.
        road: a white one.
    """
    stationary_rms(vehicle, road.velocity_psd, speed=road.speed)


def stationary_dampers(vehicle: AbstractVehicle, road: WhiteRoad) -> dict[str, EquivalentDamper]:
    """Slope and velocity of the linear damper equivalent to each, by name."""
    return equivalent_dampers(vehicle, road.velocity_psd, speed=road.speed)


def stationary_notes(vehicle: AbstractVehicle, road: WhiteRoad) -> list[str]:
    """A sentence on the dampers that are replaced by linear ones, and on how far the results can be trusted.

    Arguments:
        vehicle: with its laws; empty if all of them are linear.
        road: a white one.
    """
    if not any(nonlinear_variables(law) for law in vehicle.elements()):
        return []
    dampers = stationary_dampers(vehicle, road)
    words = [f"{name.replace('_', ' ')} {one.words()}" for name, one in dampers.items() if not one.linear]
    return [f"On a white road: {'; '.join(words)}. {TRUSTED}"] if words else []


def stationary_range_use(vehicle: AbstractVehicle, road: WhiteRoad) -> dict[str, list[RangeUse]]:
    """The use of each law whose velocity is a channel of the vehicle: normally distributed, to ±3 σ."""
    import scipy.special

    rms = stationary_rms(vehicle, road.velocity_psd, speed=road.speed)
    tail = float(scipy.special.ndtr(-DEVIATIONS))
    normal = scipy.special.ndtri(np.linspace(tail, 1.0 - tail, _POINTS))
    laws = {name: law for name, law in named_laws(vehicle).items() if f"{name}_velocity" in rms}
    velocities = {name: float(rms[f"{name}_velocity"]) * normal for name in laws}
    return {name: range_use(law, Motion(velocity=velocities[name])) for name, law in laws.items()}
