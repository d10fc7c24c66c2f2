"""Root of a scalar function that increases, with the derivative of the implicit function theorem."""

from collections.abc import Callable

import jax
import jax.numpy as jnp

from jaxdamp._types import Scalar


def increasing_root(
    function: Callable[[Scalar], Scalar], guess: Scalar, lower: Scalar, upper: Scalar, steps: int = 8
) -> Scalar:
    """Solve function(w) = 0 by Newton steps kept inside a shrinking bracket.

    The number of steps is fixed, so that a batch costs no more than its slowest member and the loop is one fused
    kernel. Newton lands exactly on piecewise-linear functions and converges quadratically on smooth ones; a step that
    would leave the bracket is replaced by its middle. Derivatives, forward and reverse, come from the implicit
    function theorem and do not pass through the steps.

    Arguments:
        function: increasing on the bracket.
        guess: a first value inside the bracket.
        lower, upper: where the function is not positive and not negative.
        steps: number of Newton steps.
    """

    def solve(f: Callable[[Scalar], Scalar], w: Scalar) -> Scalar:
        def narrow(_: int, now: tuple[Scalar, Scalar, Scalar]) -> tuple[Scalar, Scalar, Scalar]:
            w, low, high = now
            value, slope = jax.jvp(f, (w,), (jnp.ones_like(w),))
            low = jnp.where(value <= 0, w, low)
            high = jnp.where(value >= 0, w, high)
            newton = w - value / jnp.where(slope > 0, slope, 1.0)
            inside = (slope > 0) & (newton >= low) & (newton <= high)
            return jnp.where(inside, newton, 0.5 * (low + high)), low, high

        low, high = jax.lax.stop_gradient((lower, upper))
        return jax.lax.fori_loop(0, steps, narrow, (w, low, high), unroll=steps <= 16)[0]

    def tangent_solve(linear: Callable[[Scalar], Scalar], value: Scalar) -> Scalar:
        return value / linear(jnp.ones_like(value))

    return jax.lax.custom_root(function, jax.lax.stop_gradient(guess), solve, tangent_solve)
