"""Root of a scalar function that increases, with the derivative of the implicit function theorem."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from jaxdamp._types import Scalar
from jaxdamp.configuration import fuses_loops


_FEW = 3  # steps that are taken without asking


def increasing_root(
    function: Callable[[Scalar], Scalar], guess: Scalar, lower: Scalar, upper: Scalar, steps: int = 12
) -> Scalar:
    """Solve function(w) = 0 by Newton steps kept inside a shrinking bracket.

    Newton lands exactly on piecewise-linear functions and converges quadratically on smooth ones. Where it would leave
    the bracket, or has not halved the residual in two steps (as when it cycles about a kink), the middle of the bracket
    is taken instead. A dozen steps reach rounding for power laws, friction and kinked laws in series with springs of
    1e5 to 1.5e7 N/m at 1 ms, from any guess. The first few are taken without asking, the others until no lane of a
    batch moves by more than 1e-7 of itself. Derivatives, forward and reverse, come from the implicit function theorem
    and do not pass through the steps.

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
        near = 1e-16 * (high - low)

        def moved(old: Scalar, new: Scalar) -> Bool[Array, ""]:
            return jnp.abs(new - old) > 1e-7 * jnp.abs(new) + near

        def going(now: tuple[Any, ...]) -> Bool[Array, ""]:
            count, still_moving, _ = now
            return still_moving & (count < steps)

        def again(now: tuple[Any, ...]) -> tuple[Any, ...]:
            count, _, state = now
            after = narrow(count, state)
            return count + 1, moved(state[0], after[0]), after

        state = before = (w, low, high, never, never)
        taken = _FEW if fuses_loops() else 1  # written out they are fast, but take longer to compile
        for i in range(taken):
            before, state = state, narrow(i, state)
        return jax.lax.while_loop(going, again, (taken, moved(before[0], state[0]), state))[2][0]

    def tangent_solve(linear: Callable[[Scalar], Scalar], value: Scalar) -> Scalar:
        return value * (1.0 / linear(jnp.ones_like(value)))  # no quotient for each of many tangents

    return jax.lax.custom_root(function, jax.lax.stop_gradient(guess), solve, tangent_solve)
