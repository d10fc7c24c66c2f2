"""Travel with reversals and its direction, for laws with hysteresis."""

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
