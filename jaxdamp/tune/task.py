"""The task of a search over designs of a vehicle: objectives, free parameters, limits and shapes."""

from collections.abc import Mapping, Sequence
from typing import Any, Generic, final

import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._types import Scalar
from jaxdamp.metrics import Metric, current_name
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import Ride, stationary_notes
from jaxdamp.tune.limits import Limit, LimitRange, limit_ranges, scaled
from jaxdamp.tune.measuring import Measurement
from jaxdamp.tune.objective import Function, goal_limits, goal_objective, objective_of
from jaxdamp.tune.range_notes import range_notes
from jaxdamp.tune.ranges import search_range
from jaxdamp.tune.result import V
from jaxdamp.tune.scenario_ride import ScenarioRide
from jaxdamp.tune.scenarios import Road, Scenarios
from jaxdamp.tune.searching import tolerance_of
from jaxdamp.tune.shape import Shape, ShapeNumbers
from jaxdamp.tune.step_notes import step_notes
from jaxdamp.tune.targets import Targets
from jaxdamp.vehicles import AbstractVehicle


@final
class DesignTask(Generic[V]):
    """The numbers that a search computes of a vehicle, and the ranges in which they must stay.

    Arguments:
        objectives: one or more, as the `metric` of `minimise`.
        vehicle: to start from.
        road: as in `minimise`.
        argument: name of the objectives in messages.
        over: as in `minimise`; the further arguments too.

    Attributes:
        objective: all objectives, with their metrics.
        space: the free parameters and their ranges.
        measured: the metrics of a vehicle.
        names: of all numbers that the search computes.
        allowed: the range of each limited metric, as it is written.
        units: of the metrics.
        run: duration [s] and step [s].
        tolerance: that the precision of the vehicle permits.
    """

    def __init__(
        self,
        objectives: Sequence[str | Metric | Function],
        vehicle: V,
        road: Road | Scenarios,
        *,
        argument: str,
        over: Sequence[str] | Mapping[str, Any] | None,
        freeze: Sequence[str],
        bounds: Mapping[str, Any] | None,
        tie: Mapping[str, str] | None,
        limits: Mapping[Any, Any] | None,
        shape: Sequence[Shape] | Shape,
        metrics: Sequence[str | Metric],
        duration: float | None,
        dt: float,
    ) -> None:
        self.vehicle, self.road, self.run, self._argument = vehicle, road, (duration, dt), argument
        white, further = is_white(road), [m.name for m in metrics if isinstance(m, Metric)]
        known = [*(m.name for m in vehicle.ride_metrics), *further]
        objectives = [
            one if one in further else goal_objective(one, vehicle, white=white, argument=argument)
            for one in objectives
        ]
        limits = goal_limits(limits, vehicle, white=white, known=further)
        self.allowed = limit_ranges(limits, known)
        limited = [metric for metric in limits or {} if isinstance(metric, Metric)]
        targets = [one for one in objectives if isinstance(one, Targets)]
        of_targets = [metric for one in targets for metric in one.metrics]
        for name in (name for one in targets for name in one.values):
            with_targets = [*known, *(metric.name for metric in (*limited, *of_targets))]
            _checks.one_of("targets", current_name(name, known), with_targets)
        more = [*metrics, *limited, *of_targets]
        self.objective = objective_of(objectives, vehicle, more, list(self.allowed), white=white, argument=argument)
        _refuse_negative(self.allowed, self.objective.metrics)
        self.space = search_range(vehicle, over, freeze, bounds, tie)
        self.tolerance = tolerance_of(self.space.free)
        shapes = [shape] if isinstance(shape, Shape) else shape
        if not isinstance(shapes, Sequence) or isinstance(shapes, str):
            remedy = "Write `shape=[tune.monotone(), tune.slope(upper=5000.0)]`."
            _checks.refuse("shape", "be a constraint of `tune`, or a list", _checks.described(shapes), remedy)
        self._curves = ShapeNumbers(vehicle, shapes)
        self.measured = Measurement(
            vehicle, road, self.objective, self.space.free, each=list(self.allowed), duration=duration, dt=dt
        )
        self.names = [*self.measured.names, *self._curves.names]
        self.units = self.objective.units(vehicle)

    def numbers(self, ride: Ride | ScenarioRide, vehicle: AbstractVehicle) -> dict[str, Scalar]:
        """The metrics by a ride of `measured`, and the numbers of curves, of a vehicle."""
        return {**self.measured.by(ride, vehicle), **self._curves(vehicle)}

    @property
    def limited_names(self) -> list[str]:
        """The names of the numbers that have limits."""
        return [*(entry for name in self.allowed for entry in self.measured.entries(name)), *self._curves.names]

    def limits(self, before: Mapping[str, float]) -> list[Limit]:
        """All limits, in every scenario, their distances scaled by the numbers of the start.

        Raises:
            ValueError: a start without finite metrics; only a true peak or settling time beside a smooth one may be so.
        """
        exact = {m.name for m in self.objective.beside}
        wrong = {name: x for name, x in before.items() if name not in exact and not np.isfinite(x)}
        if wrong:
            name, value = next(iter(wrong.items()))
            remedy = "Call `simulate` with this road; its error messages explain the cause."
            _checks.refuse("vehicle", "have finite metrics to start from", f"{name} = {value}", remedy)
        of_metrics = []
        for name, allowed in self.allowed.items():
            for entry in self.measured.entries(name):
                span = allowed.at(before[entry])
                of_metrics.append(Limit(entry, name, *span, scaled(*span, before[entry]), self.units[name]))
        return of_metrics + self._curves.limits(before)

    def shown_limits(self, before: Mapping[str, float]) -> dict[str, float | tuple[float, float]]:
        """The limits of metrics as they are shown: the largest value, or the smallest and the largest one."""
        spans = {name: allowed.at(before[name]) for name, allowed in self.allowed.items()}
        return {name: span[1] if np.isinf(span[0]) else span for name, span in spans.items()}

    def refuse_constant(self, before: Mapping[str, float], slopes: Mapping[str, np.ndarray]) -> None:
        """Refuse objectives that do not depend on what is free."""
        if not any(np.any(slopes[name]) for name in self.objective.names):
            values = ", ".join(f"{name} = {before[name]:.4g}" for name in self.objective.names)
            remedy = "Free a parameter that it depends on, or take a road on which it does."
            _checks.refuse(self._argument, "depend on what is free", f"{values} whatever they are", remedy)

    def notes_on_runs(self, design: AbstractVehicle) -> tuple[list[str], list[str]]:
        """Notes on the step and on the fitted ranges for a design, on every road; and the dampers far outside."""
        rides, far = list(self.measured.rides_of()), []
        road = rides[0](design).road if self.measured.white else None
        notes = stationary_notes(design, road) if isinstance(road, WhiteRoad) else []
        for ride_of in rides:
            coarse = [] if self.measured.white else step_notes(self.vehicle, design, ride_of)
            notes += coarse
            if not any("does not bear" in note for note in coarse):
                ranges, outside = range_notes(self.vehicle, design, ride_of)
                notes, far = notes + ranges, far + outside
        return notes, list(dict.fromkeys(far))


def _refuse_negative(allowed: Mapping[str, LimitRange], metrics: Sequence[Metric]) -> None:
    """Refuse a largest value below zero of a metric that is never negative."""
    for metric in metrics:
        upper = allowed[metric.name].upper if metric.name in allowed else 0.0
        if upper < 0.0 and not metric.statistic.signed and not allowed[metric.name].relative[1]:
            _checks.refuse(f"limits[{metric.name!r}]", "not be negative, as the metric never is", upper)


def is_white(road: Road | Scenarios) -> bool:
    """Whether nothing is driven over."""
    return road.white if isinstance(road, Scenarios) else isinstance(road, WhiteRoad)


def check_call(call: str, vehicle: Any, road: Any, counts: Mapping[str, tuple[int, int]]) -> None:
    """Refuse what is no vehicle or no road, and counts below their least value.

    Arguments:
        call: as it should be written, for messages.
        vehicle: the argument of this name.
        road: the argument of this name.
        counts: value and least value by argument.
    """
    check_module("vehicle", vehicle, (AbstractVehicle,), call)
    _checks.untraced("vehicle", vehicle, "Call it outside `jax.jit` and `jax.grad`; a `Ride` can be traced.")
    if not isinstance(road, Scenarios):
        check_module("road", road, (AbstractRoad, WhiteRoad), call)
    for name, (count, least) in counts.items():
        if isinstance(count, bool) or not isinstance(count, int | np.integer):
            _checks.refuse(name, "be a whole number", repr(count), f"Write `{name}={max(least, 1)}`, or more.")
        if count < least:
            _checks.refuse(name, f"be {least} or more", count)
