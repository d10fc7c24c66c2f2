"""Use of laws outside their fitted ranges, before and after a tuning."""

import warnings
from collections.abc import Callable

from jaxdamp.dampers import has_fitted_range
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation import DEVIATIONS, CoarseStepWarning, Ride, range_sentences
from jaxdamp.vehicles import AbstractVehicle


FAR = 0.01  # share of the time outside the fitted range from which a verdict cannot be trusted


def range_notes(
    start: AbstractVehicle, tuned: AbstractVehicle, ride_of: Callable[[AbstractVehicle], Ride]
) -> tuple[list[str], list[str]]:
    """A sentence for each damper used outside its fitted range, before and after the tuning; and those far outside.

    Arguments:
        start: the vehicle before.
        tuned: the vehicle after.
        ride_of: the ride of a vehicle; on a white road, velocities up to three standard deviations are compared.
    """
    if not has_fitted_range((start, tuned)):
        return [], []
    notes, uses = [], {}
    for when, vehicle in (("At the start", start), ("After the tuning", tuned)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CoarseStepWarning)  # reported by the notes on the step
            ride = ride_of(vehicle)
        reach = f" (velocities of {DEVIATIONS:g} standard deviations)" if isinstance(ride.road, WhiteRoad) else ""
        uses = ride.range_use()
        notes += [f"{when}{reach}, {sentence}" for sentence in range_sentences(uses)]
    beyond = {name: used for name, used in uses.items() if any((use.share or 0.0) >= FAR for use in used)}
    return notes, list(range_sentences(beyond))
