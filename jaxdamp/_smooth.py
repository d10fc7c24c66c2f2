"""Smooth approximations of kinks with a given width, so that every law has a finite slope everywhere."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jaxdamp._limits import at_least
from jaxdamp._types import ScalarLike


def smooth_abs(v: Float[ArrayLike, "..."], width: ScalarLike) -> Float[Array, "..."]:
    """√(v² + w²) − w: zero at zero, |v| − w far away; exactly |v| for width 0."""
    v = jnp.asarray(v)
    safe = jnp.where(width > 0, width, 1.0)
    return jnp.where(width > 0, jnp.sqrt(v * v + safe * safe) - safe, jnp.abs(v))


def ramp(v: Float[ArrayLike, "..."], width: ScalarLike) -> Float[Array, "..."]:
    """max(v, 0), its knee rounded over `width` [unit of v]: w ln(1 + exp(v/w)); exact for width 0.

    The error is largest at the knee, w ln 2.
    """
    v = jnp.asarray(v)
    exact = at_least(v, 0.0)
    safe = jnp.where(width > 0, width, 1.0)
    return jnp.where(width > 0, safe * jax.nn.softplus(v / safe), exact)
