"""Which points belong to a front, how their searches ended, and warnings in words."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxdamp._status import Status
from jaxdamp.solve import SearchState
from jaxdamp.tune.descending import missed
from jaxdamp.tune.front import ParetoFront, non_dominated
from jaxdamp.tune.limits import Limit
from jaxdamp.tune.objective import exact_counterpart
from jaxdamp.tune.task import DesignTask
from jaxdamp.tune.tracing import NO_CONFLICT, FrontProblem, range_of
from jaxdamp.tune.wording import changes_of, missed_notes


def judged(states: Sequence[SearchState], problem: FrontProblem) -> tuple[list[SearchState], Status, list[str]]:
    """The points of the front in the order of the first objective, how the searches ended, and doubts in words."""
    count, task = problem.objectives, problem.evaluator.task
    values = [task.numbers(state.evaluation.values) for state in states]
    short = [missed(problem.limits, of_state, task.tolerance) for of_state in values]
    allowed = [state for state, limits in zip(states, short, strict=True) if not limits]
    if not allowed:
        return _nearest(states, values, short, task)
    notes = []
    if len(allowed) < len(states):
        names = dict.fromkeys(limit.of for limits in short for limit in limits)
        notes.append(f"{len(states) - len(allowed)} searches ended beyond the limits of {', '.join(names)}: left out.")
    objectives = np.stack([state.evaluation.rows[:count] for state in allowed])
    best = [state for state, is_best in zip(allowed, non_dominated(objectives), strict=True) if is_best]
    best.sort(key=lambda state: tuple(state.evaluation.rows[:count]))
    span = range_of(states, count) / np.maximum(np.abs(objectives).max(axis=0), np.finfo(float).tiny)
    if min(span) < NO_CONFLICT:
        notes.append("The objectives do not conflict: one design is the best in all of them, and there is no front.")
    failed = [state for state in best if not state.converged]
    status = Status.CONVERGED
    if failed:
        status = Status.STEP_LIMIT if any(s.steps >= problem.max_steps for s in failed) else Status.NO_BETTER_STEP
        notes.append(f"{len(failed)} of {len(best)} points are not optima: {status.sentence}")
    return best, status, [*notes, *_at_bounds(best, task)]


def _nearest(
    states: Sequence[SearchState],
    values: Sequence[Mapping[str, float]],
    short: Sequence[Sequence[Limit]],
    task: DesignTask[Any],
) -> tuple[list[SearchState], Status, list[str]]:
    """Where no search met the limits: the point that is nearest to them."""
    beyond = [max(-limit.margin(v[limit.name]) for limit in s) for s, v in zip(short, values, strict=True)]
    i, space = int(np.argmin(beyond)), task.space
    design = np.clip(states[i].y * space.unit, space.lower, space.upper)
    return [states[i]], Status.LIMIT_NOT_MET, missed_notes(short[i], values[i], changes_of(space, design))


def _at_bounds(best: Sequence[SearchState], task: DesignTask[Any]) -> list[str]:
    """A sentence for each parameter at a bound."""
    sides, notes = [task.space.side(state.y * task.space.unit) for state in best], []
    for name, column in zip(task.space.free.names, zip(*sides, strict=True), strict=True):
        for side in ("lower", "upper"):
            if side in column:
                notes.append(f"{name} is at its {side} bound at {column.count(side)} of {len(best)} points.")
    return notes


def notes_on_points(front: ParetoFront, task: DesignTask[Any], start_on_fresh: Mapping[str, np.ndarray]) -> list[str]:
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
