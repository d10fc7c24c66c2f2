"""Steps of state equations that laws share: travel with reversals, a first-order lag, the SDIRK method."""

import math
from collections.abc import Callable
from typing import TypeVar

import jax.numpy as jnp

from jaxdamp._types import Scalar, ScalarLike


def travels(v0: ScalarLike, v1: ScalarLike, dt: ScalarLike) -> tuple[Scalar, Scalar]:
    """Signed travel [m] before and after the reversal, for a velocity linear over the step; all after if there is none.

    Both are continuous in v₀ and v₁; their sum is the net travel dt (v₀ + v₁)/2.
    """
    reverses = v0 * v1 < 0
    change = jnp.where(reverses, v0 - v1, 1.0)
    before = jnp.where(reverses, 0.5 * dt * v0 * v0 / change, 0.0)
    return before, 0.5 * dt * (v0 + v1) - before


def direction(travel: ScalarLike) -> Scalar:
    """+1 or −1; +1 at zero, so that |travel| = direction · travel has a one-sided slope there."""
    return jnp.where(travel >= 0, 1.0, -1.0)


def follow(now: ScalarLike, before: ScalarLike, after: ScalarLike, dt: ScalarLike, time: ScalarLike) -> Scalar:
    """State y of τ ẏ + y = u after a step over which u is linear from `before` to `after`, exact for any τ > 0."""
    z = dt / time
    decay = jnp.exp(-z)
    mean = -jnp.expm1(-z) / z
    return decay * now + (mean - decay) * before + (1.0 - mean) * after


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
