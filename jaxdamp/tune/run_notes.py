"""Doubts about the runs of a tuning: a step too coarse for the tuned vehicle, laws outside their fitted ranges."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from jaxdamp.dampers import has_fitted_range
from jaxdamp.metrics import Metric
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation import DEVIATIONS, CoarseStepWarning, Ride, range_sentences
from jaxdamp.tune.scenarios import Road, Scenarios
from jaxdamp.vehicles import AbstractVehicle


FAR = 0.01  # share of the time outside the fitted range from which a verdict cannot be trusted


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
    """A sentence if the step is too long or too coarse for the tuned vehicle, or if its laws need more substeps."""
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
    start: AbstractVehicle, tuned: AbstractVehicle, ride_of: Callable[[AbstractVehicle], Ride]
) -> tuple[list[str], list[str]]:
    """A sentence for each damper used outside its fitted range, before and after the tuning; and those far outside."""
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
