"""Vectorised elementary functions of float64 for loops over many cars.

On a CPU, XLA computes the logarithm and the power without vector instructions, and also 1/√x on processors without
AVX-512: 4 to 15 ns, while a square root takes 0.7 ns (`python -m benchmarks.functions`). These functions consist of
operations that are vectorised on all processors.

Each has a custom derivative, and its value is differentiable too: where reverse mode passes through a loop, `lax.scan`
stores the value and loses the custom derivative, so that second derivatives are those of the code of the value.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from jaxdamp._limits import Numbers, at_least
from jaxdamp._types import ScalarLike
from jaxdamp.configuration import target


_MANTISSA_BITS = 52
_ONE, _SQUARE_ROOT_OF_HALF = np.array([1.0, math.sqrt(0.5)]).view(np.int64)
_LOGARITHM_TERMS, _EXPONENTIAL_TERMS = 11, 14  # of the series below, whose remainders are then 1e-18
_WHOLE = 1.5 * 2.0**52  # added to a whole number, it leaves it in the last bits
_LN2, _LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10  # their sum; whole multiples of the first are exact


def power(base: ScalarLike, exponent: ScalarLike) -> Numbers:
    """baseⁿ for base ≥ 0, with finite derivatives at zero."""
    base = at_least(base, 1e-30)
    if target().library_powers:
        return _library_power(base, jnp.asarray(exponent, base.dtype))
    return exponential(exponent * logarithm(base))


@jax.custom_jvp
def _library_power(base: Numbers, exponent: Numbers) -> Numbers:
    return base**exponent


@_library_power.defjvp
def _library_power_slope(
    primals: tuple[Numbers, Numbers], tangents: tuple[Numbers, Numbers]
) -> tuple[Numbers, Numbers]:
    (base, exponent), (change, bend) = primals, tangents
    y = _library_power(base, exponent)
    return y, y * (exponent / base * change + jnp.log(base) * bend)  # JAX's own rule takes two more powers


@jax.custom_jvp
def exponential(x: Numbers) -> Numbers:
    """eˣ to a few roundings, from e⁻⁷⁰⁰ to e⁷⁰⁰: 2ᵏ eʳ, |r| ≤ ½ ln 2."""
    if x.dtype != jnp.float64:
        return jnp.exp(x)
    x = jnp.where(x > 700.0, 700.0, jnp.where(x < -700.0, -700.0, x))
    if target().library_functions:
        return jnp.exp(x)
    twos = jnp.round(x * (1.0 / math.log(2.0)))
    r = x - twos * _LN2 - twos * _LN2_LOW
    series = jnp.zeros_like(r)
    for k in reversed(range(_EXPONENTIAL_TERMS)):
        series = series * r + 1.0 / math.factorial(k)
    bits = _ONE - (jax.lax.bitcast_convert_type(twos + _WHOLE, jnp.int64) << _MANTISSA_BITS)
    # A quotient, by 2⁻ᵏ: XLA would compute a product again for each use.
    return series / jax.lax.bitcast_convert_type(bits, jnp.float64)


@exponential.defjvp
def _exponential_slope(primals: tuple[Numbers], tangents: tuple[Numbers]) -> tuple[Numbers, Numbers]:
    y = exponential(primals[0])
    return y, y * tangents[0]


@jax.custom_jvp
def logarithm(x: Numbers) -> Numbers:
    """Natural logarithm of numbers from 2.3e-308 to 6e307, to a few roundings.

    k ln 2 + 2 artanh((m − 1)/(m + 1)) with x = 2ᵏ m, ½ ≤ m² < 2.
    """
    if x.dtype != jnp.float64 or target().library_functions:
        return jnp.log(x)
    bits = jax.lax.bitcast_convert_type(x, jnp.int64)
    twos = (bits - _SQUARE_ROOT_OF_HALF) >> _MANTISSA_BITS
    # From the bits only the power of two, a constant: x · 2⁻ᵏ is exact and has a slope, m by its bits would have none.
    m = x * jax.lax.bitcast_convert_type(_ONE - (twos << _MANTISSA_BITS), jnp.float64)
    s = (m - 1.0) / (m + 1.0)
    series = jnp.zeros_like(s)
    for k in reversed(range(_LOGARITHM_TERMS)):
        series = series * (s * s) + 1.0 / (2 * k + 1)
    return twos.astype(jnp.int32).astype(jnp.float64) * math.log(2.0) + 2.0 * s * series


@logarithm.defjvp
def _logarithm_slope(primals: tuple[Numbers], tangents: tuple[Numbers]) -> tuple[Numbers, Numbers]:
    (x,), (change,) = primals, tangents
    return logarithm(x), change / x


def reciprocal_root(x: Float[ArrayLike, "..."]) -> Numbers:
    """1/√x of positive numbers; its derivative, −½ x^(−3/2), takes neither a root nor a quotient."""
    return _reciprocal_root(jnp.asarray(x))


@jax.custom_jvp
def _reciprocal_root(x: Numbers) -> Numbers:
    return jax.lax.rsqrt(x) if target().reciprocal_roots else jnp.sqrt(x) / x


@_reciprocal_root.defjvp
def _reciprocal_root_slope(primals: tuple[Numbers], tangents: tuple[Numbers]) -> tuple[Numbers, Numbers]:
    (x,), (change,) = primals, tangents
    root = _reciprocal_root(x)
    return root, (-0.5 * root * root * root) * change


def algebraic_sigmoid(x: Float[ArrayLike, "..."]) -> Numbers:
    """x/√(1+x²), from −1 to 1; its derivative, (1+x²)^(−3/2), takes neither a root nor a quotient."""
    return _algebraic_sigmoid(jnp.asarray(x))


@jax.custom_jvp
def _algebraic_sigmoid(x: Numbers) -> Numbers:
    return x * _reciprocal_root(1.0 + x * x)


@_algebraic_sigmoid.defjvp
def _algebraic_sigmoid_slope(primals: tuple[Numbers], tangents: tuple[Numbers]) -> tuple[Numbers, Numbers]:
    (x,), (change,) = primals, tangents
    root = _reciprocal_root(1.0 + x * x)
    return x * root, root * root * root * change
