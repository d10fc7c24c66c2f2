"""`pareto`: the front of two or three ride metrics over the free parameters of a vehicle, by exact gradients."""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar, Unpack

import numpy as np

from jaxdamp import _checks
from jaxdamp._progress import Progress
from jaxdamp._settings import with_defaults
from jaxdamp._status import Status
from jaxdamp._traced import of_known_numbers
from jaxdamp.metrics import Metric, current_name
from jaxdamp.solve import SearchState
from jaxdamp.tune.descending import finer, missed
from jaxdamp.tune.front import FrontParameter, ParetoFront, non_dominated, shares_of
from jaxdamp.tune.limits import Limit
from jaxdamp.tune.measuring import LANES, ride_on
from jaxdamp.tune.objective import Function, check_objective
from jaxdamp.tune.ranges import start_points
from jaxdamp.tune.rescoring import other_roads
from jaxdamp.tune.result import V
from jaxdamp.tune.scenarios import Road, Scenarios
from jaxdamp.tune.settings import DEFAULTS, Settings
from jaxdamp.tune.smooth import exact_counterpart
from jaxdamp.tune.task import DesignTask, Evaluator, check_call
from jaxdamp.tune.tracing import NO_CONFLICT, FrontProblem, lattice, range_of, trace_front
from jaxdamp.tune.verdict import missed_notes
from jaxdamp.vehicles import AbstractVehicle


T = TypeVar("T")
BEYOND = 0.1  # distance of the default reference point beyond the worst values, relative to their range
FRESH_ROADS, MAX_STEPS = 3, 40  # by default


@of_known_numbers
@with_defaults(DEFAULTS, fresh_roads=FRESH_ROADS, max_steps=MAX_STEPS)
def pareto(
    objectives: Sequence[str | Metric | Function],
    vehicle: V,
    road: Road | Scenarios,
    *,
    points: int = 21,
    between: int = 0,
    reference: Mapping[str, float] | None = None,
    progress: Callable[[int, int], None] | None = None,
    **settings: Unpack[Settings],
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
        points: number of points; of three objectives the largest triangular number that is not above it.
        between: number of further designs with parameters interpolated between those points. They are simulated without
            derivatives, and fill the front at little cost where it is smooth.
        reference: the point up to which the hypervolume counts, `{objective: value}`; 10 % of the range of each
            objective beyond its worst value on the front if left out.
        progress: called with the number of points done and of all points; a line in the terminal if it is left out.
        settings: keywords of `minimise`: `over`, `limits`, `duration`, `starts` and the others of `Design`, `Run` and
            `Search`. Points that violate a limit are left out; each end of the front is searched from all starts, in 40
            steps at most; all points are simulated again on 3 fresh roads.

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
    _check(objectives, vehicle, road, points, settings | {"points": points, "between": between})
    engine, front = settings["engine"], None
    with Progress("Tracing the front") as shown:
        report = progress or (lambda done, total: shown(f"{done} of {total} points"))
        while front is None or engine:  # again where points need more substeps than were taken
            task = DesignTask(objectives, vehicle, road, argument="objectives", settings={**settings, "engine": engine})
            front = _front(task, points, between, reference, report, settings)
            engine = finer(task, [front.designs[i] for i in _looked_at(front)], settings["engine"])
    return front


def _front(
    task: DesignTask[V],
    points: int,
    between: int,
    reference: Mapping[str, float] | None,
    report: Callable[[int, int], None],
    settings: Settings,
) -> ParetoFront[V]:
    """The front of a task, judged."""
    names, space, evaluator = task.objective.names, task.space, Evaluator(task, LANES)
    given = _reference(reference, names)
    if space.is_choice.any():
        remedy = "Choose by `minimise`, from a point of the front."
        _checks.refuse("over", "have bounds along a front", "with a `Choice`", remedy)
    starts = start_points(space, settings["starts"], settings["seed"]) / space.unit
    evaluations, limits = evaluator.begin(starts)
    usable = [i for i, one in enumerate(evaluations) if i == 0 or all(np.all(np.isfinite(a)) for a in one)]
    before = task.numbers(evaluations[0].values)
    size = evaluator.sizes(evaluations[0])
    problem = FrontProblem(evaluator, limits, settings["max_steps"], size, report)
    states = trace_front(problem, starts[usable], [evaluations[i] for i in usable], points)
    chosen, status, notes = _judged(states, problem)
    designs = np.array([np.clip(state.y * space.unit, space.lower, space.upper) for state in chosen])
    numbers = dict(zip(task.names, np.array([state.evaluation.values for state in chosen]).T, strict=True))
    filled = between if len(chosen) > len(names) else 0
    if filled:
        designs, numbers = _with_designs_between(evaluator, designs, numbers, limits, between)
    designs, numbers = _best_of(names, designs, numbers)
    worst = {name: float(numbers[name].max() + BEYOND * np.ptp(numbers[name])) for name in names}
    fresh, start_on_fresh = _on_fresh_roads(evaluator, designs, settings["fresh_roads"])
    front = ParetoFront[V](
        start=task.vehicle,
        names=names,
        values=_of_metrics(task, numbers),
        before=_of_metrics(task, before),
        units=task.units,
        parameters=tuple(
            FrontParameter(c.name, c.unit, c.before, c.lower, c.upper) for c in space.changes(space.start)
        ),
        designs=designs,
        limits=task.shown_limits(before),
        reference=worst | given,
        warnings=tuple(notes),
        status=status,
        evaluations=evaluator.program.points,
        interpolated=filled,
        dropped=len(states) - len(chosen),
        free=space.free,
        measured=task.measured,
        fresh=_of_metrics(task, fresh),
    )
    return dataclasses.replace(front, warnings=(*notes, *_notes_on_points(front, task, fresh, start_on_fresh)))


def _of_metrics(task: DesignTask[V], numbers: Mapping[str, T]) -> dict[str, T]:
    """The numbers of metrics and objectives among those of a search; none of none."""
    return {name: numbers[name] for name in task.units if numbers}


def _check(objectives: object, vehicle: object, road: object, points: int, counts: Mapping[str, object]) -> None:
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


def _judged(states: Sequence[SearchState], problem: FrontProblem) -> tuple[list[SearchState], Status, list[str]]:
    """The points of the front in the order of the first objective, how the searches ended, and doubts in words."""
    count, task = problem.objectives, problem.evaluator.task
    values = [task.numbers(state.evaluation.values) for state in states]
    short = [missed(problem.limits, of_state, task.tolerance) for of_state in values]
    allowed = [state for state, limits in zip(states, short, strict=True) if not limits]
    if not allowed:  # the point that is nearest to the limits
        beyond = [max(-limit.margin(v[limit.name]) for limit in s) for s, v in zip(short, values, strict=True)]
        i, space = int(np.argmin(beyond)), task.space
        design = np.clip(states[i].y * space.unit, space.lower, space.upper)
        return [states[i]], Status.LIMIT_NOT_MET, missed_notes(short[i], values[i], space.changes(design))
    notes = []
    if len(allowed) < len(states):
        names = dict.fromkeys(limit.of for limits in short for limit in limits)
        notes.append(f"{len(states) - len(allowed)} searches ended beyond the limits of {', '.join(names)}: left out.")
    objectives = np.stack([state.evaluation.rows[:count] for state in allowed])
    best = [allowed[i] for i in np.flatnonzero(non_dominated(objectives))]
    best.sort(key=lambda state: tuple(state.evaluation.rows[:count]))
    span = range_of(states, count) / np.maximum(np.abs(objectives).max(axis=0), np.finfo(float).tiny)
    if min(span) < NO_CONFLICT:
        notes.append("The objectives do not conflict: one design is the best in all of them, and there is no front.")
    status, early = _ends_of(best, problem.max_steps)
    return best, status, [*notes, *early, *_at_bounds(best, task)]


def _ends_of(best: Sequence[SearchState], max_steps: int) -> tuple[Status, list[str]]:
    """How the searches of the points ended, and a sentence if some of them are no optima."""
    failed = [state for state in best if not state.converged]
    if not failed:
        return Status.CONVERGED, []
    status = Status.STEP_LIMIT if any(state.steps >= max_steps for state in failed) else Status.NO_BETTER_STEP
    return status, [f"{len(failed)} of {len(best)} points are not optima: {status.sentence}"]


def _at_bounds(best: Sequence[SearchState], task: DesignTask[AbstractVehicle]) -> list[str]:
    """A sentence for each parameter at a bound."""
    sides, notes = [task.space.side(state.y * task.space.unit) for state in best], []
    for name, column in zip(task.space.free.names, zip(*sides, strict=True), strict=True):
        for side in ("lower", "upper"):
            if side in column:
                notes.append(f"{name} is at its {side} bound at {column.count(side)} of {len(best)} points.")
    return notes


def _notes_on_points(
    front: ParetoFront,
    task: DesignTask[AbstractVehicle],
    fresh: Mapping[str, np.ndarray],
    start_on_fresh: Mapping[str, np.ndarray],
) -> list[str]:
    """Limits that the points do not keep by their true values or on fresh roads; doubts about step and fitted ranges.

    The step and the ranges are looked at at the ends and the knee of the front.
    """
    notes = []
    exact = {m.name: other for m in task.objective.metrics if (other := exact_counterpart(m))}
    for name, allowed in task.allowed.items():
        lower, upper = allowed.at(front.before[name])
        if name in exact:
            true = front.values[exact[name].name]
            if beyond := int(np.sum(~((lower <= true) & (true <= upper)))):
                notes.append(f"{name} is limited, but the true {exact[name].name} is beyond at {beyond} points.")
        for entry in task.measured.entries(name) if fresh else ():
            values = fresh[entry]
            ends = np.array([allowed.at(float(start)) for start in start_on_fresh[entry]])
            above, below = values > ends[:, 1:], values < ends[:, :1]
            if (outside := above | below | np.isnan(values)).any():
                places = f"{int(outside.any(axis=0).sum())} of {len(front)} points"
                furthest = values.max() if above.any() else values.min()
                notes.append(
                    f"On {int(outside.any(axis=1).sum())} of {len(values)} fresh roads {entry} is beyond its limit at "
                    f"{places}, up to {furthest:.4g}."
                )
    by_point: dict[str, None] = {}
    for i in _looked_at(front):
        by_point |= dict.fromkeys(f"Point {i}: {note}" for note in task.notes_on_runs(front.point(i))[0])
    return [*notes, *by_point]


def _looked_at(front: ParetoFront) -> list[int]:
    """The ends and the knee of a front."""
    return list(dict.fromkeys([0, front.knee, len(front) - 1]))


def _with_designs_between(
    evaluator: Evaluator,
    designs: np.ndarray,
    numbers: dict[str, np.ndarray],
    limits: Sequence[Limit],
    count: int,
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The designs of a front with others between them, as far as no other one beats them and they keep all limits."""
    from scipy.interpolate import RBFInterpolator

    space, names = evaluator.task.space, evaluator.task.objective.names
    shares = shares_of(np.stack([numbers[name] for name in names], axis=1))
    flat = (shares - shares.mean(axis=1, keepdims=True))[:, :-1]  # the plane through the ends, seen along its normal
    ends = flat[np.argmin(shares, axis=0)]
    size = np.where(space.upper - space.lower < np.inf, space.upper - space.lower, 1.0)
    inside = RBFInterpolator(flat, designs / size, kernel="cubic")(np.array(lattice(len(ends), count)) @ ends)
    new = np.clip(inside * size, space.lower, space.upper)
    of_new = dict(zip(evaluator.task.names, evaluator.program.values(new).T, strict=True))
    ordered = np.array([p.domain.ordered and p.path == q.path for p, q in itertools.pairwise(space.free.owners)], bool)
    allowed = np.all(np.isfinite(list(of_new.values())), axis=0) & np.all(
        np.diff(new, axis=1)[:, ordered] > 0.0, axis=1
    )
    for limit in limits:
        allowed &= (of_new[limit.name] >= limit.lower) & (of_new[limit.name] <= limit.upper)
    designs = np.concatenate([designs, new[allowed]])
    numbers = {name: np.concatenate([values, of_new[name][allowed]]) for name, values in numbers.items()}
    return _best_of(names, designs, numbers)


def _best_of(
    names: Sequence[str], designs: np.ndarray, numbers: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The designs that no other one beats, in the order of the first objective."""
    objectives = np.stack([numbers[name] for name in names], axis=1)
    best = np.flatnonzero(non_dominated(objectives))
    best = best[np.lexsort(objectives[best].T[::-1])]
    return designs[best], {name: values[best] for name, values in numbers.items()}


def _on_fresh_roads(
    evaluator: Evaluator, designs: np.ndarray, count: int
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """The numbers of designs on other realisations of the road, shape (roads, points), and of the start, (roads,).

    Nothing of a road that has no other realisation.
    """
    task = evaluator.task
    rides = [ride_on(task.vehicle, road, task.objective, task.run) for road in other_roads(task.road, range(count))]
    both = np.vstack([designs, task.space.start])
    runs = [dict(zip(task.names, evaluator.program.values(both, ride).T, strict=True)) for ride in rides]
    values = {name: np.stack([run[name] for run in runs]) for name in task.names if runs}
    return {name: rows[:, :-1] for name, rows in values.items()}, {name: rows[:, -1] for name, rows in values.items()}
