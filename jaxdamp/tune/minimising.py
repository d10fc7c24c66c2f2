"""`minimise`: tune the free parameters of a vehicle for a ride metric, by exact gradients."""

import functools
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxdamp._progress import Progress
from jaxdamp._status import Status
from jaxdamp._traced import of_known_numbers
from jaxdamp.metrics import Metric, MetricValues
from jaxdamp.tune.limits import Limit
from jaxdamp.tune.objective import Function, check_objective
from jaxdamp.tune.rescoring import on_fresh_roads
from jaxdamp.tune.result import Drive, ScenarioValues, TuneResult, V
from jaxdamp.tune.risk import exact
from jaxdamp.tune.scenario_ride import ScenarioRide
from jaxdamp.tune.scenarios import Road, Scenarios
from jaxdamp.tune.searching import Ended, Evaluator, many_at_a_time, missed, one_at_a_time, reached, search
from jaxdamp.tune.shape import Shape
from jaxdamp.tune.starts import Attempt, Desk, best_of, search_together, start_points
from jaxdamp.tune.task import DesignTask, check_call
from jaxdamp.tune.verdict import lost_limits
from jaxdamp.tune.wording import (
    active_words,
    bound_notes,
    changes_of,
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


TIGHTENED = 2  # times that a search is repeated with limits that did not hold on fresh roads


@partial(of_known_numbers, instead="; a `Ride` can be traced")
def minimise(
    metric: str | Metric | Function,
    vehicle: V,
    road: Road | Scenarios,
    *,
    over: Sequence[str] | Mapping[str, Any] | None = None,
    freeze: Sequence[str] = (),
    bounds: Mapping[str, Any] | None = None,
    tie: Mapping[str, str] | None = None,
    limits: Mapping[Any, Any] | None = None,
    shape: Sequence[Shape] | Shape = (),
    metrics: Sequence[str | Metric] = (),
    starts: int = 1,
    seed: int = 0,
    fresh_roads: int = 32,
    duration: float | None = None,
    dt: float = 1e-3,
    max_steps: int = 100,
    progress: Callable[[int, float], None] | None = None,
) -> TuneResult[V]:
    """Minimise a ride metric of a vehicle over its free parameters.

    Sequential quadratic programming with exact first derivatives, computed in forward mode through the simulation for
    all parameters at once. It finds a local optimum, so start from a reasonable vehicle, or from several `starts`. The
    search itself is in double precision; a vehicle in single precision (see `jaxdamp.configure`) is tuned to about
    0.1 % of its parameters.

    Every parameter has bounds, so that the result stays near a damper that can be built. The default bounds are:

    - numbers of one sign (rates, stiffnesses, forces, velocities, exponents, knots): one third to three times the
      start;
    - numbers of either sign (coefficients, offsets): −1 to 3 times the start;
    - zeros and weights of networks: their domain.

    Domains are always respected. A parameter that ends at a bound is named in the `warnings`: the optimum may be
    beyond.

    Arguments:
        metric: the name of a ride metric of the vehicle, such as `"rms_sprung_acceleration"`; a `metrics.Metric` of any
            channel; or a differentiable function of the metrics by name, such as
            `lambda m: m["rms_sprung_acceleration"] / 1.5 + m["dynamic_load_coefficient"] / 0.2`, or `Targets(...)`.
        vehicle: the vehicle to start from.
        road: a road for the simulation, the same in every step; `roads.white(...)` for the stationary response with
            equivalent linear laws, which has no peaks; or `Scenarios(...)`, whose metrics are joined by their risk.
        over: the parameters to change, by path, last part or pattern; all of the dampers that a workshop can change
            (`Parameter.adjustable`) if left out. A mapping `{parameter: (lower, upper)}` gives their bounds too, as
            `bounds` does.
        freeze: parameters among these to hold at their start.
        bounds: bounds `{parameter: (lower, upper)}` in the unit of the parameter, instead of the default ones; the
            start must be between them. None removes one bound or both: with `bounds={"*": None}` only the domains
            remain. If two names match a parameter, the later one counts.
        tie: parameters that take the values of others, such as `{"front.damper.**": "rear.damper.**"}`: one free value
            for each group (see `jaxdamp.parameters.free_parameters`).
        limits: hard limits `{metric: largest value}` or `{metric: (smallest, largest)}` in the metric's unit, such as
            `{"working_space_peak_to_peak": 0.1}`, with a name or a `metrics.Metric`; in every scenario. `"+10%"` is
            relative to the start on the same road.
        shape: constraints on the force-velocity curve: `slope`, `monotone`, `ratio`, `knee`.
        metrics: further metrics, which the function and the limits can use by name.
        starts: number of searches, side by side; the first from the vehicle, the others from inside the bounds.
        seed: of the other starts.
        fresh_roads: largest number of other realisations of a random road, or of those of the scenarios, on which the
            result is judged; fewer once the gain and the limits are decided. 0 for none. Where a limit does not hold on
            them on average, it is tightened for the search by what is missing, and the result judged on new roads.
        duration: length of the run [s], as in `simulate`.
        dt: step [s], as in `simulate`.
        max_steps: largest number of steps of the search.
        progress: called with the number of the step and the metric after each step; a line in the terminal if it is
            left out.

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
    counts = {"max_steps": (max_steps, 1), "starts": (starts, 1), "fresh_roads": (fresh_roads, 0), "seed": (seed, 0)}
    check_call("minimise(metric, vehicle, road)", vehicle, road, counts)
    task = DesignTask(
        [metric], vehicle, road, argument="metric", over=over, freeze=freeze, bounds=bounds, tie=tie, limits=limits,
        shape=shape, metrics=metrics, duration=duration, dt=dt,
    )  # fmt: skip
    space, name, names = task.space, task.objective.name, task.names
    ride = task.measured.ride if starts == 1 else task.measured.ride.side_by_side()
    numbers = functools.partial(task.numbers, ride)
    desk = None if starts == 1 else Desk(many_at_a_time(numbers, space.free, names), starts)
    evaluate = one_at_a_time(numbers, space.free, names) if desk is None else desk.alone
    alone = Evaluator(evaluate, names, task.tolerance)
    all_limits = task.limits(alone.at(space.start)[0])
    task.refuse_constant(*alone.at(space.start))
    with Progress("Tuning") as shown:
        progress = progress or (lambda step, value: shown(f"step {step}, {name} {value:.5g}"))
        if desk is None:
            ended, attempts = search(alone, space, name, all_limits, max_steps, progress), ()
        else:
            points = start_points(space, starts, seed)
            several = search_together(desk, alone, points, space, name, all_limits, max_steps, progress)
            ended, attempts = _chosen(several, alone, points, name, all_limits)
        result = _result(task, alone, ended, attempts, all_limits, all_limits, max_steps, fresh_roads)
        tighter = all_limits
        for again in range(1, TIGHTENED + 1):
            excess = {} if result.violated else lost_limits(result)
            if not excess:
                break
            tighter = [limit.tightened(excess.get(limit.of, 0.0)) for limit in tighter]
            ended = search(alone, space, name, tighter, max_steps, progress, ended.values)
            result = _result(task, alone, ended, attempts, all_limits, tighter, max_steps, fresh_roads, again)
    return result


def _chosen(
    ended: Sequence[Ended], evaluator: Evaluator, points: np.ndarray, metric: str, limits: Sequence[Limit]
) -> tuple[Ended, tuple[Attempt, ...]]:
    """The best of several searches, and all of them."""
    best, values = best_of(ended, evaluator, metric, limits)
    attempts = (
        Attempt(
            start,
            one.values,
            value,
            not missed(limits, evaluator.at(one.values)[0], evaluator.tolerance),
            one.slope_left < evaluator.tolerance.slope,
        )
        for start, one, value in zip(points, ended, values, strict=True)
    )
    return ended[best], tuple(attempts)


def _result(
    task: DesignTask[V],
    evaluator: Evaluator,
    ended: Ended,
    attempts: tuple[Attempt, ...],
    limits: Sequence[Limit],
    searched: Sequence[Limit],
    max_steps: int,
    fresh_roads: int,
    again: int = 0,
) -> TuneResult[V]:
    """The result of a tuning, judged: what holds it, what it misses, and what it is worth on fresh roads.

    Limits may have been tighter in the search than they are, after it was repeated so many times.
    """
    vehicle, space, objective, road, units = task.vehicle, task.space, task.objective, task.road, task.units
    sides = evaluator.at(space.start), evaluator.at(ended.values)
    before, after = (numbers for numbers, _ in sides)
    idle = without_effect(space.free.names, (space.start, ended.values), objective.name, sides)
    short = missed(limits, after, evaluator.tolerance)
    changes = changes_of(space, ended.values)
    if short:
        status = Status.LIMIT_NOT_MET
    elif ended.slope_left < evaluator.tolerance.slope:
        status = Status.CONVERGED
    else:
        status = Status.STEP_LIMIT if ended.out_of_steps else Status.NO_BETTER_STEP
    held = reached(searched, after, evaluator.tolerance)
    notes = missed_notes(short, after, changes) + true_value_notes(objective, after, before, task.allowed)
    notes += tightened_notes(limits, searched) + workshop_notes(space) + effect_notes(idle, objective.name)
    notes += bound_notes(space, changes) + start_notes(attempts, objective.name)
    if status in (Status.STEP_LIMIT, Status.NO_BETTER_STEP):
        notes.append(early_end(ended, max_steps))
    tuned = space.free.build(jnp.asarray(ended.values, space.free.values.dtype))
    runs, extrapolated = task.notes_on_runs(tuned)
    notes += runs
    reported = [{name: values[name] for name in units} for values in (before, after)]
    duration, dt = task.run
    fresh = on_fresh_roads(
        (vehicle, tuned),
        road,
        range(again * fresh_roads, (again + 1) * fresh_roads),
        task.allowed,
        objective,
        units,
        duration=duration,
        dt=dt,
    )
    each, measured = None, task.measured
    if isinstance(measured.ride, ScenarioRide):
        sides = [{name: np.asarray(x, float) for name, x in measured.each(car).items()} for car in (vehicle, tuned)]
        each = ScenarioValues(measured.scenario_names, *sides)
        risk, weights = exact(measured.ride.risk), measured.ride.weights
        reported = [{name: float(risk(jnp.asarray(side[name]), weights)) for name in units} for side in sides]
    return TuneResult(
        vehicle=tuned,
        start=vehicle,
        metric=objective.name,
        parameters=changes,
        before=MetricValues.with_units(reported[0], units),
        after=MetricValues.with_units(reported[1], units),
        units=units,
        limits=task.shown_limits(before),
        active_limits=tuple(dict.fromkeys(limit.of for limit in held if not limit.is_shape)),
        warnings=tuple(dict.fromkeys(notes)),
        status=status,
        history=ended.history,
        objective=objective,
        active=active_words(held, after, changes, space, ended.values),
        fresh=fresh,
        starts=attempts,
        scenarios=each,
        without_effect=idle,
        drive=Drive(road.scenarios[0].road if isinstance(road, Scenarios) else road, *task.run),
        violated=violations(short, after),
        extrapolated=tuple(extrapolated),
        allowed=task.allowed,
        elsewhere=_where(task, fresh_roads),
    )


def _where(task: DesignTask[Any], fresh_roads: int) -> str:
    """Where the numbers of a tuning hold that was not tried on fresh roads, in words."""
    if task.measured.white:
        return "in the mean of all such roads"
    return "on the road of the tuning" + (", which cannot be drawn again" if fresh_roads else ", tried on no other")
