"""Losses that spikes hardly move, by the weights that they give residuals, and what these leave of the noise."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp.identify.problem import Problem, Robust


FEWEST = 50  # samples of each record, from which on it has a mean influence of its own
LEAST_SLOPE = 0.05  # of the influence, relative to the weight: far samples of a redescending loss say nothing


class Loss(NamedTuple):
    """A loss by its weights; u is the residual in robust standard deviations."""

    weight: Callable[[np.ndarray], np.ndarray]  # ψ(u)/u
    slope: Callable[[np.ndarray], np.ndarray]  # ψ'(u)
    value: Callable[[np.ndarray], np.ndarray]  # twice the integral of ψ


LOSSES = {
    "squares": Loss(np.ones_like, np.ones_like, np.square),
    "huber": Loss(
        lambda u: np.minimum(1.0, 1.345 / np.maximum(np.abs(u), 1e-9)),
        lambda u: (np.abs(u) < 1.345).astype(float),
        lambda u: np.where(np.abs(u) < 1.345, u**2, 1.345 * (2.0 * np.abs(u) - 1.345)),
    ),
    "soft_l1": Loss(
        lambda u: (1.0 + (u / 1.5) ** 2) ** -0.5,
        lambda u: (1.0 + (u / 1.5) ** 2) ** -1.5,
        lambda u: 2.0 * 1.5**2 * ((1.0 + (u / 1.5) ** 2) ** 0.5 - 1.0),
    ),
    "student_t": Loss(
        lambda u: 5.0 / (4.0 + u**2),
        lambda u: 5.0 * (4.0 - u**2) / (4.0 + u**2) ** 2,
        lambda u: 5.0 * np.log1p(u**2 / 4.0),
    ),
}
"""Huber's loss and the soft absolute value have 95 % of the efficiency of least squares with normal noise, Student's t
with four degrees of freedom a little less, and it ignores far samples altogether."""


def unit_of(
    missed: Float[np.ndarray, " samples"], problem: Problem, loss: str, spread: float | None
) -> Float[np.ndarray, " samples"]:
    """The robust standard deviation of each residual, if it is unknown: of its record where each has its own noise."""
    if loss == "squares" or spread:
        return np.full(missed.shape, 1.0 if loss == "squares" else spread)
    unit = np.full(missed.shape, 1.4826 * np.median(np.abs(missed[problem.used])))
    for i in np.unique(problem.owner[problem.used]) if problem.each else ():
        rows = problem.owner == i
        unit[rows] = 1.4826 * np.median(np.abs(missed[rows & problem.used])) or unit[rows]
    return unit


def robust_of(
    loss: Loss, relative: Float[np.ndarray, " samples"], used: Bool[np.ndarray, " samples"], owner: np.ndarray
) -> Robust:
    """How the errors follow from the weighted residuals, by the mean influence in each record if none is short."""
    groups = [np.flatnonzero(used & (owner == i)) for i in np.unique(owner[used])]
    each = len(groups) > 1 and min(map(len, groups)) >= FEWEST
    factor, root = np.ones(relative.size), np.ones(relative.size)
    for rows in groups if each else [np.flatnonzero(used)]:
        u = relative[rows]
        weight = loss.weight(u)
        slope = max(float(np.mean(loss.slope(u))), LEAST_SLOPE * float(np.mean(weight)))
        root[rows] = np.sqrt(slope / np.mean(weight))
        shown = float(np.mean(weight * u * u))
        factor[rows] = np.sqrt(np.mean((weight * u) ** 2) / slope / shown) if shown > 0 else 1.0
    return Robust(factor, root, each)
