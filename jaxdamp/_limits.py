"""Limits and maxima with derivatives that do not depend on how they are compiled.

To differentiate, `jnp.maximum` and `jnp.max` compare their result with their arguments. A compiler may compute an
argument anew for that, round it otherwise, find none equal, and so lose the derivative. These compare the arguments.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, ArrayLike, Float


Numbers = Float[Array, "..."]
AnyNumbers = Float[ArrayLike, "..."]


@jax.custom_jvp
def at_least(numbers: AnyNumbers, least: AnyNumbers) -> Numbers:
    """The greater of both; equal ones share the derivative."""
    return jnp.maximum(numbers, least)


@jax.custom_jvp
def at_most(numbers: AnyNumbers, most: AnyNumbers) -> Numbers:
    """The lesser of both; equal ones share the derivative."""
    return jnp.minimum(numbers, most)


def within(numbers: AnyNumbers, least: AnyNumbers, most: AnyNumbers) -> Numbers:
    """Numbers kept between two limits."""
    return at_most(at_least(numbers, least), most)


def largest(numbers: Numbers, axis: int = 0) -> Numbers:
    """The maximum along an axis; of several equal numbers the first has the derivative."""
    first = jnp.argmax(numbers, axis, keepdims=True)
    return jnp.take_along_axis(numbers, first, axis).squeeze(axis)


def _slope_of_least(primals: tuple[Any, Any], tangents: tuple[Any, Any]) -> tuple[Numbers, Numbers]:
    ans = at_least(*primals)
    return ans, _shared(jnp.subtract(*primals), ans, tangents)


def _slope_of_most(primals: tuple[Any, Any], tangents: tuple[Any, Any]) -> tuple[Numbers, Numbers]:
    ans = at_most(*primals)
    return ans, _shared(jnp.subtract(*reversed(primals)), ans, tangents)


def _shared(lead: Numbers, ans: Numbers, changes: tuple[Any, Any]) -> Numbers:
    """The change of the one that leads, or the mean."""
    share = jnp.where(lead > 0, 1.0, jnp.where(lead < 0, 0.0, 0.5)).astype(ans.dtype)
    parts = zip((share, 1.0 - share), changes, strict=True)
    return sum((part * change for part, change in parts if type(change) is not SymbolicZero), jnp.zeros_like(ans))


at_least.defjvp(_slope_of_least, symbolic_zeros=True)
at_most.defjvp(_slope_of_most, symbolic_zeros=True)
