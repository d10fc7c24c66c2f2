"""Random numbers that depend on the seed only: the same in single and double precision, alone or in a batch.

JAX draws different bits for different floating-point types. Here 64 bits are drawn for every number, by the default
generator of JAX (Threefry-2x32, the same on every device), and converted to the precision in use. In double precision
the numbers are those of `jax.random`.
"""

import math
import warnings
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.random import threefry_2x32
from jaxtyping import Array, Float, UInt32

from jaxdamp import _checks
from jaxdamp._forked import refuse_fork


_MASK = 0xFFFFFFFF
_FEWEST = 2.0**-54  # probability taken for zero, where the normal distribution has no finite value


def uniform(seed: int | Array, shape: tuple[int, ...], high: float = 1.0) -> Float[Array, "..."]:
    """Numbers between 0 and `high`, with 52 random bits, rounded to the precision in use.

    Arguments:
        seed: a whole number, or a JAX random key.
        shape: of the result.
        high: the upper end.

    Raises:
        ValueError: a seed that is neither.
    """
    return _fraction(*_bits(seed, shape), high)


def normal(seed: int | Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
    """Numbers of the standard normal distribution; arguments as those of `uniform`."""
    return _normal(*_bits(seed, shape))


def normal_at(seed: int | Array, stream: int, places: UInt32[Array, "..."]) -> Float[Array, "..."]:
    """Numbers of the standard normal distribution by their place in a stream, so that a part can be drawn alone.

    Arguments:
        seed: as in `uniform`.
        stream: number of one of several independent sequences.
        places: in the sequence.
    """
    pairs = jnp.concatenate([jnp.full(places.size, stream, jnp.uint32), places.ravel()])
    drawn = threefry_2x32(_words(seed), pairs)
    return _normal(*(half.reshape(places.shape) for half in jnp.split(drawn, 2)))


@jax.jit
def _normal(upper: UInt32[Array, "..."], lower: UInt32[Array, "..."]) -> Float[Array, "..."]:
    if jnp.asarray(0.0, float).dtype == jnp.float64:
        least = np.nextafter(-1.0, 0.0)
        return math.sqrt(2.0) * jax.lax.erf_inv(jnp.maximum(2.0 * _fraction(upper, lower) + least, least))
    # in single precision the tails need the probability that is left, not one that is nearly 1
    negative = upper >> 31 == 0
    carried = lower >> 12 == 0
    left = _fraction(~upper + carried.astype(jnp.uint32), (~(lower >> 12) + 1) << 12)
    probability = jnp.where(negative, _fraction(upper, lower), left)
    size = -jax.scipy.special.ndtri(jnp.maximum(probability, _FEWEST))
    return jnp.where(negative, -size, size)


@jax.jit
def rayleigh(above: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Sizes r of mean square 1 with the Rayleigh distribution, from the probability exp(-r^2) of a larger one.

    With a phase phi of its own r (cos phi, sin phi) are two independent normal numbers of variance 1/2.
    """
    return jnp.sqrt(-jnp.log(jnp.clip(above, _FEWEST, 1.0)))


def sobol_points(seed: int, variables: int, first: int, count: int) -> np.ndarray:
    """Consecutive points of a scrambled Sobol sequence, shape (count, variables)."""
    from scipy.stats import qmc

    options: dict[str, Any] = {"seed": np.random.default_rng(seed)}  # SciPy 1.15 calls it `rng`, and still takes this
    sequence = qmc.Sobol(variables, **options)
    if first:
        sequence.fast_forward(first)
    with warnings.catch_warnings(action="ignore"):  # that the number of points is no power of two
        return sequence.random(max(count, 1))[:count]


def sign(seed: int | Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
    """1 or −1 with equal probability; arguments as those of `uniform`."""
    return jnp.where(_bits(seed, shape)[0] >> 31 == 0, 1.0, -1.0).astype(float)


@jax.jit
def _fraction(upper: UInt32[Array, "..."], lower: UInt32[Array, "..."], high: float = 1.0) -> Float[Array, "..."]:
    """The first 52 of 64 bits as a number from 0 to `high`."""
    return high * (upper.astype(float) * 2.0**-32 + (lower >> 12).astype(float) * 2.0**-52)


def _bits(seed: int | Array, shape: tuple[int, ...]) -> tuple[UInt32[Array, "..."], UInt32[Array, "..."]]:
    """64 random bits for each number, as the upper and the lower half."""
    return _halves(_words(seed), shape)


@jax.jit(static_argnames="shape")
def _halves(words: UInt32[Array, "2"], shape: tuple[int, ...]) -> tuple[UInt32[Array, "..."], UInt32[Array, "..."]]:
    place = jnp.arange(math.prod(shape), dtype=jnp.uint32)
    upper, lower = jnp.split(threefry_2x32(words, jnp.concatenate([jnp.zeros_like(place), place])), 2)
    return upper.reshape(shape), lower.reshape(shape)


def _words(seed: int | Array) -> UInt32[Array, "2"]:
    """The two words of the key of `jax.random.key(seed)`, or of a key, also one of the old kind (two words)."""
    refuse_fork()
    if isinstance(seed, jax.Array):
        if jnp.issubdtype(seed.dtype, jax.dtypes.prng_key):
            words = jax.random.key_data(seed)
            return words if words.shape == (2,) else jax.random.bits(seed, (2,), "uint32")
        if seed.shape == (2,):
            return seed.astype(jnp.uint32)
    concrete = _checks.concrete(seed)
    kind = seed.dtype if concrete is None and isinstance(seed, jax.Array) else np.asarray(concrete).dtype
    if np.ndim(seed) or not jnp.issubdtype(kind, jnp.integer):
        _checks.refuse("seed", "be a whole number or a JAX random key", repr(seed), "Pass `seed=1`.")
    if concrete is not None:
        number = int(concrete)
        # with its type named, JAX takes an array over as it is, without a program
        return jnp.asarray(np.array([number >> 32 & _MASK, number & _MASK], dtype=np.uint32), np.uint32)
    traced = jnp.asarray(seed)
    if traced.dtype.itemsize == 8:
        upper = (traced >> 32).astype(jnp.uint32)
    else:
        upper = jnp.where(traced < 0, jnp.uint32(_MASK), jnp.uint32(0))
    return jnp.stack([upper, traced.astype(jnp.uint32)])
