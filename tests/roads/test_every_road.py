"""What holds for all roads."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import roads


TIME = jnp.linspace(0.0, 1.0, 301)


def test_height_has_one_column_and_is_not_level(make):
    height = make(0.02).height(TIME)
    assert height.shape == (301, 1)
    assert height.dtype == jnp.float64
    assert np.all(np.isfinite(height))
    assert np.ptp(height) > 1e-5


def test_every_road_is_linear_in_its_size(make):
    np.testing.assert_allclose(make(0.06).height(TIME), 3.0 * make(0.02).height(TIME), rtol=1e-10, atol=1e-15)


def test_starts_at_height_zero(make):
    np.testing.assert_allclose(make(0.02).height(TIME)[0], 0.0, atol=1e-15)


def test_compiled_equals_plain(make):
    road = make(0.02)
    compiled = eqx.filter_jit(lambda road, time: road.height(time))(road, TIME)
    np.testing.assert_allclose(compiled, road.height(TIME), rtol=1e-12, atol=1e-15)


def test_batch_equals_loop(make):
    sizes = jnp.array([0.01, 0.02, 0.05])
    batch = jax.jit(jax.vmap(lambda a: make(a).height(TIME)))(sizes)
    loop = jnp.stack([make(float(a)).height(TIME) for a in sizes])
    np.testing.assert_allclose(batch, loop, rtol=1e-11, atol=1e-15)


def test_gradient_in_size_equals_difference_in_both_modes(make):
    def energy(a):
        return jnp.sum(make(a).height(TIME) ** 2)

    a, h = 0.02, 1e-6
    sizes = jnp.array([a - h, a, a + h])
    values, reverse, forward = jax.jit(jax.vmap(lambda a: (energy(a), jax.grad(energy)(a), jax.jacfwd(energy)(a))))(
        sizes
    )
    difference = (values[2] - values[0]) / (2.0 * h)
    np.testing.assert_allclose(reverse[1], difference, rtol=1e-7)
    np.testing.assert_allclose(forward[1], difference, rtol=1e-7)


def test_numpy_times_are_accepted(make):
    road = make(0.02)
    np.testing.assert_array_equal(road.height(np.asarray(TIME)), road.height(TIME))


def test_whole_numbers_are_accepted():
    np.testing.assert_array_equal(roads.sine(1, frequency=2).height(TIME), roads.sine(1.0, frequency=2.0).height(TIME))
    iso = roads.iso8608("C", 20, 10, seed=0)
    np.testing.assert_array_equal(iso.height(TIME), roads.iso8608("C", 20.0, seed=0).height(TIME))


def test_names():
    assert set(roads.__all__) >= {"iso8608", "cosine_bump", "step", "sine", "band_limited", "from_profile"}
    assert all(hasattr(roads, name) for name in roads.__all__)
