"""The same seed gives the same numbers in single and double precision, one by one or in a batch."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats

from jaxdamp import dampers, roads, simulate
from jaxdamp._random import normal, sign, uniform
from jaxdamp.vehicles.presets import quarter_car_000


SEEDS = [0, 7, -3, 2**40 + 5]
COUNT = 4001


@pytest.mark.parametrize("seed", SEEDS)
def test_in_double_precision_they_are_those_of_jax(seed):
    key = jax.random.key(seed)
    expected = jax.random.uniform(key, (COUNT,), float, maxval=2 * np.pi)
    for given in (seed, key, jax.random.key_data(key)):
        np.testing.assert_array_equal(uniform(given, (COUNT,), 2 * np.pi), expected)
    np.testing.assert_allclose(normal(seed, (7, 11)), jax.random.normal(key, (7, 11)), rtol=1e-14)
    np.testing.assert_array_equal(sign(seed, (COUNT,)), jax.random.rademacher(key, (COUNT,), float))


TRACED = {draw: jax.jit(lambda seed, draw=draw: draw(seed, (COUNT,))) for draw in (uniform, normal, sign)}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("draw", "error"), [(uniform, 1e-7), (normal, 3e-6), (sign, 0.0)])
def test_in_single_precision_they_are_the_same(draw, error, seed):
    double = np.asarray(draw(seed, (COUNT,)))
    with jax.enable_x64(False):
        single = draw(seed, (COUNT,))
        assert single.dtype == np.float32
        np.testing.assert_allclose(single, double, rtol=error, atol=error)
        if abs(seed) < 2**31:
            np.testing.assert_allclose(TRACED[draw](jnp.array(seed)), double, rtol=error, atol=error)


def test_a_batch_of_seeds_gives_each_its_own():
    seeds = jnp.array([0, 7, -3])
    for draw in (uniform, normal, sign):
        batch = jax.jit(jax.vmap(lambda seed, draw=draw: draw(seed, (50,))))(seeds)
        np.testing.assert_allclose(batch, np.stack([draw(int(seed), (50,)) for seed in seeds]), rtol=1e-14)
        keys = jax.vmap(lambda key, draw=draw: draw(key, (50,)))(jax.vmap(jax.random.key)(seeds))
        np.testing.assert_allclose(keys, batch, rtol=1e-14)


def test_single_precision_has_the_tails_of_the_normal_distribution():
    with jax.enable_x64(False):
        drawn = np.asarray(normal(1, (200_000,)), float)
    assert scipy.stats.kstest(drawn, "norm").pvalue > 1e-3
    assert np.abs(drawn).max() > 4.2 and abs(scipy.stats.kurtosis(drawn)) < 0.05


@pytest.mark.parametrize("seed", [1.5, "one", np.array([1, 2, 3]), None])
def test_other_seeds_are_refused(seed, unchecked_shapes):
    with pytest.raises(ValueError, match="`seed` must be a whole number or a JAX random key"):
        uniform(seed, (3,))


@pytest.fixture
def unchecked_shapes():
    import jaxtyping

    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


ROADS = {
    "iso8608": lambda seed: roads.iso8608("C", 20.0, seed=seed, length=200.0),
    "iso8608_filtered": lambda seed: roads.iso8608_filtered("C", 20.0, seed=seed, length=200.0),
    "band_limited": lambda seed: roads.band_limited(1.0, 20.0, rms=0.01, duration=4.0, dt=0.01, seed=seed),
    "two_track": lambda seed: roads.two_track(ROADS["iso8608"](3), track_width=1.5, seed=seed),
}


@pytest.mark.parametrize(
    "kind", ["iso8608", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ROADS if kind != "iso8608")]
)
def test_a_seed_is_one_road_in_every_precision_and_batch(kind):
    make, time = ROADS[kind], np.arange(400) * 0.01
    double = np.asarray(make(5).height(time))
    batch = jax.jit(jax.vmap(lambda seed: make(seed).height(time)))(jnp.array([4, 5]))
    np.testing.assert_allclose(batch[1], double, atol=1e-12)
    assert np.abs(batch[0] - batch[1]).max() > 1e-3
    with jax.enable_x64(False):
        single = np.asarray(make(5).height(time.astype(np.float32)), float)
    assert np.abs(single - double).max() < 2e-4 * np.abs(double).max()
    assert np.std(single) == pytest.approx(np.std(double), rel=1e-5)


def test_a_ride_is_that_of_double_precision():
    def level():
        run = simulate(quarter_car_000(), roads.iso8608("C", 20.0, seed=1, length=200.0), duration=2.0, dt=2e-3)
        return float(run.metrics(["rms_sprung_acceleration"])["rms_sprung_acceleration"])

    double = level()
    with jax.enable_x64(False):
        assert level() == pytest.approx(double, rel=1e-3)


def test_random_weights_do_not_depend_on_the_precision():
    def weights():
        law = dampers.NeuralHysteresis.random(
            jax.random.key(0), elements=2, width=4, velocity_scale=0.3, force_scale=900.0
        )
        return [np.asarray(leaf, float) for leaf in jax.tree.leaves(law)]

    double = weights()
    with jax.enable_x64(False):
        single = weights()
    for one, two in zip(single, double, strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-5, atol=1e-6)
