"""Limits, maxima and who has their derivatives; `tests/roads/test_contact.py` has one that `jnp.max` got wrong."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp._limits import at_least, at_most, largest, within


def test_equal_numbers_share_the_derivative_of_a_limit():
    numbers = jnp.array([-2.0, 1.0, 3.0])
    np.testing.assert_array_equal(at_least(numbers, 1.0), [1.0, 1.0, 3.0])
    np.testing.assert_array_equal(at_most(numbers, 1.0), [-2.0, 1.0, 1.0])
    np.testing.assert_array_equal(within(numbers, -1.0, 2.0), [-1.0, 1.0, 2.0])
    np.testing.assert_array_equal(jax.vmap(jax.grad(at_least), (0, None))(numbers, 1.0), [0.0, 0.5, 1.0])
    np.testing.assert_array_equal(jax.vmap(jax.grad(at_most), (0, None))(numbers, 1.0), [1.0, 0.5, 0.0])


def test_is_the_maximum_along_an_axis(rng):
    numbers = rng.normal(size=(7, 5))
    for axis in (0, 1):
        np.testing.assert_array_equal(largest(jnp.asarray(numbers), axis), numbers.max(axis))
    assert np.isnan(largest(jnp.array([0.0, jnp.nan, 1.0])))


def test_the_first_of_equal_numbers_has_the_derivative():
    np.testing.assert_array_equal(jax.grad(largest)(jnp.array([1.0, 3.0, 3.0])), [0.0, 1.0, 0.0])


def test_second_derivatives_over_a_loop_share_them_too():
    def looped(limit, x):
        return jax.lax.scan(lambda carry, _: (x * limit(carry, 1.0) ** 2, None), x, None, length=2)[0]

    for limit, sides in ((at_least, (0.7, 1.0, 1.3)), (at_most, (0.7, 1.0, 1.3))):
        for side in sides:
            x = jnp.asarray(side)
            expected = float(jax.jacfwd(jax.jacfwd(lambda x, limit=limit: looped(limit, x)))(x))
            found = float(jax.hessian(lambda x, limit=limit: looped(limit, x))(x))
            np.testing.assert_allclose(found, expected, rtol=1e-13)
