"""The course of a front: its ends, then the points between them, from coarse to fine."""

import dataclasses
import functools
import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp.solve import Evaluation, Scaling, SearchState, SequentialQuadratic
from jaxdamp.tune.limits import Limit, limit_ends
from jaxdamp.tune.measuring import LANES
from jaxdamp.tune.ranges import SearchRange, start_points
from jaxdamp.tune.task import DOUBLE, DesignTask, Evaluator
from jaxdamp.vehicles import AbstractVehicle


RADIUS = 0.5  # of the trust region of a search that goes on from another result
FAR = 1e9  # aim of an objective that does not count, in units of its start
NO_CONFLICT = 1e-4  # range of an objective between the ends, relative to its size, below which there is no front
SCANNED = 128  # designs all over the bounds, simulated where peaks make many minima
ELSEWHERE = 0.3  # least distance of another start, relative to the coordinate of the start
SHARE = 1e-4  # of the sum of the objectives: excludes points that others beat in one of them
ROUNDS = 3  # of comparing each search with the results of the others


class FrontProblem(NamedTuple):
    """What all searches of a front share."""

    evaluator: Evaluator
    limits: list[Limit]
    max_steps: int
    size: np.ndarray  # of each objective at the start
    report: Callable[[int, int], None]  # the number of points done and of all points

    @property
    def objectives(self) -> int:
        """Number of objectives."""
        return len(self.size)

    @property
    def improvement(self) -> float:
        """That a search may leave at its end, relative to the range of the objectives."""
        return 1e-6 if self.evaluator.task.tolerance == DOUBLE else 1e-3

    def solver(self, zero: np.ndarray, unit: np.ndarray) -> SequentialQuadratic:
        """The solver for objectives with this zero and unit.

        Limits are aimed at from just inside. Their unit shrinks with those of the objectives, relative to the start, so
        that no objective is worth their violation.
        """
        inside, ends = self.evaluator.task.tolerance.limit, limit_ends(self.limits)
        zeros = [end.sign * end.value - inside * end.scale for end in ends]
        scales = [end.scale * float(min(unit / self.size)) for end in ends]
        scaling = Scaling(np.append(zero, zeros), np.append(unit, scales), self.objectives)
        return SequentialQuadratic(self.evaluator.region, scaling, self.max_steps, self.improvement, share=SHARE)

    def solver_between(self, states: Sequence[SearchState]) -> SequentialQuadratic:
        """That for objectives from 0 at their best to 1 at their worst value among the ends of the front."""
        best = np.stack([state.evaluation.rows[: self.objectives] for state in states]).min(axis=0)
        least = NO_CONFLICT * np.abs(best) + np.finfo(float).tiny
        return self.solver(best, np.maximum(range_of(states, self.objectives), least))


def trace_front(
    problem: FrontProblem, starts: np.ndarray, evaluations: Sequence[Evaluation], points: int
) -> list[SearchState]:
    """The ends of the front, then the points between them, from coarse to fine."""
    evaluator, count, report = problem.evaluator, problem.objectives, problem.report
    grid = lattice(count, points)
    states, solver = _ends(problem, starts, evaluations, len(grid))
    if min(range_of(states, count) / problem.size) < NO_CONFLICT:
        return states
    ends = np.stack([solver.scaling.of(state.evaluation.rows)[:count] for state in states])
    places, left = [*np.eye(count)], [place for place in grid if place.max() < 1.0]
    while left:
        new = _farthest(places, left, min(len(places), LANES))
        begun = _predicted(states, places, new, evaluator.task.space)
        at_new = evaluator.at(np.stack(begun))
        near = [states[int(np.argmin(np.linalg.norm(np.array(places) - place, axis=1)))] for place in new]
        opened = [one.neighbour(p @ ends, y, e) for one, p, y, e in zip(near, new, begun, at_new, strict=True)]
        solver.solve(evaluator.at, opened, functools.partial(report, len(states), len(grid)))
        states, places = states + opened, places + new
        report(len(states), len(grid))
    if _has_peaks(evaluator.task):
        others = _from_elsewhere(states, evaluator, solver)
        solver.solve(evaluator.at, others)
        for state, other in zip(states, others, strict=True):
            gain = solver.merit(state.evaluation.rows, state.aim) - solver.merit(other.evaluation.rows, state.aim)
            if gain > problem.improvement:
                _take_over(state, other)
    for _ in range(ROUNDS):
        improved = _restarted(states, solver, 10.0 * problem.improvement)
        if not improved:
            break
        solver.solve(evaluator.at, improved)
    return states


def _ends(
    problem: FrontProblem, starts: np.ndarray, evaluations: Sequence[Evaluation], total: int
) -> tuple[list[SearchState], SequentialQuadratic]:
    """The searches of the ends of the front, and the solver for the points between them."""
    count, evaluate = problem.objectives, problem.evaluator.at
    solver = problem.solver(np.zeros(count), problem.size)
    aims = np.where(np.eye(count, dtype=bool), 0.0, FAR)
    several = [[solver.init(aim, y, e) for y, e in zip(starts, evaluations, strict=True)] for aim in aims]
    states = [state for group in several for state in group]

    def report() -> None:
        problem.report(sum(not state.open for state in states), total)

    solver.solve(evaluate, states, report)
    states = [min(group, key=lambda one: solver.merit(one.evaluation.rows, one.aim)) for group in several]
    solver = problem.solver_between(states)
    for state in states:  # once more, with the accuracy relative to the range of the front
        state.reopened(max(state.radius, 0.1 * RADIUS))
    solver.solve(evaluate, states, report)
    return states, problem.solver_between(states)


def _has_peaks(task: DesignTask[AbstractVehicle]) -> bool:
    """Whether an objective or a limit is the largest or smallest value over time, so that there are many minima."""
    by_name = {metric.name: metric for metric in task.objective.metrics}
    followed = [by_name[name] for name in (*task.objective.names, *task.allowed) if name in by_name]
    return any(term.reduction.value in ("largest", "smallest") for m in followed for term in m.statistic.terms)


def _from_elsewhere(
    states: Sequence[SearchState], evaluator: Evaluator, solver: SequentialQuadratic
) -> list[SearchState]:
    """For each search another one with its aim, from the best of designs all over the bounds that is not near it."""
    space = evaluator.task.space
    points = start_points(space, SCANNED + 1, 0)[1:] / space.unit
    rows = evaluator.only_rows(points)
    points, rows = points[np.all(np.isfinite(rows), axis=1)], rows[np.all(np.isfinite(rows), axis=1)]
    begun = []
    for state in states:
        merits = np.array([solver.merit(row, state.aim) for row in rows])
        merits[np.abs(points - state.y).max(axis=1) < ELSEWHERE] = np.inf
        begun.append(points[int(np.argmin(merits))] if np.isfinite(merits).any() else state.y)
    evaluations = evaluator.at(np.stack(begun))
    return [solver.init(state.aim, y, e) for state, y, e in zip(states, begun, evaluations, strict=True)]


def _take_over(state: SearchState, other: SearchState) -> None:
    """Put the result of another search in the place of that of this one."""
    state.y, state.evaluation, state.curvature = other.y, other.evaluation, other.curvature.copy()
    state.converged = other.converged


def range_of(states: Sequence[SearchState], objectives: int) -> np.ndarray:
    """Difference between the worst and the best value of each objective."""
    return np.ptp(np.stack([state.evaluation.rows[:objectives] for state in states]), axis=0)


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
    states: Sequence[SearchState], places: list[np.ndarray], new: list[np.ndarray], space: SearchRange
) -> list[np.ndarray]:
    """Coordinates of new points, interpolated between those of the solved ones."""
    from scipy.interpolate import RBFInterpolator

    solved, values = np.array(places)[:, :-1], np.stack([state.y for state in states])
    kernel = "cubic" if len(solved) > solved.shape[1] + 1 else "linear"
    predicted = RBFInterpolator(solved, values, kernel=kernel)(np.array(new)[:, :-1])
    return list(np.clip(predicted, space.lower / space.unit, space.upper / space.unit))


def _restarted(states: Sequence[SearchState], solver: SequentialQuadratic, least: float) -> list[SearchState]:
    """The searches for whose aim the result of another one is better by `least` or more, restarted from there."""
    merits = np.array([[solver.merit(other.evaluation.rows, state.aim) for other in states] for state in states])
    results = [dataclasses.replace(state) for state in states]
    improved = []
    for i, (state, best) in enumerate(zip(states, merits.argmin(axis=1), strict=True)):
        if merits[i, best] < merits[i, i] - least:
            _take_over(state, results[best])
            state.reopened(RADIUS)
            improved.append(state)
    return improved
