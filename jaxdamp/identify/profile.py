"""Standard errors checked by moving a parameter, since linear estimates are wrong if the sum of squares is no parabola.

Example: the slope above a knee that the records do not reach seems certain as long as the knee is fixed; if the knee
may move, any slope fits. If a fit is doubtful, each parameter that seems certain is therefore moved away in growing
steps, and all others are fitted again at each step.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp.dampers import keeps_conditions
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd, search
from jaxdamp.solve import BoundedLevenbergMarquardt


STEPS = 15  # of each search; an incomplete search makes an error smaller, never larger
LOOSE = BoundedLevenbergMarquardt(tolerance=0.1)  # standard errors: 0.01 in chi-square
MOST_STEPS = 250  # of all searches together; parameters after that have their linear errors
CHI_SQUARE = 9.0  # increase up to which a moved parameter still fits: three standard errors
GROWTH = 4.0  # of the distance, from one step to the next


class Profile(NamedTuple):
    """Errors of parameters from moving them away from a minimum."""

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
    """Standard errors that are also valid away from the minimum.

    A parameter at a distance d from its value should increase chi-square by (d/error)². If the other parameters can
    compensate so that the increase is less than `CHI_SQUARE`, the error is at least d over the root of the increase, or
    d if there is hardly any increase.

    Arguments:
        problem: the problem that was minimised.
        found: the minimum.
        errors: standard errors from the Jacobian.
        far: largest distance to try for each parameter, or three standard errors if these are more.
        chosen: the parameters to move.
        variance: variance of the noise of a weighted sample.
    """
    wide, open_ended, left = errors.copy(), np.zeros(errors.shape, bool), MOST_STEPS
    sides = [(int(i), side) for i in np.flatnonzero(chosen & (errors > 0)) for side in (-1.0, 1.0)]
    for i, side in sides:
        distance, end = np.sqrt(CHI_SQUARE) * errors[i], found
        most = max(far[i], distance)
        while distance <= most and left > 0:
            moved = moved_to(problem, end, i, found.values[i] + side * distance)
            if moved is None:
                break
            end = search(moved, STEPS, held=i, solver=LOOSE)
            left -= end.steps
            rise = (end.squares - found.squares) / variance
            if not rise < CHI_SQUARE:
                break
            wide[i] = max(wide[i], distance / np.sqrt(max(rise, 1.0)))
            open_ended[i] |= distance == far[i]
            distance = min(GROWTH * distance, most) if distance < most else np.inf
    return Profile(wide, open_ended)


def moved_to(problem: Problem, end: SearchEnd, index: int, value: float) -> Problem | None:
    """The problem from the end of another search, with one value changed; `None` if the law refuses this value."""
    lower, upper = problem.free.limits()
    values = end.values.copy()
    values[index] = value
    moved = problem.started_at(values)
    inside = lower[index] < value < upper[index] and keeps_conditions(moved.free.tree)
    return moved if inside else None
