"""The settings of tunings: what may change and within which limits, how it is driven, how it is searched."""

from collections.abc import Mapping, Sequence
from typing import TypedDict

from jaxdamp.metrics import Metric
from jaxdamp.simulation import RUN, Run
from jaxdamp.tune.limits import Limits
from jaxdamp.tune.ranges import Bound
from jaxdamp.tune.shape import Shape


class Free(TypedDict, total=False):
    """Which parameters take part: keywords of everything in `tune` that moves parameters."""

    over: Sequence[str] | Mapping[str, Bound] | None
    freeze: Sequence[str]


class Design(Free, total=False):
    """What a tuning may change, and within which limits: keywords of `minimise`, `pareto` and `robust`.

    They are written in the call, or kept for several calls: `Design(...)` is a dictionary of checked types.

    Arguments:
        over: the parameters to change, by path, last part or pattern; all of the dampers that a workshop can change
            (`Parameter.adjustable`) and that the records of their fit determine (`law.standard_errors`) if left out. A
            mapping `{parameter: (lower, upper)}` gives their bounds too, as
            `bounds` does; `{parameter: Choice(values)}` the values that can be built.
        freeze: parameters among these to hold at their start.
        bounds: bounds `{parameter: (lower, upper)}` in the unit of the parameter, instead of the default ones; the
            start must be between them. None removes one bound or both: with `bounds={"*": None}` only the domains
            remain. If two names match a parameter, the later one counts.
        tie: parameters that take the values of others, such as `{"front.damper.**": "rear.damper.**"}`: one free value
            for each group (see `jaxdamp.parameters.free_parameters`).
        limits: hard limits `{metric: largest value}` or `{metric: (smallest, largest)}` in the metric's unit, such as
            `{"working_space_peak_to_peak": 0.1}`, with a name or a `metrics.Metric`; in every scenario. `"+10%"` is
            relative to the start on the same road.
        shape: constraints on the force-velocity curve: `slope`, `monotone`, `ratio`, `knee`. If left out, the force of
            tables, splines and polynomials does not fall as the velocity grows, or not more steeply than at the start:
            their numbers could make a damper that drives the motion. `()` for none.
        metrics: further metrics, which functions and limits can use by name.

    >>> from jaxdamp import roads, tune, vehicles
    >>> design = tune.Design(over={"damper.rate": (1500.0, 4000.0)})
    >>> result = tune.minimise("comfort", vehicles.presets.quarter_car_000(), roads.white("C", 20.0), **design)
    >>> result.converged, 1500.0 < float(result.vehicle.damper.rate) < 4000.0
    (True, True)
    """

    bounds: Mapping[str, Bound] | None
    tie: Mapping[str, str] | None
    limits: Limits | None
    shape: Sequence[Shape] | Shape | None
    metrics: Sequence[str | Metric]


class Search(TypedDict, total=False):
    """How a tuning searches, and how its result is judged.

    Arguments:
        starts: number of searches, side by side; the first from the vehicle, the others from inside the bounds.
        seed: of the other starts.
        max_steps: largest number of steps of each search.
        fresh_roads: largest number of other realisations of a random road, or of those of the scenarios, on which the
            result is judged; 0 for none.
    """

    starts: int
    seed: int
    max_steps: int
    fresh_roads: int


class Settings(Design, Run, Search, total=False):
    """All keywords that `minimise`, `pareto` and `robust` have in common: those of `Design`, `Run` and `Search`."""


DEFAULTS: Settings = {
    "over": None, "freeze": (), "bounds": None, "tie": None, "limits": None, "shape": None, "metrics": (), **RUN,
    "starts": 1, "seed": 0, "max_steps": 100, "fresh_roads": 32,
}  # fmt: skip
LEAST = {"points": 1, "between": 0, "starts": 1, "seed": 0, "max_steps": 1, "fresh_roads": 0}  # of the counts
