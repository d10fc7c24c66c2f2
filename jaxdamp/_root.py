"""Root of a scalar function that increases, with the derivative of the implicit function theorem."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from jaxdamp._types import Scalar


_FEW = 12  # steps that are taken without asking


def increasing_root(
    function: Callable[[Scalar], Scalar], guess: Scalar, lower: Scalar, upper: Scalar, steps: int = 12
) -> Scalar:
    """Solve function(w) = 0 by Newton steps kept inside a shrinking bracket.

    Newton lands exactly on piecewise-linear functions and converges quadratically on smooth ones. Where it would leave
    the bracket, or has not halved the residual in two steps (as when it cycles about a kink), the middle of the bracket
    is taken instead. A dozen steps reach rounding for power laws, friction and kinked laws in series with springs of
    1e5 to 1.5e7 N/m at 1 ms; they are all taken, which costs a batch less than to ask whether the last lane is done.
    Where more are allowed, the search ends when no lane moves. Derivatives, forward and reverse, come from the implicit
    function theorem and do not pass through the steps.

    Arguments:
        function: increasing on the bracket.
        guess: a first value inside the bracket.
        lower: where the function is not positive.
        upper: where the function is not negative.
        steps: number of Newton steps, at most.
    """

    def solve(f: Callable[[Scalar], Scalar], w: Scalar) -> Scalar:
        def narrow(_: Any, now: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
            w, low, high, last, before_last = now
            value, slope = jax.jvp(f, (w,), (jnp.ones_like(w),))
            low = jnp.where(value <= 0, w, low)
            high = jnp.where(value >= 0, w, high)
            newton = w - value / jnp.where(slope > 0, slope, 1.0)
            stalled = jnp.abs(value) > 0.5 * before_last
            inside = (newton >= low) & (newton <= high)
            # At the root rounding may point out of the bracket; its other end can be far away, and so its middle.
            small = jnp.abs(newton - w) <= 1e-6 * (high - low)
            good = (slope > 0) & (small | (inside & ~stalled))
            return jnp.where(good, newton, 0.5 * (low + high)), low, high, jnp.abs(value), last

        low, high = jax.lax.stop_gradient((lower, upper))
        never = jnp.full_like(w, jnp.inf)
        state = (w, low, high, never, never)
        if steps <= _FEW:
            return jax.lax.fori_loop(0, steps, narrow, state)[0]

        def going(now: tuple[Any, ...]) -> Bool[Array, ""]:
            count, moved, _ = now
            return moved & (count < steps)

        def again(now: tuple[Any, ...]) -> tuple[Any, ...]:
            count, _, state = now
            after = narrow(count, state)
            return count + 1, after[0] != state[0], after

        return jax.lax.while_loop(going, again, (0, True, state))[2][0]

    def tangent_solve(linear: Callable[[Scalar], Scalar], value: Scalar) -> Scalar:
        return value / linear(jnp.ones_like(value))

    return jax.lax.custom_root(function, jax.lax.stop_gradient(guess), solve, tangent_solve)
