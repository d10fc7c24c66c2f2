"""Limits and maxima with derivatives that do not depend on how they are compiled.

The derivatives of `jnp.maximum` and `jnp.max` compare the result with the arguments. A compiler may compute an argument
again for this, with different rounding, so that none is equal and the derivative is lost. The functions here compare
the arguments. When differentiated, their value is selected by the same comparison, so that second derivatives are right
too (see `jaxdamp._elementary` on loops that lose custom derivatives).
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, ArrayLike, Float

from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.codegen import is_printing_vectors


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
    """Numbers limited to between two values."""
    return at_most(at_least(numbers, least), most)


def largest(numbers: Numbers, axis: int = 0) -> Numbers:
    """The maximum along an axis; of several equal numbers the first has the derivative."""
    first = jnp.argmax(numbers, axis, keepdims=True)
    return jnp.take_along_axis(numbers, first, axis).squeeze(axis)


def between_numbers(number: Scalar, least: Scalar, most: Scalar) -> Scalar:
    """As `within`, in fewer operations: without a derivative at limits, which are not NaN unless the number is."""
    return jnp.where(number < least, least, jnp.where(number > most, most, number))


def _selected(
    select: Callable[[Numbers, Numbers], Numbers],
    values: tuple[Numbers, Numbers],
    leading: tuple[Numbers, Numbers],
    changes: tuple[Numbers, Numbers],
) -> tuple[Numbers, Numbers]:
    """The selected value, the first where `leading` decreases, and its change; for equal values the mean of both."""
    lead = leading[0] - leading[1]
    one, other = (jnp.asarray(value, lead.dtype) for value in values)
    if is_printing_vectors():  # for the steps of a search: no second derivatives, and a slope of either side will do
        ans, share = select(one, other), jnp.where(leading[0] > leading[1], 1.0, 0.0)
    else:
        ans = jnp.where(lead > 0, one, jnp.where(lead < 0, other, 0.5 * one + 0.5 * other))
        share = jnp.where(lead > 0, 1.0, jnp.where(lead < 0, 0.0, 0.5))
    parts = zip((share, 1.0 - share), changes, strict=True)
    terms = (part.astype(ans.dtype) * change for part, change in parts if type(change) is not SymbolicZero)
    return ans, sum(terms, jnp.zeros_like(ans))


at_least.defjvp(lambda values, changes: _selected(jnp.maximum, values, values, changes), symbolic_zeros=True)
at_most.defjvp(lambda values, changes: _selected(jnp.minimum, values, values[::-1], changes), symbolic_zeros=True)


def root(power: Numbers, order: int = 2) -> Numbers:
    """The square root or fourth root of numbers that are not negative, with a derivative of zero at zero.

    Numbers that are slightly negative by rounding count as zero; NaN stays NaN.
    """
    zero = power <= 0.0
    positive = jnp.where(zero, jnp.ones_like(power), power)
    for _ in range(order // 2):  # order 2 or 4
        positive = jnp.sqrt(positive)
    return jnp.where(zero, jnp.zeros_like(power), positive)


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
