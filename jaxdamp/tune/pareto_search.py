"""`pareto`: the front of two or three ride metrics over the free parameters of a vehicle, by exact gradients."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from jaxdamp import _checks
from jaxdamp._progress import Progress
from jaxdamp._traced import of_known_numbers
from jaxdamp.metrics import Metric, current_name
from jaxdamp.tune.filling import with_designs_between
from jaxdamp.tune.front import FrontParameter, ParetoFront
from jaxdamp.tune.front_notes import judged, notes_on_points
from jaxdamp.tune.limits import limit_ends
from jaxdamp.tune.objective import Function, check_objective
from jaxdamp.tune.rescoring import other_roads
from jaxdamp.tune.result import V
from jaxdamp.tune.scenarios import Road, Scenarios
from jaxdamp.tune.shape import Shape
from jaxdamp.tune.side_by_side import BatchEvaluator
from jaxdamp.tune.starts import start_points
from jaxdamp.tune.task import DesignTask, check_call
from jaxdamp.tune.tracing import FrontProblem, trace_front


BEYOND = 0.1  # distance of the default reference point beyond the worst values, relative to their range


@partial(of_known_numbers, instead="; a `Ride` can be traced")
def pareto(
    objectives: Sequence[str | Metric | Function],
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
    points: int = 21,
    between: int = 0,
    reference: Mapping[str, float] | None = None,
    starts: int = 1,
    seed: int = 0,
    fresh_roads: int = 3,
    duration: float | None = None,
    dt: float = 1e-3,
    max_steps: int = 40,
    progress: Callable[[int, int], None] | None = None,
) -> ParetoFront[V]:
    """The front of two or three ride metrics: the designs that improve in one only at the expense of another.

    First the minimum of each objective is computed, then points that are evenly spread between these ends (normal
    boundary intersection: aims on the line or triangle between the ends, and the design with the smallest excess over
    its aim). New points start from an interpolation of their neighbours' parameters, with their neighbours' curvature,
    so that most of them take one or two simulations with derivatives. All open searches are simulated side by side. At
    the end each one is compared with the results of the others and continued from a better one. Searches are local, as
    in `minimise`, with the same default bounds.

    With three objectives points near the borders of the front, where one objective is worse than at all three ends, are
    left out.

    Arguments:
        objectives: two or three, each as the `metric` of `minimise`.
        vehicle: the vehicle to start from.
        road: as in `minimise`; of `Scenarios` the metrics are joined by their risk, and limits apply in each of them.
        over: as in `minimise`.
        freeze: as in `minimise`.
        bounds: as in `minimise`.
        tie: as in `minimise`.
        limits: hard limits, as in `minimise`; points that violate one are left out.
        shape: as in `minimise`.
        metrics: further metrics, which functions and limits can use by name.
        points: number of points; of three objectives the largest triangular number that is not above it.
        between: number of further designs with parameters interpolated between those points. They are simulated without
            derivatives, and fill the front at little cost where it is smooth.
        reference: the point up to which the hypervolume counts, `{objective: value}`; 10 % of the range of each
            objective beyond its worst value on the front if left out.
        starts: number of searches for each end of the front, the first from the vehicle, the others from inside the
            bounds; the best one counts.
        seed: of the other starts.
        fresh_roads: number of other realisations of a random road, or of those of the scenarios, on which all points
            are simulated again; 0 for none.
        duration: length of the run [s], as in `simulate`.
        dt: step [s], as in `simulate`.
        max_steps: largest number of steps of each search.
        progress: called with the number of points done and of all points; a line in the terminal if it is left out.

    Returns:
        The designs with all metrics, without those that another one beats; and warnings, also about limits that do not
        hold on fresh roads.

    Raises:
        ValueError: a number of objectives other than two or three, or two with the same name; what `minimise` refuses.

    >>> from jaxdamp import roads, vehicles
    >>> car = vehicles.presets.quarter_car_000()
    >>> front = pareto(["rms_sprung_acceleration", "rms_dynamic_tyre_load"], car, roads.white("C", 20.0), points=5)
    >>> [round(float(rate), -1) for rate in front.designs[[0, -1], 0]]  # the two optima: 4656.4 and 5536.5
    [4660.0, 5540.0]
    """
    counts = {"points": (points, 1), "between": (between, 0), "max_steps": (max_steps, 1), "starts": (starts, 1)}
    _check(objectives, vehicle, road, points, counts | {"fresh_roads": (fresh_roads, 0), "seed": (seed, 0)})
    task = DesignTask(
        objectives, vehicle, road, argument="objectives", over=over, freeze=freeze, bounds=bounds, tie=tie,
        limits=limits, shape=shape, metrics=metrics, duration=duration, dt=dt,
    )  # fmt: skip
    names, space = task.objective.names, task.space
    given = _reference(reference, names)
    evaluator = BatchEvaluator(task)
    begun = start_points(space, starts, seed) / space.unit
    evaluated = evaluator.evaluated(begun)
    before = dict(zip(task.names, map(float, evaluated[0][0]), strict=True))
    all_limits = task.limits(before)
    evaluator.follow(limit_ends(all_limits))
    usable = [i for i, pair in enumerate(evaluated) if i == 0 or all(np.all(np.isfinite(a)) for a in pair)]
    size = np.abs([before[name] for name in names]) + np.finfo(float).tiny
    problem = FrontProblem(evaluator, all_limits, max_steps, size)
    with Progress("Tracing the front") as shown:

        def report(done: int, total: int) -> None:
            if progress is not None:
                progress(done, total)
            else:
                shown(f"{done} of {total} points, {evaluator.points} designs simulated")

        computed = [evaluator.rows_of(*evaluated[i]) for i in usable]
        lanes = trace_front(problem, begun[usable], computed, points, report)
    chosen, status, notes = judged(lanes, problem)
    designs = np.array([np.clip(lane.at * space.unit, space.lower, space.upper) for lane in chosen])
    numbers = dict(zip(task.names, np.array([lane.now.values for lane in chosen]).T, strict=True))
    worst = {name: numbers[name].max() + BEYOND * np.ptp(numbers[name]) for name in names}
    dropped = len(lanes) - len(chosen)
    if between and len(chosen) > len(names):
        designs, numbers = with_designs_between(evaluator, designs, numbers, all_limits, between)
    free = zip(space.free.names, space.free.owners, space.start, space.lower, space.upper, strict=True)
    fresh, start_on_fresh = _on_fresh_roads(evaluator, designs, fresh_roads)
    front = ParetoFront[V](
        start=vehicle,
        names=names,
        values={name: numbers[name] for name in task.units},
        before={name: before[name] for name in task.units},
        units=task.units,
        parameters=tuple(FrontParameter(n, p.unit, float(a), float(b), float(c)) for n, p, a, b, c in free),
        designs=designs,
        limits=task.shown_limits(before),
        reference={name: float(value) for name, value in worst.items()} | given,
        warnings=tuple(notes),
        status=status,
        evaluations=evaluator.points,
        interpolated=between if len(chosen) > len(names) else 0,
        dropped=dropped,
        free=space.free,
        measured=task.measured,
        fresh=fresh,
    )
    return dataclasses.replace(front, warnings=(*notes, *notes_on_points(front, task, start_on_fresh)))


def _check(objectives: Any, vehicle: Any, road: Any, points: int, counts: Mapping[str, tuple[int, int]]) -> None:
    call = "pareto([metric, metric], vehicle, road)"
    if isinstance(objectives, str) or not isinstance(objectives, Sequence) or len(objectives) not in (2, 3):
        _checks.refuse(
            "objectives", "be a list of two or three", _checks.described(objectives), f"The call is `{call}`."
        )
    for i, one in enumerate(objectives):
        check_objective(f"objectives[{i}]", one, f"The call is `{call}`.")
    check_call(call, vehicle, road, counts)
    least = 3 * (len(objectives) - 1)  # the ends and one point between them
    if points < least:
        _checks.refuse("points", f"be {least} or more for {len(objectives)} objectives", points)


def _reference(reference: Mapping[str, float] | None, names: Sequence[str]) -> dict[str, float]:
    """The given part of the reference point."""
    remedy = f"Write `{{{names[0]!r}: 1.5}}`, in the unit of the objective."
    if not isinstance(reference, Mapping | None):
        _checks.refuse("reference", "be a mapping of objectives to values", _checks.described(reference), remedy)
    given = {current_name(name, names): value for name, value in (reference or {}).items()}
    for name, value in given.items():
        _checks.one_of("reference", name, names)
        _checks.finite(f"reference[{name!r}]", value, remedy)
    return {name: float(value) for name, value in given.items()}


def _on_fresh_roads(
    evaluator: BatchEvaluator, designs: np.ndarray, count: int
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """The metrics of designs on other realisations of the road, shape (roads, points), and of the start, (roads,).

    Nothing of a road that has no other realisation.
    """
    task = evaluator.task
    rides = [task.measured.on_road(road).side_by_side() for road in other_roads(task.road, range(count))]
    runs = [evaluator.numbers_at(np.vstack([designs, task.space.start]), ride) for ride in rides]
    values = {name: np.stack([run[name] for run in runs]) for name in task.units if runs}
    return {name: rows[:, :-1] for name, rows in values.items()}, {name: rows[:, -1] for name, rows in values.items()}
