"""Use of laws outside their fitted ranges, before and after a tuning."""

import warnings
from collections.abc import Callable

from jaxdamp.dampers import has_fitted_range
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation import DEVIATIONS, CoarseStepWarning, Ride, range_sentences
from jaxdamp.vehicles import AbstractVehicle


def range_notes(
    start: AbstractVehicle, tuned: AbstractVehicle, ride_of: Callable[[AbstractVehicle], Ride]
) -> list[str]:
    """A sentence for each damper used outside its fitted range, before and after the tuning.

    Arguments:
        start: the vehicle before.
        tuned: the vehicle after.
        ride_of: the ride of a vehicle; on a white road, velocities up to three standard deviations are compared.
    """
    if not has_fitted_range((start, tuned)):
        return []
    notes = []
    for when, vehicle in (("At the start", start), ("After the tuning", tuned)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CoarseStepWarning)  # reported by the notes on the step
            ride = ride_of(vehicle)
        reach = f" (velocities of {DEVIATIONS:g} standard deviations)" if isinstance(ride.road, WhiteRoad) else ""
        notes += [f"{when}{reach}, {sentence}" for sentence in range_sentences(ride.range_use())]
    return notes
