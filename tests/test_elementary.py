"""Functions of the loops against NumPy, and their derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import _elementary
from jaxdamp._elementary import exponential, logarithm, power, reciprocal_root
from jaxdamp.configuration import Target, one_at_a_time


def test_logarithm_is_that_of_numpy(rng):
    x = np.concatenate([
        np.exp(rng.uniform(-700.0, 700.0, 20_000)),
        1.0 + rng.uniform(-0.5, 1.0, 20_000) * 10.0 ** rng.uniform(-15.0, 0.0, 20_000),
        2.0 ** np.arange(-1022.0, 1023.0),
        np.sqrt(2.0) * 2.0 ** np.arange(-1000.0, 1000.0),
        [np.finfo(float).tiny, 6e307, 1.0],
    ])  # fmt: skip
    for compiled in (logarithm, jax.jit(logarithm)):
        np.testing.assert_allclose(compiled(jnp.asarray(x)), np.log(x), rtol=6e-16, atol=1e-300)
    single = jnp.asarray(x[:20_000] ** 0.1, dtype=jnp.float32)
    np.testing.assert_allclose(logarithm(single), np.log(np.asarray(single)), rtol=1e-6, atol=1e-6)


def test_exponential_is_that_of_numpy(rng):
    x = np.concatenate(
        [rng.uniform(-700.0, 700.0, 20_000), rng.uniform(-1e-3, 1e-3, 1000), np.log(2.0) * np.arange(-9, 10)]
    )
    for compiled in (exponential, jax.jit(exponential)):  # compilers may reorder sums
        np.testing.assert_allclose(compiled(jnp.asarray(x)), np.exp(x), rtol=6e-16)
    single = jnp.asarray(x[:20_000] * 0.1, dtype=jnp.float32)
    np.testing.assert_allclose(exponential(single), np.exp(np.asarray(single)), rtol=2e-6)


def test_power_is_that_of_numpy(rng):
    base, exponent = 10.0 ** rng.uniform(-12.0, 6.0, 20_000), rng.uniform(-3.0, 20.0, 20_000)
    with np.errstate(over="ignore", under="ignore"):
        np.testing.assert_allclose(
            jax.jit(jax.vmap(power))(jnp.asarray(base), jnp.asarray(exponent)), base**exponent, rtol=2e-13
        )
    assert float(power(0.0, 0.5)) == pytest.approx(0.0, abs=1e-14)


def test_reciprocal_root_is_that_of_numpy_whatever_the_processor(rng, monkeypatch):
    x = jnp.asarray(np.exp(rng.uniform(-300.0, 300.0, 20_000)))
    for device_has_it in (True, False):
        monkeypatch.setattr(_elementary, "target", lambda known=device_has_it: Target(False, known))
        np.testing.assert_allclose(reciprocal_root(x), 1.0 / np.sqrt(x), rtol=5e-16)
        for mode in (jax.jacfwd, jax.jacrev):
            assert float(jax.jit(mode(reciprocal_root))(jnp.asarray(0.3))) == pytest.approx(-0.5 * 0.3**-1.5, rel=1e-14)
            second = jax.jit(mode(mode(reciprocal_root)))(jnp.asarray(0.3))
            assert float(second) == pytest.approx(0.75 * 0.3**-2.5, rel=1e-14)


def test_derivatives_in_both_modes_to_second_order():
    for mode in (jax.jacfwd, jax.jacrev):
        assert float(jax.jit(mode(mode(exponential)))(jnp.asarray(0.3))) == pytest.approx(np.exp(0.3), rel=1e-15)
        assert float(jax.jit(mode(logarithm))(jnp.asarray(0.3))) == pytest.approx(1.0 / 0.3, rel=1e-15)
        assert float(jax.jit(mode(mode(logarithm)))(jnp.asarray(0.3))) == pytest.approx(-1.0 / 0.09, rel=1e-14)
        slope = jax.jit(mode(power, argnums=(0, 1)))(jnp.asarray(0.3), jnp.asarray(1.7))
        expected = 1.7 * 0.3**0.7, np.log(0.3) * 0.3**1.7
        np.testing.assert_allclose(slope, expected, rtol=1e-14)
    at_zero = jax.jit(jax.grad(power, argnums=(0, 1)))(jnp.asarray(0.0), jnp.asarray(0.5))
    assert np.all(np.isfinite(at_zero))


@pytest.mark.parametrize(
    "function", [exponential, logarithm, reciprocal_root, pytest.param(lambda x: power(x, 1.7), marks=pytest.mark.slow)]
)
def test_second_derivatives_over_a_loop(function):
    """Forward over reverse sees the text of a function where a loop forgets its custom derivative."""

    def looped(x):
        return jax.lax.scan(lambda carry, _: (0.5 * function(carry) + 0.9 + x, None), x, None, length=3)[0]

    modes = jax.jacfwd, jax.jacrev
    seconds = jax.jit(lambda x: [outer(inner(looped))(x) for outer in modes for inner in modes])
    for x in (0.3, 1.2):
        expected, *others = seconds(jnp.asarray(x))
        assert abs(float(expected)) > 1e-3
        np.testing.assert_allclose(others, float(expected), rtol=1e-13)


def test_one_car_has_the_powers_of_the_library_with_the_same_derivatives():
    inside = jax.jit(power)
    with one_at_a_time():
        assert "pow" in str(jax.make_jaxpr(inside)(0.3, 1.7))
        assert float(inside(0.0, 0.5)) == pytest.approx(0.0, abs=1e-14)
        for mode in (jax.jacfwd, jax.jacrev):
            for order, place in ((1, 0), (1, 1), (2, 0), (2, 1)):
                slope = inside
                for _ in range(order):
                    slope = mode(slope, place)
                n, x = 1.7, 0.3
                exact = {(1, 0): n / x, (2, 0): n * (n - 1) / x**2, (1, 1): np.log(x), (2, 1): np.log(x) ** 2}
                assert float(slope(x, n)) == pytest.approx(exact[order, place] * x**n, rel=1e-13)
    assert "bitcast" in str(jax.make_jaxpr(inside)(0.3, 1.7))
