"""`minimise`: tune the free parameters of a vehicle for a ride metric, by exact gradients."""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Unpack

import jax.numpy as jnp
import numpy as np

from jaxdamp._pieces import piece
from jaxdamp._progress import Progress
from jaxdamp._settings import with_defaults
from jaxdamp._status import Status
from jaxdamp._traced import of_known_numbers
from jaxdamp.metrics import Metric, MetricValues
from jaxdamp.solve import Evaluation
from jaxdamp.tune.combinations import Combinations, beside_next
from jaxdamp.tune.descending import Descent, Driven, Ended, every_combination, finer, missed, rank, reached
from jaxdamp.tune.limits import Limit, LimitRange, decided, in_each, lost_limits
from jaxdamp.tune.measuring import ride_on
from jaxdamp.tune.objective import Function, check_objective
from jaxdamp.tune.ranges import start_points
from jaxdamp.tune.relaxation import relaxation
from jaxdamp.tune.rescoring import Rescore, other_roads, rescored
from jaxdamp.tune.result import Attempt, Drive, ScenarioValues, TuneResult, V
from jaxdamp.tune.scenario_ride import ScenarioRide
from jaxdamp.tune.scenarios import Road, Scenarios
from jaxdamp.tune.settings import DEFAULTS, Settings
from jaxdamp.tune.task import DesignTask, Evaluator, check_call, is_white
from jaxdamp.tune.verdict import (
    Outcome,
    active_words,
    bound_notes,
    early_end,
    effect_notes,
    missed_notes,
    start_notes,
    tightened_notes,
    true_value_notes,
    violations,
    without_effect,
    workshop_notes,
)
from jaxdamp.vehicles import AbstractVehicle


FEWEST = 4  # fresh roads before their interval is looked at; then twice as many, and so on
TIGHTENED = 2  # times that a search is repeated with limits that did not hold on fresh roads


@of_known_numbers
@with_defaults(DEFAULTS)
def minimise(
    metric: str | Metric | Function,
    vehicle: V,
    road: Road | Scenarios,
    *,
    progress: Callable[[int, float], None] | None = None,
    **settings: Unpack[Settings],
) -> TuneResult[V]:
    """Minimise a ride metric of a vehicle over its free parameters.

    Sequential quadratic programming with exact first derivatives, computed in forward mode through the simulation for
    all parameters at once. It finds a local optimum, so start from a reasonable vehicle, or from several `starts`. The
    search itself is in double precision; a vehicle in single precision (see `jaxdamp.configure`) is tuned to about
    0.1 % of its parameters.

    Every parameter has bounds, so that the result stays near a damper that can be built. The default bounds are:

    - numbers of one sign (rates, stiffnesses, forces, velocities, exponents, knots): one third to three times the
      start; forces of tables and splines count from that at zero velocity, and a point there is held;
    - numbers of either sign (coefficients, offsets): −1 to 3 times the start;
    - zeros and weights of networks: their domain.

    Domains are always respected. A parameter that ends at a bound is named in the `warnings`: the optimum may be
    beyond.

    Where all that is free is a `Choice`, every combination is driven instead (up to 2000).

    Arguments:
        metric: the name of a ride metric of the vehicle, such as `"rms_sprung_acceleration"`, or "comfort", "travel" or
            "grip" (`vehicle.goal_metrics`; of several metrics their mean); a `metrics.Metric` of any channel; or a
            differentiable function of the metrics by name, such as
            `lambda m: m["rms_sprung_acceleration"] / 1.5 + m["dynamic_load_coefficient"] / 0.2`, or `Targets(...)`.
        vehicle: the vehicle to start from.
        road: a road for the simulation, the same in every step; `roads.white(...)` for the stationary response with
            equivalent linear laws, which has no peaks; or `Scenarios(...)`, whose metrics are joined by their risk.
        progress: called with the number of the step and the metric after each step; a line in the terminal if it is
            left out.
        settings: keywords, all optional: `over`, `freeze`, `bounds`, `tie`, `limits`, `shape`, `metrics` say what may
            change and within which limits (see `Design`); `duration`, `dt`, `engine` how it is driven (see `Run`);
            `starts`, `seed`, `max_steps`, `fresh_roads` how it is searched and judged (see `Search`): from the vehicle
            only, in 100 steps, on up to 32 fresh roads, fewer once the gain and the limits are decided. Where a limit
            does not hold on them on average, it is tightened for the search by what is missing, and the result judged
            on new roads.

    Returns:
        The tuned vehicle, all metrics before and after, and the `verdict`: better or not, by how much and at what
        price, on roads that it was not tuned on. Warnings: about a search that did not converge, limits that cannot be
        satisfied, parameters without any effect, and dampers used outside the fitted range of their laws.

    Raises:
        ValueError: unknown metrics or parameters; bounds of a wrong shape, of a parameter that is not free, given in
            both places, or without the start between them; limits that are infinite, or negative for a metric that
            never is; a metric that does not depend on what is free.

    >>> from jaxdamp import roads, vehicles
    >>> result = minimise("rms_sprung_acceleration", vehicles.presets.quarter_car_000(), roads.white("C", 20.0))
    >>> round(float(result.vehicle.damper.rate), 1)
    4656.4
    >>> bounded = minimise("rms_sprung_acceleration", result.start, roads.white("C", 20.0), over={"rate": (1500, 4000)})
    >>> bounded.parameters[0].note
    'at its upper bound'
    """
    check_objective("metric", metric, "The call is `minimise(metric, vehicle, road)`.")
    check_call("minimise(metric, vehicle, road)", vehicle, road, settings)
    task = DesignTask([metric], vehicle, road, argument="metric", settings=settings)
    fresh_roads, name = settings["fresh_roads"], task.objective.name
    with Progress("Tuning") as shown:
        progress = progress or (lambda step, value: shown(f"step {step}, {name} {value:.5g}"))
        searched = _searched(task, settings, progress)
        while engine := finer(task, [searched.best.values], settings["engine"]):  # by fewer substeps than it needs
            task = DesignTask([metric], vehicle, road, argument="metric", settings={**settings, "engine": engine})
            searched = _searched(task, settings, progress)
        evaluator, descent, starts, evaluations, limits, several, ended = searched
        tighter = limits
        allowed = in_each(task.allowed, task.measured.scenario_names)
        fresh = _on_fresh_roads(evaluator, (task.space.start, ended.values), range(fresh_roads), allowed)
        for again in range(1, TIGHTENED + 1):
            now_reached = task.numbers(ended.evaluation.values)
            met = not missed(limits, now_reached, task.tolerance)
            excess = lost_limits(fresh, allowed) if met else {}
            if not excess:
                break
            tighter = [limit.tightened(excess.get(limit.name, 0.0), now_reached[limit.name]) for limit in tighter]
            again_from = descent.search([ended.values / task.space.unit], [ended.evaluation], tighter)
            closer = _best(descent, again_from, tighter)
            ended = closer._replace(history=ended.history + closer.history)
            others = range(again * fresh_roads, (again + 1) * fresh_roads)
            fresh = _on_fresh_roads(evaluator, (task.space.start, ended.values), others, allowed)
        attempts = _attempts(task, starts, several, limits) if len(several) > 1 else ()
        result = _result(task, evaluations[0], ended, attempts, (limits, tighter), fresh, settings)
        result = dataclasses.replace(result, warnings=(*_of_one_road(result), *result.warnings))
    driven = descent.combinations(tighter) if isinstance(descent, Driven) else None
    combinations = None if driven is None else _beside_next(evaluator, driven, fresh_roads)
    return dataclasses.replace(result, combinations=combinations)


class _Searched(NamedTuple):
    """Searches from the starts, with what they began from."""

    evaluator: Evaluator
    descent: Descent | Driven
    starts: np.ndarray  # coordinates
    evaluations: list[Evaluation]
    limits: list[Limit]
    several: Sequence[Ended]
    best: Ended


def _searched(
    task: DesignTask[AbstractVehicle], settings: Settings, progress: Callable[[int, float], None]
) -> _Searched:
    """The searches of a task; every combination where all that is free is a choice."""
    evaluator = Evaluator(task, settings["starts"])
    starts = start_points(task.space, settings["starts"], settings["seed"]) / task.space.unit
    evaluations, limits = evaluator.begin(starts)
    combining = every_combination(evaluator, progress)
    evaluator.refuse_constant(evaluations[0], [one.evaluation for one in combining.ends] if combining else ())
    descent = combining or Descent(evaluator, settings["max_steps"], progress)
    several = descent.search(starts, evaluations, limits)
    return _Searched(evaluator, descent, starts, evaluations, limits, several, _best(descent, several, limits))


def _beside_next(evaluator: Evaluator, combinations: Combinations, fresh_roads: int) -> Combinations:
    """The combinations, with the best one beside the next where two or more meet the limits."""
    if np.count_nonzero(combinations.met) < 2:
        return combinations
    best, following, *_ = np.transpose([*combinations.choices.values()])
    fresh = _on_fresh_roads(evaluator, (following, best), range(fresh_roads), {})
    text = beside_next(combinations, evaluator.task.objective.name, fresh)
    return dataclasses.replace(combinations, beside_next=text)


def _best(descent: Descent | Driven, several: Sequence[Ended], limits: Sequence[Limit]) -> Ended:
    """The search that ended best; of numbers that are choices, the best combination next to it."""
    task = descent.task
    best = min(several, key=lambda one: rank(task, one, limits))
    if not task.space.is_choice.any():
        return best
    chosen = min(descent.choose(best, limits), key=lambda one: rank(task, one, limits))
    steps = chosen.history or (task.metric(chosen.evaluation),)
    return chosen._replace(history=best.history + steps)


def _attempts(
    task: DesignTask[AbstractVehicle], starts: np.ndarray, several: Sequence[Ended], limits: Sequence[Limit]
) -> tuple[Attempt, ...]:
    """The searches from several starts, given by their coordinates."""
    pairs = zip(starts * task.space.unit, several, strict=True)
    numbers = [task.numbers(one.evaluation.values) for one in several]
    return tuple(
        Attempt(
            start,
            one.values,
            values[task.objective.name],
            not missed(limits, values, task.tolerance),
            one.slope_left() < task.tolerance.slope,
        )
        for (start, one), values in zip(pairs, numbers, strict=True)
    )


def _status(task: DesignTask[AbstractVehicle], ended: Ended, short: Sequence[Limit]) -> Status:
    if short:
        return Status.LIMIT_NOT_MET
    if ended.slope_left() < task.tolerance.slope:
        return Status.CONVERGED
    return Status.STEP_LIMIT if ended.out_of_steps else Status.NO_BETTER_STEP


def _result(
    task: DesignTask[V],
    start: Evaluation,
    ended: Ended,
    attempts: tuple[Attempt, ...],
    limits: tuple[Sequence[Limit], Sequence[Limit]],
    fresh: Rescore | None,
    asked: Settings,
) -> TuneResult[V]:
    """The result of a tuning, judged: what holds it, what it misses, and what it is worth on fresh roads.

    Limits are those of the task and those of the search, which are tighter if it was repeated.
    """
    vehicle, space, objective, units = task.vehicle, task.space, task.objective, task.units
    before, after = task.numbers(start.values), task.numbers(ended.evaluation.values)
    idle = without_effect(space, (start, ended.evaluation), ended.values)
    short = missed(limits[0], after, task.tolerance)
    held = reached(limits[1], after, task.tolerance)
    tightened = tuple(dict.fromkeys(one.of for one, searched in zip(*limits, strict=True) if one != searched))
    status, changes = _status(task, ended, short), space.changes(ended.values)
    notes = missed_notes(short, after, changes) + true_value_notes(objective, after, before, task.allowed)
    notes += tightened_notes(tightened) + workshop_notes(space) + effect_notes(idle, objective.name)
    notes += bound_notes(space, changes) + start_notes(attempts, objective.name)
    if status in (Status.STEP_LIMIT, Status.NO_BETTER_STEP):
        notes.append(early_end(ended, asked["max_steps"]))
    tuned = space.free.build(jnp.asarray(ended.values, space.free.values.dtype))
    runs, extrapolated = task.notes_on_runs(tuned)
    reported = [{name: side[name] for name in units} for side in (before, after)]
    road = task.road.scenarios[0].road if isinstance(task.road, Scenarios) else task.road
    return TuneResult(
        vehicle=tuned,
        start=vehicle,
        metric=objective.name,
        parameters=changes,
        before=MetricValues.with_units(reported[0], units),
        after=MetricValues.with_units(reported[1], units),
        units=units,
        limits=task.shown_limits(reported[0]),
        active_limits=tuple(dict.fromkeys(limit.of for limit in held if not limit.is_shape)),
        warnings=tuple(dict.fromkeys(notes + runs)),
        status=status,
        history=ended.history,
        objective=objective,
        active=active_words(held, after, changes, space, ended.values, tightened),
        fresh=fresh,
        starts=attempts,
        scenarios=_in_scenarios(task, tuned),
        without_effect=idle,
        drive=Drive(road, task.run),
        violated=violations(short, after),
        extrapolated=tuple(extrapolated),
        allowed=task.allowed,
        elsewhere=_where_it_holds(task.road, asked["fresh_roads"]),
        relaxation=relaxation(task, ended, limits),
        tightened=tightened,
    )


def _on_fresh_roads(
    evaluator: Evaluator,
    sides: tuple[np.ndarray, np.ndarray],
    numbers: Sequence[int],
    allowed: Mapping[str, LimitRange],
) -> Rescore | None:
    """Two designs on so many other realisations of the road that gain and limits are decided; None without any."""
    task, designs = evaluator.task, np.stack(sides)
    one, other = (task.space.free.build(jnp.asarray(side, task.space.free.values.dtype)) for side in sides)
    cars = one, other

    def drive(road: Road | Scenarios) -> list[dict[str, float]]:
        ride = ride_on(task.vehicle, road, task.objective, task.run)
        return [task.numbers(row) for row in evaluator.program.at(designs, ride).values]

    name, others, driven = task.objective.name, other_roads(task.road, numbers), None
    for first, last in itertools.pairwise([0, *(FEWEST * 2**i for i in range(len(numbers)))]):
        part = others[first:last]
        if not part:
            break
        what = ("fresh roads", cars, task.run, part, name, task.units, list(allowed))
        new = piece(what, lambda part=part: rescored(drive, part, task.units, name, task.objective.metrics, allowed))
        driven = new if driven is None else driven.and_on(new)
        if decided(driven, allowed):
            break
    return driven


def _of_one_road(result: TuneResult[V]) -> list[str]:
    """What to do where the optimum on the one random road of a tuning is not better on others."""
    if (
        result.fresh is None
        or result.scenarios
        or result.verdict.outcome not in (Outcome.NOT_BETTER, Outcome.NOT_SHOWN)
    ):
        return []
    several = "four together, `Scenarios([road.reseeded(seed) for seed in range(4)])`"
    return [f"One realisation of a road has an optimum of its own. Tune on {several}, or on a longer one."]


def _where_it_holds(road: Road | Scenarios, fresh_roads: int) -> str:
    """Where the numbers of a tuning hold that was not tried on fresh roads, in words."""
    scenarios = road.in_words if isinstance(road, Scenarios) else ""
    if is_white(road):
        return scenarios or "in the mean of all such roads"
    others = "not random: there are no fresh roads" if fresh_roads else "tried on no other"
    return f"{scenarios or 'on the road of the tuning'} ({others})"


def _in_scenarios(task: DesignTask[AbstractVehicle], tuned: AbstractVehicle) -> ScenarioValues | None:
    """All metrics in every scenario, before and after; None on one road."""
    measured = task.measured
    if not isinstance(measured.ride, ScenarioRide):
        return None
    sides = [{n: np.asarray(x, float) for n, x in measured.each(car).items()} for car in (task.vehicle, tuned)]
    return ScenarioValues(measured.scenario_names, *sides)
