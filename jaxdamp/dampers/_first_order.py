"""The exact step of a first-order lag."""

import jax.numpy as jnp

from jaxdamp._types import Scalar, ScalarLike


def follow(now: ScalarLike, before: ScalarLike, after: ScalarLike, dt: ScalarLike, time: ScalarLike) -> Scalar:
    """State y of τ ẏ + y = u after a step over which u is linear from `before` to `after`, exact for any τ > 0."""
    z = dt / time
    decay = jnp.exp(-z)
    mean = -jnp.expm1(-z) / z
    return decay * now + (mean - decay) * before + (1.0 - mean) * after
