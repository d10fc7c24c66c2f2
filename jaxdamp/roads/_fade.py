"""Smooth rises from nothing to one, shared by events and by roads that must start on level ground."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._limits import within
from jaxdamp._types import Scalar, Signal


def raised_cosine(fraction: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """S(s) = (1 - cos(pi s))/2 for 0 <= s <= 1, 0 before and 1 after; continuous with its slope."""
    return 0.5 * (1.0 - jnp.cos(jnp.pi * within(fraction, 0.0, 1.0)))


def quintic_step(fraction: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """S(s) = s^3 (10 - 15 s + 6 s^2) for 0 <= s <= 1, 0 before and 1 after; continuous with slope and curvature.

    Its steepest slope is 15/8 and its largest curvature 10/sqrt(3), against pi/2 and pi^2/2 of the raised cosine.
    """
    s = within(fraction, 0.0, 1.0)
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def fade_in(time: Signal, ramp: float) -> Signal | Scalar:
    """The factor that lets a road begin at height and slope zero: S(t/ramp), or 1 throughout if `ramp` [s] is zero."""
    return raised_cosine(time / ramp) if ramp else jnp.ones((), time.dtype)
