"""A long sum of cosines at equally spaced frequencies, without computing every cosine."""

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Signal


# Samples handled at a time: bounds the memory whatever the length of the record.
_BLOCK = 1024


def cosine_sum(
    cycles: Signal, amplitude: Float[Array, " lines"], phase: Float[Array, " lines"], *, first: int
) -> Signal:
    """Sum_j a_j cos(2 pi (first + j) u + phase_j), j = 0, 1, ..., at each u in `cycles`.

    With c_j = a_j exp(i phase_j) and j = m p + q this is the real part of sum_p exp(2 pi i (first + m p) u) sum_q
    c_pq exp(2 pi i q u). The inner sum is a matrix product and only about 2 sqrt(lines) complex exponentials per
    sample remain; the result is that of the plain sum to rounding.
    """
    columns = math.ceil(math.sqrt(amplitude.size))
    rows = math.ceil(amplitude.size / columns)
    padding = (0, rows * columns - amplitude.size)
    real = jnp.pad(amplitude * jnp.cos(phase), padding).reshape(rows, columns).T
    imaginary = jnp.pad(amplitude * jnp.sin(phase), padding).reshape(rows, columns).T
    matrix = jnp.block([[real, imaginary], [-imaginary, real]])
    inner = 2.0 * jnp.pi * jnp.arange(columns, dtype=cycles.dtype)
    outer = 2.0 * jnp.pi * (first + columns * jnp.arange(rows, dtype=cycles.dtype))

    def at(u: Signal) -> Signal:
        fine, coarse = u[:, None] * inner[None, :], u[:, None] * outer[None, :]
        sums = jnp.concatenate([jnp.cos(fine), jnp.sin(fine)], axis=1) @ matrix
        return jnp.sum(jnp.concatenate([jnp.cos(coarse), -jnp.sin(coarse)], axis=1) * sums, axis=1)

    cycles = cycles - jnp.floor(cycles)
    if cycles.size <= _BLOCK:
        return at(cycles)
    blocks = math.ceil(cycles.size / _BLOCK)
    block = math.ceil(cycles.size / blocks)
    cycles_in_blocks = jnp.pad(cycles, (0, blocks * block - cycles.size)).reshape(blocks, block)
    return jax.lax.map(jax.checkpoint(at), cycles_in_blocks).reshape(-1)[: cycles.size]
