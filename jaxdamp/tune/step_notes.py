"""What the tuned vehicle says of the step, which was chosen for the start."""

import warnings
from collections.abc import Sequence

from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import CoarseStepWarning, Ride
from jaxdamp.vehicles import AbstractVehicle


def step_notes(
    start: AbstractVehicle,
    tuned: AbstractVehicle,
    road: AbstractRoad,
    names: Sequence[str],
    duration: float | None,
    dt: float,
) -> list[str]:
    """A sentence where the step is too long or too coarse for the tuned vehicle, or its laws need more substeps.

    Arguments:
        start: the vehicle before, for which the substeps were chosen.
        tuned: the vehicle after.
        road: of the tuning.
        names: of the metrics.
        duration: of the run [s], as in `minimise`.
        dt: step of the run [s].
    """

    def substeps(vehicle: AbstractVehicle) -> int:
        return Ride(vehicle, road, metrics=names, duration=duration, dt=dt).substeps

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        taken = substeps(start)
        warnings.simplefilter("always", CoarseStepWarning)
        try:
            needed = substeps(tuned)
        except ValueError as error:
            return [f"The tuned vehicle does not bear the step of {dt:g} s. {error}"]
    notes = [str(warning.message) for warning in caught]
    if needed > taken:
        notes.append(
            f"The tuned laws need {needed} steps between two instants, and the search took {taken}: tune again from "
            "this result."
        )
    return notes
