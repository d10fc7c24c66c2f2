"""The task of a search over designs of a vehicle: objectives, free parameters, limits and shapes; its doubts."""

import dataclasses
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Generic, NamedTuple, final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._pieces import piece
from jaxdamp._settings import part
from jaxdamp._types import Scalar
from jaxdamp.dampers import RangeUse, has_fitted_range
from jaxdamp.metrics import Metric, current_name
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import (
    DEVIATIONS,
    MOST,
    CoarseStepWarning,
    Exponential,
    Ride,
    far_outside,
    over_runs,
    range_sentences,
    stationary_notes,
)
from jaxdamp.solve import Evaluation, Region
from jaxdamp.tune.limits import Limit, LimitRange, limit_ends, limit_ranges, scaled, span_from
from jaxdamp.tune.measuring import BatchProgram, Computed, Measurement
from jaxdamp.tune.objective import Function, Targets, goal_limits, goal_objective, objective_of
from jaxdamp.tune.ranges import SearchRange, search_range, start_points
from jaxdamp.tune.result import V
from jaxdamp.tune.risk import worst
from jaxdamp.tune.scenario_ride import designs_under, in_condition
from jaxdamp.tune.scenarios import Condition, Road, Scenario, Scenarios
from jaxdamp.tune.settings import LEAST, RUN, Run, Settings
from jaxdamp.tune.shape import ShapeNumbers
from jaxdamp.vehicles import AbstractVehicle


USUAL_STEP = 1e-3  # s, of a run that names none
UNLIKE_START = "The tuned vehicle is not simulated like the start"


def step_notes(start: AbstractVehicle, tuned: AbstractVehicle, ride_of: Callable[[AbstractVehicle], Ride]) -> list[str]:
    """A sentence if the step is too long or too coarse for the tuned vehicle, or if its laws need more substeps."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        taken = ride_of(start).substeps
        warnings.simplefilter("always", CoarseStepWarning)
        try:
            needed = ride_of(tuned).substeps
        except ValueError as error:
            return [f"{UNLIKE_START}: {error}"]
    notes = [str(warning.message) for warning in caught]
    if needed > taken:
        notes.append(
            f"The tuned laws need {needed} steps between two instants, and the search took {taken}: tune again from "
            "this result."
        )
    return notes


def stepped_for_choices(run: Run, space: SearchRange, vehicle: AbstractVehicle, road: Road | Scenarios) -> Run:
    """The run with as many substeps as the steepest of the choices needs, in every scenario.

    A search takes the substeps that its start needs, and its steps are small; a choice may be far from there.
    """
    engine = Exponential() if run["engine"] is None else run["engine"]
    if not space.is_choice.any() or not isinstance(engine, Exponential) or engine.substeps is not None:
        return run

    def design(numbers: dict[int, Scalar | float]) -> AbstractVehicle:
        values = space.start.copy()
        values[list(numbers)] = list(numbers.values())
        return space.free.build(jnp.asarray(values, space.free.values.dtype))

    choices = {i: choice.values for i, choice in enumerate(space.choices) if choice is not None}
    dt = run["dt"] or engine.spacing or USUAL_STEP
    conditions = {id(s.condition): s.condition for s in road.scenarios} if isinstance(road, Scenarios) else {}
    designs = designs_under(list(conditions.values()), vehicle, design, dt)
    count = min(designs.steepest(choices), MOST)
    more = count > designs.needed({})
    return {**run, "engine": dataclasses.replace(engine, substeps=count)} if more else run


def outside_ranges(
    vehicle: AbstractVehicle, rides: Sequence[Callable[[AbstractVehicle], Ride]]
) -> tuple[list[str], dict[str, list[RangeUse]]]:
    """The end of a sentence for each damper used outside its fitted range, and what is used of each range.

    On a white road, velocities up to three standard deviations are compared.
    """
    if not rides or not has_fitted_range(vehicle):
        return [], {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CoarseStepWarning)  # reported by the notes on the step
        ridden = [ride_of(vehicle) for ride_of in rides]
    white = isinstance(ridden[0].road, WhiteRoad)
    reach = f" (velocities of {DEVIATIONS:g} standard deviations)" if white else ""
    uses = over_runs([ride.range_use() for ride in ridden])
    return [f"{reach}, {sentence}" for sentence in range_sentences(uses)], uses


class Tolerance(NamedTuple):
    """Tolerances: the scaled gradient at an optimum, the relative distance to a limit, rounding of an objective."""

    slope: float
    limit: float
    rounding: float


ELSEWHERE = 2  # designs that are tried before an objective with no slope at the start is called constant
NEAR_ZERO = 0.05  # of the change by all coordinates, of size one at the start: the least size of an objective
DOUBLE, SINGLE = Tolerance(1e-4, 1e-6, 1e-13), Tolerance(1e-2, 1e-4, 1e-6)


@final
class DesignTask(Generic[V]):
    """The numbers that a search computes of a vehicle, and the ranges in which they must stay.

    Attributes:
        objective: all objectives, with their metrics.
        space: the free parameters and their ranges.
        measured: the metrics of a vehicle.
        followed: names of the numbers whose largest one is minimised, or of those of a front: the objective in every
            scenario for the worst case, else the objectives.
        names: of all numbers that the search computes.
        allowed: the range of each limited metric, as it is written.
        units: of the metrics.
        run: duration, step and engine.
        argument: that gave the objectives.
        tolerance: that the precision of the vehicle permits.
    """

    def __init__(
        self,
        objectives: Sequence[str | Metric | Function],
        vehicle: V,
        road: Road | Scenarios,
        *,
        argument: str,
        settings: Settings,
    ) -> None:
        self.vehicle, self.road, self.argument = vehicle, road, argument
        self.run = part(settings, RUN)
        metrics, white = settings["metrics"], is_white(road)
        further = [m.name for m in metrics if isinstance(m, Metric)]
        metric_names = [*(m.name for m in vehicle.ride_metrics), *further]
        spelled = {"white": white, "metrics": further}
        objectives = [goal_objective(one, vehicle, argument=argument, **spelled) for one in objectives]
        limits = goal_limits(settings["limits"], vehicle, **spelled)
        self.allowed = limit_ranges(limits, metric_names)
        limited = [metric for metric in limits or {} if isinstance(metric, Metric)]
        of_targets = _metrics_of_targets(objectives, metric_names, limited)
        more = [*metrics, *limited, *of_targets]
        self.objective = objective_of(objectives, vehicle, more, list(self.allowed), white=white, argument=argument)
        _refuse_negative(self.allowed, self.objective.metrics)
        self.space = search_range(vehicle, settings["over"], settings["freeze"], settings["bounds"], settings["tie"])
        self.tolerance = DOUBLE if self.space.free.values.dtype == np.float64 else SINGLE
        if not white:
            self.run = stepped_for_choices(self.run, self.space, vehicle, road)
        worst_case = len(objectives) == 1 and isinstance(road, Scenarios) and road.risk is worst
        of_each = dict.fromkeys([*self.allowed, *self.objective.names * worst_case])
        self.measured = Measurement(
            vehicle, road, self.objective, self.space.free,
            each=list(of_each), curves=ShapeNumbers.of(vehicle, settings["shape"], self.space.free), run=self.run,
        )  # fmt: skip
        self.followed = self.measured.entries(self.objective.name) if worst_case else self.objective.names
        self.names, self.units = self.measured.names, self.objective.units(vehicle)

    def numbers(self, values: np.ndarray) -> dict[str, float]:
        """Numbers of one design by name."""
        return dict(zip(self.names, map(float, values), strict=True))

    def metric(self, evaluation: Evaluation) -> float:
        """The first objective, where it was computed."""
        return float(evaluation.values[self.names.index(self.objective.name)])

    def limits(self, before: Mapping[str, float]) -> list[Limit]:
        """All limits, in every scenario, their distances scaled by the numbers of the start."""
        exact = {m.name for m in self.objective.beside}
        wrong = {name: x for name, x in before.items() if name not in exact and not np.isfinite(x)}
        if wrong:
            name, value = next(iter(wrong.items()))
            call = "Ride(vehicle, road)()" if is_white(self.road) else "simulate(vehicle, road)"
            remedy = f"Call `{call}`; its error message explains the cause."
            _checks.refuse("vehicle", "have finite metrics to start from", f"{name} = {value}", remedy)
        of_metrics = []
        for name, allowed in self.allowed.items():
            for entry in self.measured.entries(name):
                span = span_from(entry, allowed, before[entry])
                of_metrics.append(Limit(entry, name, *span, scaled(*span, before[entry]), self.units[name]))
        return of_metrics + self.measured.curves.limits(before)

    def shown_limits(self, before: Mapping[str, float]) -> dict[str, float | tuple[float, float]]:
        """The limits of metrics as they are shown: the largest value, or the smallest and the largest one."""
        spans = {name: allowed.at(before[name]) for name, allowed in self.allowed.items()}
        return {name: span[1] if np.isinf(span[0]) else span for name, span in spans.items()}

    def notes_on_runs(self, design: AbstractVehicle) -> tuple[list[str], list[str]]:
        """Notes on the step and on the fitted ranges for a design, in every scenario; and the dampers far outside."""
        on, white, metrics = self.road, is_white(self.road), self.objective.metrics
        scenarios = on.scenarios if isinstance(on, Scenarios) else [Scenario("", on, Condition(), 1.0)]
        rides = [
            lambda vehicle, s=s: Ride(in_condition(vehicle, s.condition), s.road, metrics=metrics, **self.run)
            for s in scenarios
        ]
        road = rides[0](design).road if white else None
        notes = stationary_notes(design, road) if isinstance(road, WhiteRoad) else []
        coarse = [[] if white else step_notes(self.vehicle, design, ride_of) for ride_of in rides]
        notes += dict.fromkeys(note for of_ride in coarse for note in of_ride)
        sound = [
            on for on, bad in zip(rides, coarse, strict=True) if not any(note.startswith(UNLIKE_START) for note in bad)
        ]
        uses = {}
        for when, vehicle in (("At the start", self.vehicle), ("After the tuning", design)):
            sentences, uses = outside_ranges(vehicle, sound)
            notes += [f"{when}{sentence}" for sentence in sentences]
        return notes, far_outside(uses)


@final
class Evaluator(Generic[V]):
    """The rows that a search follows, at points given by their coordinates: objectives, then ends of limits."""

    def __init__(self, task: DesignTask[V], lanes: int) -> None:
        self.task, self.program = task, BatchProgram(task.measured, task.space.free, lanes)
        self._inputs = ("metrics and slopes", task.vehicle, task.road, task.run, task.objective.name, task.names, lanes)
        self._signed = [(name, 1.0) for name in task.followed]

    def at(self, points: Float[np.ndarray, "points free"]) -> list[Evaluation]:
        """Numbers, rows and derivatives of the rows by the coordinates."""
        return self.rows_of(self.computed(points))

    def computed(self, points: Float[np.ndarray, "points free"]) -> Computed:
        """Numbers, and derivatives by the coordinates."""
        space = self.task.space
        at = np.clip(points * space.unit, space.lower, space.upper)
        values, slopes = piece((*self._inputs, space.free.names, at), lambda: self.program.at(at))
        return Computed(values, slopes * space.unit)

    def rows_of(self, computed: Computed) -> list[Evaluation]:
        """The rows among what was computed."""
        signs = np.array([sign for _, sign in self._signed])
        of_values = [self.task.names.index(name) for name, _ in self._signed]
        of_slopes = [self.program.differentiated.index(name) for name, _ in self._signed]
        rows, slopes = signs * computed.values[:, of_values], signs[:, None] * computed.slopes[:, of_slopes]
        return [Evaluation(*one) for one in zip(computed.values, rows, slopes, strict=True)]

    def only_rows(self, points: Float[np.ndarray, "points free"]) -> Float[np.ndarray, "points rows"]:
        """The rows, without derivatives."""
        values = self.program.values(points * self.task.space.unit)
        return np.stack([sign * values[:, self.task.names.index(name)] for name, sign in self._signed], axis=1)

    def begin(self, points: Float[np.ndarray, "points free"]) -> tuple[list[Evaluation], list[Limit]]:
        """Evaluations of the starts, the first of which is the vehicle's, and the limits, which are followed from here.

        Starts without finite numbers are left out, but for the first.
        """
        computed = self.computed(points)
        limits = self.task.limits(self.task.numbers(computed.values[0]))
        self._signed += [(end.name, end.sign) for end in limit_ends(limits)]
        return self.rows_of(computed), limits

    def refuse_constant(self, start: Evaluation, others: Sequence[Evaluation] = ()) -> None:
        """Refuse objectives that do not depend on what is free: by their slopes, and by their values elsewhere."""
        task = self.task
        count, rounding = len(task.followed), 100.0 * task.tolerance.rounding
        if start.slopes[:count].any():
            return
        others = others or self.at(start_points(task.space, 1 + ELSEWHERE, 0)[1:] / task.space.unit)
        if all(np.allclose(one.rows[:count], start.rows[:count], rounding, 0.0) for one in others):
            before = task.numbers(start.values)
            values = ", ".join(f"{name} = {before[name]:.4g}" for name in task.objective.names)
            remedy = "Free a parameter that it depends on, or take a road on which it does."
            _checks.refuse(task.argument, "depend on what is free", f"{values} whatever they are", remedy)

    def sizes(self, start: Evaluation) -> Float[np.ndarray, " objectives"]:
        """By what each row of objectives is divided: its value at the start, or a part of what a step changes, if more.

        Targets count as met at one, which is the least that they are divided by.
        """
        objective, count = self.task.objective, len(self.task.followed)
        functions = dict(objective.functions)
        least = [1.0 if isinstance(functions.get(name), Targets) else 0.0 for name in objective.names]
        reach = NEAR_ZERO * np.abs(start.slopes[:count]).sum(axis=1)
        sizes = np.maximum(np.maximum(np.abs(start.rows[:count]), reach), np.resize(least, count))
        return np.where(sizes > 0.0, sizes, 1.0)

    @property
    def region(self) -> Region:
        """Where the coordinates may be."""
        space = self.task.space
        return Region(space.lower / space.unit, space.upper / space.unit, *space.coordinates.order())


def _metrics_of_targets(
    objectives: Sequence[str | Metric | Function], metric_names: Sequence[str], limited: Sequence[Metric]
) -> list[Metric]:
    """The metrics that targets are given for, after a check of their names."""
    targets = [one for one in objectives if isinstance(one, Targets)]
    of_targets = [metric for one in targets for metric in one.metrics]
    for name in (name for one in targets for name in one.values):
        with_targets = [*metric_names, *(metric.name for metric in (*limited, *of_targets))]
        _checks.one_of("targets", current_name(name, metric_names), with_targets)
    return of_targets


def _refuse_negative(allowed: Mapping[str, LimitRange], metrics: Sequence[Metric]) -> None:
    """Refuse a largest value below zero of a metric that is never negative."""
    for metric in metrics:
        upper = allowed[metric.name].upper if metric.name in allowed else 0.0
        if upper < 0.0 and not metric.statistic.signed and not allowed[metric.name].relative[1]:
            _checks.refuse(f"limits[{metric.name!r}]", "not be negative, as the metric never is", upper)


def is_white(road: object) -> bool:
    """Whether nothing is driven over."""
    return road.white if isinstance(road, Scenarios) else isinstance(road, WhiteRoad)


def check_call(call: str, vehicle: object, road: object, counts: Mapping[str, object]) -> None:
    """Refuse what is no vehicle or no road, and counts below their least value."""
    check_module("vehicle", vehicle, (AbstractVehicle,), call)
    _checks.untraced("vehicle", vehicle, "Call it outside `jax.jit` and `jax.grad`; a `Ride` can be traced.")
    if not isinstance(road, Scenarios):
        check_module("road", road, (AbstractRoad, WhiteRoad), call)
    for name, least in LEAST.items():
        if name not in counts:
            continue
        count = counts[name]
        if isinstance(count, bool) or not isinstance(count, int | np.integer):
            _checks.refuse(name, "be a whole number", repr(count), f"Write `{name}={max(least, 1)}`, or more.")
        if count < least:
            _checks.refuse(name, f"be {least} or more", count)
