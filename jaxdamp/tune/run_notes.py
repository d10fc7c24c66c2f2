"""Doubts about the runs of a tuning: a step too coarse for the tuned vehicle, laws outside their fitted ranges."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from jaxdamp.dampers import has_fitted_range
from jaxdamp.metrics import Metric
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation import DEVIATIONS, CoarseStepWarning, Ride, far_outside, over_runs, range_sentences
from jaxdamp.tune.scenarios import Road, Scenarios
from jaxdamp.vehicles import AbstractVehicle


def rides_on(
    road: Road | Scenarios, metrics: Sequence[Metric], run: Mapping[str, Any]
) -> list[Callable[[AbstractVehicle], Ride]]:
    """For each road a function that makes the checked ride of a vehicle on it, in no special condition."""
    roads = [s.road for s in road.scenarios] if isinstance(road, Scenarios) else [road]
    distinct = list({id(one): one for one in roads}.values())

    def on(one: Road) -> Callable[[AbstractVehicle], Ride]:
        return lambda vehicle: Ride(vehicle, one, metrics=metrics, **run)

    return [on(one) for one in distinct]


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


def range_notes(
    start: AbstractVehicle, tuned: AbstractVehicle, rides: Sequence[Callable[[AbstractVehicle], Ride]]
) -> tuple[list[str], list[str]]:
    """A sentence for each damper used outside its fitted range, before and after the tuning; and by how much, briefly.

    Arguments:
        start: the vehicle before.
        tuned: the vehicle after.
        rides: the ride of a vehicle on each road; on a white road, velocities up to three standard deviations are
            compared.
    """
    if not rides or not has_fitted_range((start, tuned)):
        return [], []
    notes, uses = [], {}
    for when, vehicle in (("At the start", start), ("After the tuning", tuned)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CoarseStepWarning)  # reported by the notes on the step
            ridden = [ride_of(vehicle) for ride_of in rides]
        white = isinstance(ridden[0].road, WhiteRoad)
        reach = f" (velocities of {DEVIATIONS:g} standard deviations)" if white else ""
        uses = over_runs([ride.range_use() for ride in ridden])
        notes += [f"{when}{reach}, {sentence}" for sentence in range_sentences(uses)]
    return notes, far_outside(uses)
