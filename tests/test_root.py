"""Roots of increasing functions and of two functions: exact, also at kinks, with first and second derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp._root import increasing_root, root_of_two


def cubic(c):
    """The root w of w³ + w = c."""
    return increasing_root(lambda w: w**3 + w - c, jnp.zeros_like(c), -10.0 * jnp.ones_like(c), 10.0 * jnp.ones_like(c))


def kinked(c):
    """The root of |w| w + (100 w above 0.5) = c, whose slope jumps a hundredfold and is zero at zero."""
    w = increasing_root(
        lambda w: w * jnp.abs(w) + 100.0 * jnp.maximum(w - 0.5, 0.0) - c, 0.1 * c, -30.0 + 0.0 * c, 30.0 + 0.0 * c
    )
    return w * jnp.abs(w) + 100.0 * jnp.maximum(w - 0.5, 0.0)


@jax.jit
def all_of(c):
    derivatives = [
        jax.vmap(f)(c) for f in (cubic, jax.grad(cubic), jax.grad(jax.grad(cubic)), jax.jacfwd(jax.grad(cubic)))
    ]
    return *derivatives, jax.vmap(kinked)(c)


def test_roots_reach_rounding_errors_with_their_derivatives():
    c = np.array([-30.0, -1e-3, 0.2, 0.26, 3.0, 400.0])
    w, slope, reverse, forward, back = map(np.asarray, all_of(jnp.asarray(c)))
    np.testing.assert_allclose(w**3 + w, c, rtol=1e-13)
    np.testing.assert_allclose(slope, 1.0 / (3.0 * w**2 + 1.0), rtol=1e-12)
    np.testing.assert_allclose(reverse, -6.0 * w / (3.0 * w**2 + 1.0) ** 3, rtol=1e-9)
    np.testing.assert_allclose(forward, reverse, rtol=1e-9)
    np.testing.assert_allclose(back, c, rtol=1e-12, atol=1e-12)


def test_roots_of_two_reach_rounding_errors_with_their_derivatives():
    def pair(c):
        """A³ + a − b = c and b + 5 max(b − 0.2, 0) + a = 2 c."""

        def missing(roots):
            a, b = roots
            return a**3 + a - b - c, b + 5.0 * jnp.maximum(b - 0.2, 0.0) + a - 2.0 * c

        most = jnp.asarray(50.0), jnp.asarray(50.0)
        return jnp.stack(root_of_two(missing, (jnp.zeros_like(c), jnp.zeros_like(c)), most))

    c = np.array([-3.0, 0.05, 0.4, 6.0])
    (a, b), (da, db) = (
        np.asarray(f(jnp.asarray(c))).T for f in map(jax.jit, (jax.vmap(pair), jax.vmap(jax.jacfwd(pair))))
    )
    np.testing.assert_allclose(a**3 + a - b, c, rtol=1e-11)
    np.testing.assert_allclose(b + 5.0 * np.maximum(b - 0.2, 0.0) + a, 2.0 * c, rtol=1e-11)
    kink = np.where(b > 0.2, 6.0, 1.0)  # (3 a² + 1) a' − b' = 1 and a' + k b' = 2
    expected = (2.0 + kink) / (kink * (3.0 * a**2 + 1.0) + 1.0)
    np.testing.assert_allclose(da, expected, rtol=1e-10)
    np.testing.assert_allclose(db, (2.0 - expected) / kink, rtol=1e-10)


@pytest.mark.parametrize("close", [1e-2, 1e-7])
def test_a_root_is_as_accurate_as_its_last_step_is_short(close):
    c = jnp.linspace(0.3, 200.0, 50)
    lower, upper = -10.0 * jnp.ones(50), 10.0 * jnp.ones(50)
    solve = jax.jit(
        jax.vmap(lambda c, low, high: increasing_root(lambda w: w**3 + w - c, 0.0 * c, low, high, close=close))
    )
    w = np.asarray(solve(c, lower, upper))
    error = np.max(np.abs(w**3 + w - np.asarray(c)) / np.asarray(c))
    assert error < 10.0 * close**2 + 1e-14 and (close < 1e-3 or error > 1e-9)
