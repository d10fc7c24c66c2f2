"""A continuous piecewise-linear curve as a sum of hinges; without a search for the segment, it is fast inside loops."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._smooth import ramp
from jaxdamp._types import Scalar, ScalarLike


def hinges(v: ScalarLike, knots: Float[Array, " knots"], slopes: Float[Array, " knots+1"], width: ScalarLike) -> Scalar:
    """s₀ v + Σ (sₖ − sₖ₋₁) max(v − vₖ, 0), shifted so that it is zero at v = 0; knees rounded over `width`."""
    if jnp.ndim(v):
        remedy = "For several use `jax.vmap(law.force_velocity)(velocities)`."
        _checks.refuse("v", "be one velocity", f"of shape {jnp.shape(v)}", remedy)

    def curve(v: ScalarLike) -> Scalar:
        return slopes[0] * v + jnp.sum(jnp.diff(slopes) * ramp(v - knots, width))

    return curve(v) - curve(jnp.zeros((), slopes.dtype))
