"""The two-stage SDIRK method: second order, L-stable."""

import math
from collections.abc import Callable
from typing import TypeVar


GAMMA = 1.0 - 1.0 / math.sqrt(2.0)  # fraction of the step over which each stage is implicit

Y = TypeVar("Y")
Rate = TypeVar("Rate")


def sdirk2(stage: Callable[[float, Y], Rate], moved: Callable[[Rate, Y, float], Y], start: Y) -> Y:
    """States after a step dt of Y' = f(t, Y); each stage solves one implicit equation.

    Arguments:
        stage: (share, Y) to the rate k with k = f(t₀ + share · dt, Y + γ dt k).
        moved: (k, Y, part) to the states Y + part · dt k.
        start: states at the beginning of the step.
    """
    halfway = moved(stage(GAMMA, start), start, 1.0 - GAMMA)
    return moved(stage(1.0, halfway), halfway, GAMMA)
