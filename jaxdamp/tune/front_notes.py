"""Which points belong to a front, how their searches ended, and warnings in words."""

from collections.abc import Mapping, Sequence

import numpy as np

from jaxdamp._status import Status
from jaxdamp.tune.front import ParetoFront, non_dominated
from jaxdamp.tune.searching import missed
from jaxdamp.tune.side_by_side import Lane
from jaxdamp.tune.smooth import exact_counterpart
from jaxdamp.tune.task import DesignTask
from jaxdamp.tune.tracing import NO_CONFLICT, FrontProblem, range_of
from jaxdamp.tune.wording import changes_of, missed_notes


def judged(lanes: Sequence[Lane], problem: FrontProblem) -> tuple[list[Lane], Status, list[str]]:
    """The points of the front in the order of the first objective, how the searches ended, and doubts in words."""
    count, task = problem.objectives, problem.evaluator.task
    space = task.space
    values = [dict(zip(task.names, map(float, lane.now.values), strict=True)) for lane in lanes]
    short = [missed(problem.limits, of_lane, task.tolerance) for of_lane in values]
    allowed = [lane for lane, limits in zip(lanes, short, strict=True) if not limits]
    if not allowed:
        beyond = [max(-limit.margin(v[limit.name]) for limit in s) for s, v in zip(short, values, strict=True)]
        nearest = int(np.argmin(beyond))
        design = np.clip(lanes[nearest].at * space.unit, space.lower, space.upper)
        notes = missed_notes(short[nearest], values[nearest], changes_of(space, design))
        return [lanes[nearest]], Status.LIMIT_NOT_MET, notes
    notes = []
    if len(allowed) < len(lanes):
        names = dict.fromkeys(limit.of for limits in short for limit in limits)
        notes.append(f"{len(lanes) - len(allowed)} searches ended beyond the limits of {', '.join(names)}: left out.")
    objectives = np.stack([lane.now.rows[:count] for lane in allowed])
    best = [lane for lane, is_best in zip(allowed, non_dominated(objectives), strict=True) if is_best]
    best.sort(key=lambda lane: tuple(lane.now.rows[:count]))
    span = range_of(lanes, count) / np.maximum(np.abs(objectives).max(axis=0), np.finfo(float).tiny)
    if min(span) < NO_CONFLICT:
        notes.append("The objectives do not conflict: one design is the best in all of them, and there is no front.")
    failed = [lane for lane in best if not lane.converged]
    status = Status.CONVERGED
    if failed:
        status = Status.STEP_LIMIT if any(lane.steps >= problem.max_steps for lane in failed) else Status.NO_BETTER_STEP
        notes.append(f"{len(failed)} of {len(best)} points are not optima: {status.sentence}")
    sides = [space.side(lane.at * space.unit) for lane in best]
    for name, column in zip(space.free.names, zip(*sides, strict=True), strict=True):
        for side in ("lower", "upper"):
            if side in column:
                notes.append(f"{name} is at its {side} bound at {column.count(side)} of {len(best)} points.")
    return best, status, notes


def notes_on_points(front: ParetoFront, task: DesignTask, start_on_fresh: Mapping[str, np.ndarray]) -> list[str]:
    """Limits that the points do not keep by their true values or on fresh roads; doubts about step and fitted ranges.

    The step and the ranges are looked at at the ends and the knee of the front.

    Arguments:
        front: the front.
        task: its task.
        start_on_fresh: the metrics of the start on the fresh roads, for relative limits.
    """
    notes = []
    exact = {m.name: other for m in task.objective.metrics if (other := exact_counterpart(m))}
    for name, allowed in task.allowed.items():
        lower, upper = allowed.at(front.before[name])
        if name in exact:
            true = front.values[exact[name].name]
            if beyond := int(np.sum(~((lower <= true) & (true <= upper)))):
                notes.append(f"{name} is limited, but the true {exact[name].name} is beyond at {beyond} points.")
        if front.fresh:
            fresh = front.fresh[name]
            ends = np.array([allowed.at(float(start)) for start in start_on_fresh[name]])
            above, below = fresh > ends[:, 1:], fresh < ends[:, :1]
            if (outside := above | below | np.isnan(fresh)).any():
                places = f"{int(outside.any(axis=0).sum())} of {len(front)} points"
                furthest = fresh.max() if above.any() else fresh.min()
                notes.append(
                    f"On {int(outside.any(axis=1).sum())} of {len(fresh)} fresh roads {name} is beyond its limit at "
                    f"{places}, up to {furthest:.4g}."
                )
    by_point: dict[str, None] = {}
    for i in dict.fromkeys([0, front.knee, len(front) - 1]):
        by_point |= dict.fromkeys(f"Point {i}: {note}" for note in task.notes_on_runs(front.point(i))[0])
    return [*notes, *by_point]
