"""The two-stage SDIRK method: second order, L-stable."""

import math
from collections.abc import Callable
from typing import TypeVar

from jaxdamp._types import ScalarLike


GAMMA = 1.0 - 1.0 / math.sqrt(2.0)

Y = TypeVar("Y")
Rate = TypeVar("Rate")


def sdirk2(
    stage: Callable[[ScalarLike, Y, ScalarLike], Rate],
    moved: Callable[[Rate, Y, ScalarLike], Y],
    start: Y,
    dt: ScalarLike,
) -> Y:
    """States after a step dt [s] of Y' = f(t, Y), of which each stage solves one implicit equation.

    Arguments:
        stage: (share, Y, duration) to the rate that, held for the duration from Y, ends where it is the rate at that
            share of the step: k = f(t₀ + share · dt, Y + duration · k).
        moved: (rate, Y, duration) to the states after moving at a rate.
        start: states at the beginning of the step.
        dt: [s].
    """
    implicit, explicit = GAMMA * dt, (1.0 - GAMMA) * dt
    halfway = moved(stage(GAMMA, start, implicit), start, explicit)
    return moved(stage(1.0, halfway, implicit), halfway, implicit)
