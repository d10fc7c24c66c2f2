"""Levenberg-Marquardt for many small problems at once, by the rules of `search`.

Each problem has its own step size and ends by itself; those that have ended are not computed any more. The algebra
uses the products JᵀJ and Jᵀr, scaled to a unit diagonal, instead of the triangle of J: it is a hundred times less work,
and its rounding errors matter only for directions that the records do not determine.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from jaxdamp._status import Status
from jaxdamp.identify.lanes import Evaluation
from jaxdamp.identify.search import (
    AT_EDGE,
    FIRST_DAMPING,
    LARGEST_STEP_SIZE,
    LEAST_DAMPING,
    MOST_GROWTH,
    MOST_OF_THE_WAY,
    NEAR,
    SHORT,
    STEP_TOLERANCE,
    WORTHWHILE,
)
from jaxdamp.parameters import Bounds


Evaluate = Callable[[Float[np.ndarray, "problems free"], Int[np.ndarray, " some"]], Evaluation]


class LanesEnd(NamedTuple):
    """Where and how the searches ended."""

    y: Float[np.ndarray, "problems free"]
    gram: Float[np.ndarray, "problems columns columns"]
    status: list[Status]
    steps: Int[np.ndarray, " problems"]

    def of(self, problems: Int[np.ndarray, " some"]) -> "LanesEnd":
        """Those of some problems."""
        return LanesEnd(self.y[problems], self.gram[problems], [self.status[i] for i in problems], self.steps[problems])


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # points without finite forces are refused as steps
def search_lanes(
    evaluate: Evaluate,
    start: Float[np.ndarray, "problems free"],
    bounds: Bounds,
    samples: Float[np.ndarray, " problems"],
    max_steps: int,
    precision: float,
) -> LanesEnd:
    """Minimise the sum of squares of each problem; the steps and tolerances are those of `search`.

    Arguments:
        evaluate: products and conditions of some problems at the coordinates of all.
        start: coordinates to start from.
        bounds: limits of the coordinates, common to all problems.
        samples: number of samples of each problem.
        max_steps: largest number of points tried for each problem, including the start.
        precision: relative rounding error of the forces.
    """
    lower, upper = (np.asarray(side, np.float64) for side in bounds)
    y = np.clip(start, lower, upper)
    gram = evaluate(y, np.arange(len(y))).gram
    scale = np.sqrt(np.maximum(_diagonal(gram), 0.0))
    step_size, steps = np.ones(len(y)), np.ones(len(y), int)
    refused = np.zeros(len(y), bool)  # the last step
    ended: list[Status | None] = [None if np.all(np.isfinite(own)) else Status.NO_STEP for own in gram]
    rounding = 500 * precision

    def steps_of(some: Int[np.ndarray, " some"], step_size: Float[np.ndarray, " some"]) -> _Steps:
        step = _steps(gram[some], scale[some], step_size, lower - y[some], upper - y[some])
        floor = np.maximum(rounding, STEP_TOLERANCE**2 / samples[some]) * 0.5 * gram[some, -1, -1] + rounding**2
        short = np.all(np.abs(step) <= SHORT * (1e-3 + np.abs(y[some])), axis=1)
        return _Steps(step, _decrease(gram[some], step), floor, short)

    while True:
        open_ = np.array([i for i, status in enumerate(ended) if status is None and steps[i] < max_steps], int)
        if not open_.size:
            break
        chosen = steps_of(open_, step_size[open_])
        is_whole = ~refused[open_] & chosen.small
        if np.any(is_whole):
            whole = steps_of(open_, np.full(open_.size, LARGEST_STEP_SIZE))
            is_whole &= ~whole.small
            chosen = chosen.replaced(is_whole, whole)
        trial = y.copy()
        trial[open_] += chosen.step
        found = evaluate(trial, open_)
        steps[open_] += 1
        old, new = 0.5 * gram[open_, -1, -1], 0.5 * found.gram[open_, -1, -1]
        negligible = (chosen.predicted < chosen.floor) & (new - old < chosen.floor)
        ratio = (old - new) / np.where(chosen.predicted > 0, chosen.predicted, 1.0)
        accepted = found.keeps_conditions[open_] & (negligible | (ratio > WORTHWHILE))
        accepted &= np.all(np.isfinite(found.gram[open_]), axis=(1, 2))
        refused[open_] = ~accepted
        growth = np.maximum(1.0 / MOST_GROWTH, 1.0 - (2.0 * np.clip(ratio, -1e6, 2.0) - 1.0) ** 3)
        step_size[open_] /= np.where(accepted, growth, np.where(is_whole, 1.0, MOST_GROWTH))
        moved = open_[accepted]
        y[moved], gram[moved] = trial[moved], found.gram[moved]
        scale[moved] = np.maximum(scale[moved], np.sqrt(np.maximum(_diagonal(gram[moved]), 0.0)))
        again = open_[is_whole & ~accepted]
        while again.size:
            again = again[(step_size[again] < LARGEST_STEP_SIZE) & steps_of(again, step_size[again]).small]
            step_size[again] *= MOST_GROWTH
        for i, done in zip(open_, negligible | chosen.short, strict=True):
            ended[i] = Status.CONVERGED if done else None
    at_edge = (np.abs(y - lower) < AT_EDGE) & (y != lower)
    if np.any(at_edge):
        y = np.where(at_edge, lower, y)
        edged = np.flatnonzero(np.any(at_edge, axis=1))
        gram[edged] = evaluate(y, edged).gram[edged]
    return LanesEnd(y, gram, [status or Status.STEP_LIMIT for status in ended], steps)


class _Steps(NamedTuple):
    """Steps of some problems, and what decides whether a search ends by them."""

    step: Float[np.ndarray, "some free"]
    predicted: Float[np.ndarray, " some"]  # decrease of half the sum of squares
    floor: Float[np.ndarray, " some"]  # of a decrease that counts
    short: Bool[np.ndarray, " some"]

    @property
    def small(self) -> Bool[np.ndarray, " some"]:
        """Whether the search would end; true of steps that are not finite."""
        return ~(self.predicted >= self.floor) | self.short

    def replaced(self, where: Bool[np.ndarray, " some"], others: "_Steps") -> "_Steps":
        """These, but some of the others."""
        pairs = zip(self, others, strict=True)
        return _Steps(*(np.where(where[:, None] if a.ndim > 1 else where, b, a) for a, b in pairs))


def _diagonal(gram: np.ndarray) -> np.ndarray:
    return np.diagonal(gram, axis1=1, axis2=2)[:, :-1]


def _decrease(gram: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Predicted decrease of half the sum of squares over a step."""
    linear = np.einsum("ij,ij->i", gram[:, :-1, -1], step)
    return -linear - 0.5 * np.einsum("ij,ijk,ik->i", step, gram[:, :-1, :-1], step)


def _steps(
    gram: Float[np.ndarray, "problems columns columns"],
    scale: Float[np.ndarray, "problems free"],
    step_size: Float[np.ndarray, " problems"],
    lower: Float[np.ndarray, "problems free"],
    upper: Float[np.ndarray, "problems free"],
) -> Float[np.ndarray, "problems free"]:
    """The damped steps within the limits: what would leave them is put on the nearer one, and the rest solved again."""
    lower, upper = (np.where(np.abs(a) > NEAR, MOST_OF_THE_WAY * a, a) for a in (lower, upper))
    scale = np.where(scale > 0, scale, 1.0)
    damping = np.maximum(FIRST_DAMPING / np.maximum(step_size, np.finfo(float).tiny), LEAST_DAMPING)
    matrix = gram[:, :-1, :-1] / (scale[:, :, None] * scale[:, None, :])
    matrix = matrix + damping[:, None, None] * np.eye(scale.shape[1])
    target = -gram[:, :-1, -1] / scale
    held, at = np.zeros(scale.shape, bool), np.zeros(scale.shape)
    while True:
        step = _solved(matrix, target, held, at * scale) / scale
        outside = ~held & ((step < lower) | (step > upper))
        if not np.any(outside):
            return np.clip(step, lower, upper)
        held, at = held | outside, np.where(outside, np.clip(step, lower, upper), at)


def _solved(matrix: np.ndarray, target: np.ndarray, held: Bool[np.ndarray, "..."], at: np.ndarray) -> np.ndarray:
    """Solutions with some unknowns held."""
    at = np.where(held, at, 0.0)
    target = np.where(held, at, target - np.einsum("ijk,ik->ij", matrix, at))
    either = held[:, :, None] | held[:, None, :]
    matrix = np.where(either, np.eye(matrix.shape[1]) * held[:, :, None], matrix)
    return np.linalg.solve(matrix, target[:, :, None])[:, :, 0]
