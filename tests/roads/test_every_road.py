"""What holds for all roads."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import roads


TIME = jnp.linspace(0.0, 1.0, 301)


def test_height_has_a_column_for_each_wheel_and_none_is_level(make):
    road = make(0.02)
    height = road.height(TIME)
    assert height.shape == (301, road.wheels)
    assert height.dtype == jnp.float64
    assert np.all(np.isfinite(height))
    assert np.all(np.ptp(height, axis=0) > 1e-5)


def test_each_height_depends_on_its_own_time_only(make):
    road = make(0.02)
    np.testing.assert_allclose(road.height(TIME[::-1]), road.height(TIME)[::-1], atol=1e-14)


def test_has_a_height_wherever_its_span_says(make):
    road = make(0.02)
    first, last = (float(time) for time in road.span)
    assert first <= 0.0 and last >= 1.0
    assert np.all(np.isfinite(road.height(np.linspace(max(first, -3.0), min(last, 50.0), 301))))


def test_every_road_is_linear_in_its_size(make):
    np.testing.assert_allclose(make(0.06).height(TIME), 3.0 * make(0.02).height(TIME), rtol=1e-10, atol=1e-15)


def test_starts_at_height_zero(make):
    np.testing.assert_allclose(make(0.02).height(TIME)[0], 0.0, atol=1e-15)


def test_compiled_equals_plain(make):
    road = make(0.02)
    compiled = eqx.filter_jit(lambda road, time: road.height(time))(road, TIME)
    np.testing.assert_allclose(compiled, road.height(TIME), rtol=1e-12, atol=1e-15)


def test_batch_equals_loop_and_gradients_in_size_equal_differences_in_both_modes(make):
    def energy(a):
        height = make(a).height(TIME)
        return jnp.sum(height**2), height

    def all_of_it(a):
        forward, _ = jax.jacfwd(energy, has_aux=True)(a)
        return *jax.value_and_grad(energy, has_aux=True)(a), forward

    a, h = 0.02, 1e-6
    sizes = jnp.array([a - h, a, a + h])
    (values, batch), reverse, forward = jax.jit(jax.vmap(all_of_it))(sizes)
    loop = jnp.stack([make(float(a)).height(TIME) for a in sizes])
    np.testing.assert_allclose(batch, loop, rtol=1e-11, atol=1e-15)
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
    of_the_design = (
        "iso8608 cosine_bump pothole step sine sweep_sine band_limited from_profile read_crg delayed two_track"
    )
    assert set(roads.__all__) >= set(of_the_design.split())
    assert all(hasattr(roads, name) for name in roads.__all__)
