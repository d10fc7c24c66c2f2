"""The course of a front: its ends, then the points between them, from coarse to fine."""

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp.tune.limits import Limit, limit_ends
from jaxdamp.tune.ranges import SearchRange
from jaxdamp.tune.side_by_side import LANES, RADIUS, BatchEvaluator, Computed, Lane, Scaling, solve_together
from jaxdamp.tune.starts import start_points
from jaxdamp.tune.task import DesignTask


FAR = 1e3  # aim of an objective that does not count, in units of its start
NO_CONFLICT = 1e-4  # range of an objective between the ends, relative to its size, below which there is no front
SCANNED = 128  # designs all over the bounds, simulated where peaks make many minima
ELSEWHERE = 0.3  # least distance of another start, relative to the coordinate of the start
ROUNDS = 3  # of comparing each search with the results of the others


class FrontProblem(NamedTuple):
    """What all searches of a front share."""

    evaluator: BatchEvaluator
    limits: list[Limit]
    max_steps: int
    size: np.ndarray  # of each objective at the start

    @property
    def objectives(self) -> int:
        """Number of objectives."""
        return len(self.size)

    def scaling(self, zero: np.ndarray, unit: np.ndarray) -> Scaling:
        """The scaling of objectives with this zero and unit.

        Limits are aimed at from just inside. Their unit shrinks with those of the objectives, relative to the start, so
        that no objective is worth their violation.
        """
        inside, ends = self.evaluator.task.tolerance.limit, limit_ends(self.limits)
        zeros = [end.sign * end.value - inside * end.scale for end in ends]
        scales = [end.scale * float(min(unit / self.size)) for end in ends]
        return Scaling(np.append(zero, zeros), np.append(unit, scales), self.objectives)


def trace_front(
    problem: FrontProblem,
    starts: np.ndarray,
    computed: Sequence[Computed],
    points: int,
    report: Callable[[int, int], None],
) -> list[Lane]:
    """The ends of the front, then the points between them, from coarse to fine.

    Arguments:
        problem: of the front.
        starts: coordinates of one or more starts, from each of which the ends are searched.
        computed: the numbers there.
        points: number of points of the front.
        report: called with the number of points done and of all points.
    """
    evaluator, _, max_steps, size = problem
    count = problem.objectives
    aims = np.where(np.eye(count, dtype=bool), 0.0, FAR)
    lanes = [Lane.begin(aim, at, now) for aim in aims for at, now in zip(starts, computed, strict=True)]
    grid = lattice(count, points)
    total = len(grid)

    def solve(chosen: Sequence[Lane], scaling: Scaling) -> None:
        done = sum(not lane.open for lane in lanes)
        solve_together(chosen, evaluator, scaling, max_steps, lambda: report(done, total))

    scaling = problem.scaling(np.zeros(count), size)
    solve(lanes, scaling)
    by_aim = (lanes[i * len(starts) : (i + 1) * len(starts)] for i in range(count))
    lanes = [min(several, key=lambda lane: scaling.merit(lane.now.rows, lane.aim)) for several in by_aim]
    scaling = _scaled_to(lanes, problem)
    for lane in lanes:  # once more, with the accuracy relative to the range of the front
        lane.open, lane.steps, lane.radius = True, 0, max(lane.radius, 0.1 * RADIUS)
    solve(lanes, scaling)
    if min(range_of(lanes, count) / size) < NO_CONFLICT:
        return lanes
    scaling = _scaled_to(lanes, problem)
    ends = np.stack([scaling.of(lane.now.rows)[:count] for lane in lanes])
    places, left = [*np.eye(count)], [place for place in grid if place.max() < 1.0]
    while left:
        new = _farthest(places, left, min(len(places), LANES))
        begun = _predicted(lanes, places, new, evaluator.task.space)
        at_new = evaluator.at(np.stack(begun))
        near = [lanes[int(np.argmin(np.linalg.norm(np.array(places) - place, axis=1)))] for place in new]
        opened = [lane.neighbour(p @ ends, at, c) for lane, p, at, c in zip(near, new, begun, at_new, strict=True)]
        solve(opened, scaling)
        lanes, places = lanes + opened, places + new
        report(len(lanes), total)
    if _has_peaks(evaluator.task):
        others = _from_elsewhere(lanes, evaluator, scaling)
        solve(others, scaling)
        for lane, other in zip(lanes, others, strict=True):
            if scaling.merit(other.now.rows, lane.aim) < scaling.merit(lane.now.rows, lane.aim) - evaluator.improvement:
                lane.at, lane.now, lane.curvature = other.at, other.now, other.curvature
                lane.converged = other.converged
    for _ in range(ROUNDS):
        improved = _restarted(lanes, scaling, 10.0 * evaluator.improvement)
        if not improved:
            break
        solve(improved, scaling)
    return lanes


def _has_peaks(task: DesignTask) -> bool:
    """Whether an objective or a limit is the largest or smallest value over time, so that there are many minima."""
    by_name = {metric.name: metric for metric in task.objective.metrics}
    followed = [by_name[name] for name in (*task.objective.names, *task.allowed) if name in by_name]
    return any(term.reduction.value in ("largest", "smallest") for m in followed for term in m.statistic.terms)


def _from_elsewhere(lanes: Sequence[Lane], evaluator: BatchEvaluator, scaling: Scaling) -> list[Lane]:
    """For each search another one with its aim, from the best of designs all over the bounds that is not near it."""
    space = evaluator.task.space
    points = start_points(space, SCANNED + 1, 0)[1:]
    rows = evaluator.rows_at(points)
    points = points[np.all(np.isfinite(rows), axis=1)] / space.unit
    rows = rows[np.all(np.isfinite(rows), axis=1)]
    begun = []
    for lane in lanes:
        merits = np.array([scaling.merit(row, lane.aim) for row in rows])
        merits[np.abs(points - lane.at).max(axis=1) < ELSEWHERE] = np.inf
        begun.append(points[int(np.argmin(merits))] if np.isfinite(merits).any() else lane.at)
    computed = evaluator.at(np.stack(begun))
    return [Lane.begin(lane.aim, at, now) for lane, at, now in zip(lanes, begun, computed, strict=True)]


def range_of(lanes: Sequence[Lane], objectives: int) -> np.ndarray:
    """Difference between the worst and the best value of each objective."""
    return np.ptp(np.stack([lane.now.rows[:objectives] for lane in lanes]), axis=0)


def _scaled_to(lanes: Sequence[Lane], problem: FrontProblem) -> Scaling:
    """Objectives from 0 at their best to 1 at their worst value among the ends of the front."""
    best = np.stack([lane.now.rows[: problem.objectives] for lane in lanes]).min(axis=0)
    least = NO_CONFLICT * np.abs(best) + np.finfo(float).tiny
    return problem.scaling(best, np.maximum(range_of(lanes, problem.objectives), least))


def lattice(count: int, points: int) -> list[np.ndarray]:
    """Evenly spaced shares of the ends of the front, which add up to one."""
    parts = points - 1
    if count == 3:
        parts = int((np.sqrt(8 * points + 1) - 3) / 2)
    rows = itertools.product(range(parts + 1), repeat=count)
    return [np.array(row) / parts for row in rows if sum(row) == parts]


def _farthest(places: list[np.ndarray], left: list[np.ndarray], count: int) -> list[np.ndarray]:
    """Take those places out of `left` that are farthest from all others."""
    taken: list[np.ndarray] = []
    while left and len(taken) < count:
        away = np.linalg.norm(np.array(left)[:, None] - np.array(places + taken)[None], axis=2).min(axis=1)
        taken.append(left.pop(int(np.argmax(away))))
    return taken


def _predicted(
    lanes: Sequence[Lane], places: list[np.ndarray], new: list[np.ndarray], space: SearchRange
) -> list[np.ndarray]:
    """Coordinates of new points, interpolated between those of the solved ones."""
    from scipy.interpolate import RBFInterpolator

    known, values = np.array(places)[:, :-1], np.stack([lane.at for lane in lanes])
    kernel = "cubic" if len(known) > known.shape[1] + 1 else "linear"
    predicted = RBFInterpolator(known, values, kernel=kernel)(np.array(new)[:, :-1])
    return list(np.clip(predicted, space.lower / space.unit, space.upper / space.unit))


def _restarted(lanes: Sequence[Lane], scaling: Scaling, least: float) -> list[Lane]:
    """The searches for whose aim the result of another one is better by `least` or more, restarted from there."""
    merits = np.array([[scaling.merit(other.now.rows, lane.aim) for other in lanes] for lane in lanes])
    results = [(lane.at, lane.now, lane.curvature.copy()) for lane in lanes]
    improved = []
    for i, (lane, best) in enumerate(zip(lanes, merits.argmin(axis=1), strict=True)):
        if merits[i, best] < merits[i, i] - least:
            lane.at, lane.now, lane.curvature = results[best][0], results[best][1], results[best][2].copy()
            lane.open, lane.steps, lane.radius = True, 0, RADIUS
            improved.append(lane)
    return improved
