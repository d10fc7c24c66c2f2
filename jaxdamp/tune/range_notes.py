"""By how much a tuning's start and its result leave the ranges that their laws were fitted to."""

import warnings

import numpy as np
import scipy.special

from jaxdamp.dampers import Motion, RangeUse, has_fitted_range, range_use
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import CoarseStepWarning, Ride, named_laws, range_sentences
from jaxdamp.vehicles import AbstractVehicle, linearise, stationary_rms


_DEVIATIONS = 3.0  # standard deviations of a stationary velocity that count as its reach
_POINTS = 2001


def range_notes(
    start: AbstractVehicle,
    tuned: AbstractVehicle,
    road: AbstractRoad | WhiteRoad,
    duration: float | None = None,
    dt: float = 1e-3,
) -> list[str]:
    """A sentence for each damper that leaves its range, at the start and after the tuning; none without ranges.

    Arguments:
        start: the vehicle before.
        tuned: the vehicle after.
        road: of the tuning; on a white one the velocity reaches three standard deviations of the linearised vehicle.
        duration: of the run [s], as in `minimise`.
        dt: step of the run [s].
    """
    if not has_fitted_range((start, tuned)):
        return []
    notes = []
    reach = f" (velocities of {_DEVIATIONS:g} standard deviations)" if isinstance(road, WhiteRoad) else ""
    for when, vehicle in (("At the start", start), ("After the tuning", tuned)):
        if isinstance(road, WhiteRoad):
            uses = _stationary_use(vehicle, road)
        else:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", CoarseStepWarning)  # the notes on the step say it
                ride = Ride(vehicle, road, metrics=[vehicle.ride_metrics[0].name], duration=duration, dt=dt)
            uses = ride.range_use()
        notes += [f"{when}{reach}, {sentence}" for sentence in range_sentences(uses)]
    return notes


def _stationary_use(vehicle: AbstractVehicle, road: WhiteRoad) -> dict[str, list[RangeUse]]:
    """The use of each law whose velocity is a channel of the linearised vehicle: normally distributed."""
    rms = stationary_rms(linearise(vehicle), road.velocity_psd, speed=road.speed)
    tail = float(scipy.special.ndtr(-_DEVIATIONS))
    normal = scipy.special.ndtri(np.linspace(tail, 1.0 - tail, _POINTS))
    laws = {name: law for name, law in named_laws(vehicle).items() if f"{name}_velocity" in rms}
    velocities = {name: float(rms[f"{name}_velocity"]) * normal for name in laws}
    return {name: range_use(law, Motion(velocity=velocities[name])) for name, law in laws.items()}
