"""`pareto`: the front of two or three ride metrics over the free parameters of a vehicle, by exact gradients."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._progress import Progress
from jaxdamp._status import Status
from jaxdamp._types import Scalar
from jaxdamp.metrics import Metric, current_name
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import Ride, moves_axles, range_sentences
from jaxdamp.tune.filling import filled
from jaxdamp.tune.front import FrontParameter, ParetoFront, non_dominated
from jaxdamp.tune.objective import Function, Objective, objective_of
from jaxdamp.tune.ranges import search_range
from jaxdamp.tune.result import V
from jaxdamp.tune.side_by_side import BatchEvaluator, Lane
from jaxdamp.tune.step_notes import step_notes
from jaxdamp.tune.tracing import NO_CONFLICT, FrontProblem, Limit, range_of, trace_front
from jaxdamp.vehicles import AbstractVehicle


BEYOND = 0.1  # distance of the default reference point beyond the worst values, relative to their range


def pareto(
    objectives: Sequence[str | Metric | Function],
    vehicle: V,
    road: AbstractRoad | WhiteRoad,
    *,
    over: Sequence[str] | Mapping[str, Any] = ("damper*",),
    freeze: Sequence[str] = (),
    bounds: Mapping[str, Any] | None = None,
    tie: Mapping[str, str] | None = None,
    limits: Mapping[str, float] | None = None,
    metrics: Sequence[str | Metric] = (),
    points: int = 21,
    between: int = 0,
    reference: Mapping[str, float] | None = None,
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
        road: as in `minimise`.
        over: as in `minimise`.
        freeze: as in `minimise`.
        bounds: as in `minimise`.
        tie: as in `minimise`.
        limits: hard limits `{metric: largest value}`; points that violate one are left out.
        metrics: further metrics, which functions and limits can use by name.
        points: number of points; of three objectives the largest triangular number that is not above it.
        between: number of further designs with parameters interpolated between those points. They are simulated without
            derivatives, and fill the front at little cost where it is smooth.
        reference: the point up to which the hypervolume counts, `{objective: value}`; 10 % of the range of each
            objective beyond its worst value on the front if left out.
        duration: length of the run [s], as in `simulate`.
        dt: step [s], as in `simulate`.
        max_steps: largest number of steps of each search.
        progress: called with the number of points done and of all points; a line in the terminal if it is left out.

    Returns:
        The designs with all metrics, without those that another one beats.

    Raises:
        ValueError: a number of objectives other than two or three, or two with the same name; what `minimise` refuses.

    >>> from jaxdamp import roads, vehicles
    >>> car = vehicles.presets.quarter_car_000()
    >>> front = pareto(["rms_sprung_acceleration", "rms_dynamic_tyre_load"], car, roads.white("C", 20.0), points=5)
    >>> [round(float(rate), -1) for rate in front.designs[[0, -1], 0]]  # the two optima: 4656.4 and 5536.5
    [4660.0, 5540.0]
    """
    chosen = _objectives(objectives, vehicle, road, metrics, limits, points, max_steps)
    names = tuple(one.name for one in chosen)
    every = tuple(dict.fromkeys(m for one in chosen for m in one.metrics))
    known = [m.name for m in every]
    limits = {current_name(name, known): float(top) for name, top in (limits or {}).items()}
    space = search_range(vehicle, over, freeze, bounds, tie)

    def ride_of(vehicle: AbstractVehicle) -> Ride:
        return Ride(vehicle, road, metrics=every, duration=duration, dt=dt)

    ride = ride_of(vehicle)
    many = ride.side_by_side()
    follows = ride.road is not None and moves_axles(space.free.build, space.free.values)

    def values_of(vehicle: AbstractVehicle) -> dict[str, Scalar]:
        found = (many.on_axles_of(vehicle) if follows else many.of_vehicle(vehicle))()
        for one in chosen:
            found = one.of(found)
        return found

    units = {name: unit for one in chosen for name, unit in one.units(vehicle).items()}
    order = [*names, *limits, *(n for n in units if n not in names and n not in limits)]
    evaluator = BatchEvaluator(values_of, space, order, len(names) + len(limits), ride.derivatives)
    (start,) = evaluator.at(space.start[None] / space.unit)
    before = dict(zip(order, map(float, start.values), strict=True))
    if not np.all(np.isfinite(start.values)):
        remedy = "Call `simulate` with this road; its error messages explain the cause."
        _checks.refuse("vehicle", "have finite metrics to start from", before, remedy)
    size = np.abs(start.values[: len(names)]) + np.finfo(float).tiny
    tops = [Limit(top, abs(top) or abs(before[name]) or 1.0) for name, top in limits.items()]
    problem = FrontProblem(evaluator, space, len(names), tops, max_steps, size)
    with Progress("Tracing the front") as shown:

        def report(done: int, total: int) -> None:
            if progress is not None:
                progress(done, total)
            else:
                shown(f"{done} of {total} points, {evaluator.points} designs simulated")

        lanes = trace_front(problem, start, points, report)
    kept, status, notes = _judged(lanes, problem, limits)
    designs = np.array([np.clip(lane.at * space.unit, space.lower, space.upper) for lane in kept])
    table = np.array([lane.now.values for lane in kept])
    values = {name: table[:, order.index(name)] for name in units}
    worst = table[:, : len(names)].max(axis=0) + BEYOND * np.ptp(table[:, : len(names)], axis=0)
    free = zip(space.free.names, space.free.owners, space.start, space.lower, space.upper, strict=True)
    front = ParetoFront[V](
        start=vehicle,
        names=names,
        values=values,
        before={name: before[name] for name in units},
        units=units,
        parameters=tuple(FrontParameter(n, p.unit, float(a), float(b), float(c)) for n, p, a, b, c in free),
        designs=designs,
        limits=limits,
        reference=dict(zip(names, map(float, worst), strict=True)) | _reference(reference, names),
        warnings=tuple(notes),
        status=status,
        evaluations=evaluator.points,
        interpolated=0,
        dropped=len(lanes) - len(kept),
        free=space.free,
        ride=ride,
        objective=chosen,
    )
    if between and len(front) > len(names):
        front = filled(front, lambda designs: evaluator.values_at(designs), order, between)
    coarse = [] if isinstance(road, WhiteRoad) else _notes_on_steps(front, ride_of)
    return dataclasses.replace(front, warnings=(*notes, *coarse))


def _objectives(
    objectives: Any,
    vehicle: Any,
    road: Any,
    metrics: Sequence[str | Metric],
    limits: Mapping[str, float] | None,
    points: int,
    max_steps: int,
) -> tuple[Objective, ...]:
    """The objectives, after checks of the arguments."""
    call = "pareto([metric, metric], vehicle, road)"
    if isinstance(objectives, str) or not isinstance(objectives, Sequence) or len(objectives) not in (2, 3):
        _checks.refuse(
            "objectives", "be a list of two or three", _checks.described(objectives), f"The call is `{call}`."
        )
    for i, one in enumerate(objectives):
        if not isinstance(one, str | Metric) and not callable(one):
            must = "be the name of a ride metric, a Metric, or a function of the metrics"
            _checks.refuse(f"objectives[{i}]", must, _checks.described(one))
    check_module("vehicle", vehicle, (AbstractVehicle,), call)
    check_module("road", road, (AbstractRoad, WhiteRoad), call)
    least = 3 * (len(objectives) - 1)  # the ends and one point between them
    if points < least:
        _checks.refuse("points", f"be {least} or more for {len(objectives)} objectives", points)
    if max_steps < 1:
        _checks.refuse("max_steps", "be 1 or more", max_steps)
    more = [*metrics, *(one for one in objectives if isinstance(one, Metric))]
    names = [m.name for m in (*vehicle.ride_metrics, *(m for m in more if isinstance(m, Metric)))]
    limited = [current_name(name, names) for name in limits or {}]
    chosen = tuple(objective_of(one, vehicle, more, limited, white=isinstance(road, WhiteRoad)) for one in objectives)
    if len({one.name for one in chosen}) < len(chosen):
        remedy = "Functions need different names: use `def` instead of `lambda`."
        _checks.refuse("objectives", "have different names", [one.name for one in chosen], remedy)
    return chosen


def _reference(reference: Mapping[str, float] | None, names: Sequence[str]) -> dict[str, float]:
    """The given part of the reference point."""
    given = {current_name(name, names): float(value) for name, value in (reference or {}).items()}
    for name in given:
        _checks.one_of("reference", name, names)
    return given


def _judged(
    lanes: Sequence[Lane], problem: FrontProblem, limits: Mapping[str, float]
) -> tuple[list[Lane], Status, list[str]]:
    """The points of the front in the order of the first objective, how the searches ended, and doubts in words."""
    count, space = problem.objectives, problem.space
    excess = np.stack([problem.excess(lane) for lane in lanes])
    worst = excess.max(axis=1, initial=-np.inf)
    notes = []
    allowed = [lane for lane, beyond in zip(lanes, worst, strict=True) if beyond <= problem.evaluator.tolerance.limit]
    if not allowed:
        nearest = int(np.argmin(worst))
        values = dict(zip(limits, lanes[nearest].now.values[count:], strict=False))
        missed = [n for n, x in zip(limits, excess[nearest], strict=True) if x > problem.evaluator.tolerance.limit]
        notes = [
            f"The limit {n} <= {limits[n]:.4g} is not met: {values[n]:.4g}. Relax it, or free more." for n in missed
        ]
        return [lanes[nearest]], Status.LIMIT_NOT_MET, notes
    objectives = np.stack([lane.now.values[:count] for lane in allowed])
    kept = [lane for lane, best in zip(allowed, non_dominated(objectives), strict=True) if best]
    kept.sort(key=lambda lane: tuple(lane.now.values[:count]))
    span = range_of(lanes, problem) / np.maximum(np.abs(objectives).max(axis=0), np.finfo(float).tiny)
    if min(span) < NO_CONFLICT:
        notes.append("The objectives do not conflict: one design is the best in all of them, and there is no front.")
    failed = [lane for lane in kept if not lane.converged]
    status = Status.CONVERGED
    if failed:
        status = Status.STEP_LIMIT if any(lane.steps >= problem.max_steps for lane in failed) else Status.NO_BETTER_STEP
        notes.append(f"{len(failed)} of {len(kept)} points are not optima: {status.sentence}")
    sides = [space.side(lane.at * space.unit) for lane in kept]
    for name, column in zip(space.free.names, zip(*sides, strict=True), strict=True):
        for side in ("lower", "upper"):
            if side in column:
                notes.append(f"{name} is at its {side} bound at {column.count(side)} of {len(kept)} points.")
    return kept, status, notes


def _notes_on_steps(front: ParetoFront, ride_of: Callable[[AbstractVehicle], Ride]) -> list[str]:
    """Doubts about the step and the fitted ranges of the laws, at the ends and the knee of the front."""
    notes = {}
    for i in dict.fromkeys([0, front.knee, len(front) - 1]):
        vehicle = front.point(i)
        found = step_notes(front.start, vehicle, ride_of) or range_sentences(
            front.ride.on_axles_of(vehicle).range_use()
        )
        notes |= dict.fromkeys(f"Point {i}: {note}" for note in found)
    return list(notes)
