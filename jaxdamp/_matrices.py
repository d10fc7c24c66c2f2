"""Functions of small matrices that can run for many vehicles side by side.

The routines of LAPACK that JAX calls for a batch of matrices wait for threads of the pool that they run in themselves,
and two of them at a time can wait for ever. What a sweep may compute for each of its points must not call them.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Inexact

from jaxdamp._sharded import varying_as


_HALVINGS = 20
_TERMS = 13  # of the Taylor series at a norm of one half or less: its rest is below 1e-16


@jax.jit
def solve(matrix: Inexact[Array, "n n"], right: Inexact[Array, " n *columns"]) -> Inexact[Array, " n *columns"]:
    """X of A X = B for a small regular matrix, by elimination with row exchange; differentiable in both."""
    matrix, right = varying_as((matrix, right))
    if matrix.shape[0] == 1:
        return right / matrix.reshape((1,) * right.ndim)

    def times(x: Array) -> Array:
        return matrix @ x

    return jax.lax.custom_linear_solve(
        times, right, lambda _, b: _eliminate(matrix, b), lambda _, b: _eliminate(matrix.T, b)
    )


def _eliminate(matrix: Array, right: Array) -> Array:
    """Gauss-Jordan elimination: in step k, the largest entry left in column k comes into row k."""
    n = matrix.shape[0]
    rows = jnp.concatenate([matrix, right.reshape(n, -1)], axis=1)
    numbers = jnp.arange(n)

    def taken(values: Array, k: Array, axis: int) -> Array:
        return jax.lax.dynamic_index_in_dim(values, k, axis, keepdims=False, allow_negative_indices=False)

    def put(values: Array, row: Array, k: Array) -> Array:
        return values.at[k].set(row, mode="promise_in_bounds", wrap_negative_indices=False)

    def step(k: Array, rows: Array) -> Array:
        column = taken(rows, k, 1)
        pivot = jnp.argmax(jnp.where(numbers >= k, jnp.abs(column), -1.0))
        chosen = taken(rows, pivot, 0)
        chosen = chosen / taken(chosen, k, 0)
        rows = put(rows, taken(rows, k, 0), pivot)
        return put(rows - taken(rows, k, 1)[:, None] * chosen[None], chosen, k)

    return jax.lax.fori_loop(0, n, step, rows)[:, n:].reshape(right.shape)


def phi_functions(z: Inexact[Array, "n n"]) -> tuple[Inexact[Array, "n n"], ...]:
    """φ₀ = eᶻ, φ₁ = (eᶻ − 1)/z, φ₂ = (φ₁ − 1)/z and φ₃ = (φ₂ − ½)/z of a matrix, by Taylor series and doublings.

    φ₀(2z) = φ₀², φ₁(2z) = φ₁ (φ₀ + 1)/2, φ₂(2z) = (φ₁² + 2 φ₂)/4, φ₃(2z) = (φ₁ φ₂ + φ₂ + 2 φ₃)/8, from z/2ˢ. The
    number s of doublings is chosen from the norm of z; the loops have a fixed length, so that batches and derivatives
    pass through. Valid up to a norm of 2¹⁹.
    """
    one = varying_as(jnp.eye(z.shape[0], dtype=z.dtype), z)
    norm = jax.lax.stop_gradient(jnp.max(jnp.sum(jnp.abs(z), axis=0)))
    count = jnp.clip(jnp.ceil(jnp.log2(jnp.maximum(norm, 1e-3))) + 1.0, 0.0, _HALVINGS)
    small = z * 2.0**-count

    def nest(series: Array, divisor: Array) -> tuple[Array, None]:
        return one + small @ series / divisor, None

    series, _ = jax.lax.scan(nest, one, jnp.arange(_TERMS + 3.0, 3.0, -1.0, dtype=z.dtype))
    bend = series / 6.0
    ramp = 0.5 * one + small @ bend
    held = one + small @ ramp

    def double(now: tuple[Array, ...], number: Array) -> tuple[tuple[Array, ...], None]:
        phi, held, ramp, bend = now
        twice = (
            phi @ phi,
            0.5 * (held @ phi + held),
            0.25 * (held @ held) + 0.5 * ramp,
            0.125 * (held @ ramp + ramp) + 0.25 * bend,
        )
        return tuple(jnp.where(number < count, new, old) for new, old in zip(twice, now, strict=True)), None

    start = (one + small @ held, held, ramp, bend)
    functions, _ = jax.lax.scan(double, start, jnp.arange(_HALVINGS, dtype=z.dtype))
    return functions
