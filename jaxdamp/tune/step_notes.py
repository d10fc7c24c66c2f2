"""Checks of the step for the tuned vehicle, since it was chosen for the start."""

import warnings
from collections.abc import Callable

from jaxdamp.simulation import CoarseStepWarning, Ride
from jaxdamp.vehicles import AbstractVehicle


def step_notes(start: AbstractVehicle, tuned: AbstractVehicle, ride_of: Callable[[AbstractVehicle], Ride]) -> list[str]:
    """A sentence if the step is too long or too coarse for the tuned vehicle, or if its laws need more substeps.

    Arguments:
        start: the vehicle before, for which the substeps were chosen.
        tuned: the vehicle after.
        ride_of: the ride of a vehicle, on a road that is driven over.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        taken = ride_of(start).substeps
        warnings.simplefilter("always", CoarseStepWarning)
        try:
            needed = ride_of(tuned).substeps
        except ValueError as error:
            return [f"The tuned vehicle does not bear the step. {error}"]
    notes = [str(warning.message) for warning in caught]
    if needed > taken:
        notes.append(
            f"The tuned laws need {needed} steps between two instants, and the search took {taken}: tune again from "
            "this result."
        )
    return notes
