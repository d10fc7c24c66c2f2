"""Standard errors tested by moving a parameter: a linear estimate fails where the sum of squares is no parabola.

A slope above a knee that the records do not show looks certain as long as the knee stays where it is; let the knee
move, and any slope fits. So where something about a fit is doubtful, each number that looks certain is moved away, in
growing steps, while all others are fitted again at each.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp.dampers import keeps_conditions
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd, search


STEPS = 15  # of each search; one cut short makes an error smaller, never larger
TOLERANCE = 0.1  # standard errors that the last step of a search moves: 0.01 of chi-square
MOST_STEPS = 250  # of all searches together, after which the linear errors stand for the numbers left
CHI_SQUARE = 9.0  # increase up to which a moved parameter still fits: three standard errors
GROWTH = 4.0  # of the distance, from one step to the next


class Profile(NamedTuple):
    """What moving numbers away from a minimum tells of them."""

    errors: Float[np.ndarray, " free"]  # at least the linear standard errors
    open_ended: Bool[np.ndarray, " free"]  # numbers that fit nearly as well at the largest distance tried


def profile(
    problem: Problem,
    found: SearchEnd,
    errors: Float[np.ndarray, " free"],
    far: Float[np.ndarray, " free"],
    chosen: Bool[np.ndarray, " free"],
    variance: float,
) -> Profile:
    """Standard errors that also hold away from the minimum.

    A number that is d away from its value should raise the chi-square by (d/error)². Where all others can make up for
    it so that it rises by less than `CHI_SQUARE`, the error is at least d over the root of the rise, or d if it hardly
    rises.

    Arguments:
        problem: what was minimised.
        found: the minimum.
        errors: standard errors from the Jacobian.
        far: the largest distance to try of each number, or three standard errors if those are more.
        chosen: which numbers to move.
        variance: of the noise of a weighted sample.
    """
    wide, open_ended, left = errors.copy(), np.zeros(errors.shape, bool), MOST_STEPS
    sides = [(int(i), side) for i in np.flatnonzero(chosen & (errors > 0)) for side in (-1.0, 1.0)]
    for i, side in sides:
        distance, end = np.sqrt(CHI_SQUARE) * errors[i], found
        most = max(far[i], distance)
        while distance <= most and left > 0:
            moved = _moved(problem, end, i, found.values[i] + side * distance)
            if moved is None:
                break
            end = search(moved, STEPS, held=i, tolerance=TOLERANCE)
            left -= end.steps
            rise = (end.squares - found.squares) / variance
            if not rise < CHI_SQUARE:
                break
            wide[i] = max(wide[i], distance / np.sqrt(max(rise, 1.0)))
            open_ended[i] |= distance == far[i]
            distance = min(GROWTH * distance, most) if distance < most else np.inf
    return Profile(wide, open_ended)


def _moved(problem: Problem, end: SearchEnd, index: int, value: float) -> Problem | None:
    """The problem started where another search ended, with one value changed; `None` if the law forbids that."""
    lower, upper = problem.free.limits()
    values = end.values.copy()
    values[index] = value
    moved = problem.started_at(values)
    inside = lower[index] < value < upper[index] and keeps_conditions(moved.free.tree)
    return moved if inside else None
