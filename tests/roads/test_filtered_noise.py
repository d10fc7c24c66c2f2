from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from jaxdamp.roads import iso8608_filtered
from jaxdamp.roads.random_roads import filtered_noise_variance


CLASS_C, N0, N1, SPACING = 256e-6, 0.1, 0.011, 0.05
VARIANCE = np.pi * N0**2 * CLASS_C / (2 * N1)


@pytest.fixture(scope="module")
def ensemble():
    """400 roads of 100 m."""
    keys = jax.random.split(jax.random.key(1), 400)
    return np.asarray(
        jax.jit(jax.vmap(lambda key: iso8608_filtered("C", 20.0, seed=key, length=100.0).samples[:, 0]))(keys)
    )


def test_variance_is_the_closed_form_everywhere(ensemble):
    assert float(filtered_noise_variance(CLASS_C, N1)) == pytest.approx(VARIANCE, rel=1e-14)
    # 400 independent roads: the standard deviation of a variance is sqrt(2/400); at the first, middle and last sample
    for k in (0, 1000, 2000):
        assert abs(np.mean(ensemble[:, k] ** 2) / VARIANCE - 1) < 4 * np.sqrt(2 / 400)
    assert stats.kstest(ensemble[:, 1500] / np.sqrt(VARIANCE), "norm").pvalue > 1e-4


def test_neighbours_are_correlated_as_the_filter_says(ensemble):
    # increments of an Ornstein-Uhlenbeck process: E (z_k+1 - z_k)^2 = 2 sigma^2 (1 - exp(-2 pi n1 dx))
    expected = 2 * VARIANCE * -np.expm1(-2 * np.pi * N1 * SPACING)
    assert abs(np.mean(np.diff(ensemble, axis=1) ** 2) / expected - 1) < 4 * np.sqrt(2 / 800_000)


def test_spectrum_has_the_level_and_slope_of_the_class(ensemble):
    # one-sided; Hann windows, one per road, 400 averages; far below 1/dx the samples alias nothing
    size = ensemble.shape[1]
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(size) / size)
    density = 2 * SPACING / np.sum(window**2) * np.mean(np.abs(np.fft.rfft(ensemble * window, axis=1)) ** 2, axis=0)
    n = np.fft.rfftfreq(size, SPACING)
    chosen = (n > 0.1) & (n < 1.0)
    ratio = density[chosen] / (CLASS_C * N0**2 / (n[chosen] ** 2 + N1**2))
    correlated = 1.94 / chosen.sum()
    aliasing = (np.pi * 1.0 * SPACING) ** 2 / 3  # of the samples, at most, at 1 cycle/m: (x/sin x)^2 - 1
    leakage = 3 * 0.33 / 10**2
    assert abs(ratio.mean() - 1) < 4 / np.sqrt(400) * np.sqrt(correlated) + aliasing + leakage
    slope, _ = np.polyfit(np.log(n[chosen]), np.log(density[chosen]), 1)
    assert slope == pytest.approx(-2.0, abs=0.05)  # (1 - aliasing at the end over one decade) leaves 0.01


def test_seeds_reproduce_and_differ():
    one, same, other = (iso8608_filtered("C", 20.0, seed=seed, length=50.0).samples for seed in (5, 5, 6))
    np.testing.assert_array_equal(one, same)
    assert np.max(np.abs(one - other)) > 1e-3


def test_the_ground_does_not_depend_on_the_speed():
    slow, fast = (iso8608_filtered("C", v, seed=5, length=50.0, ramp=0.0) for v in (10.0, 20.0))
    time = np.linspace(0.0, 2.0, 101)
    np.testing.assert_allclose(slow.height(2.0 * time), fast.height(time), atol=1e-14)


def test_length_and_duration():
    road = iso8608_filtered("C", 20.0, 5.0, seed=5)
    assert road.duration == pytest.approx(5.0) and road.grid == pytest.approx(0.0025)
    assert iso8608_filtered("C", 20.0, seed=5, length=1.01).samples.shape == (22, 1)  # 1.05 m hold 1.01 m
    assert float(road.height(np.zeros(1))[0, 0]) == 0.0


@pytest.mark.parametrize("argument", ["speed", "cutoff", "road_class"])
def test_gradients_equal_differences(argument, check_gradient):
    given = {"speed": 11.37, "cutoff": 0.011, "road_class": 256e-6}
    time = jnp.linspace(0.0, 1.5, 37)

    def energy(value):
        return 1e4 * jnp.sum(iso8608_filtered(**{**given, argument: value}, seed=5, length=40.0).height(time) ** 2)

    check_gradient(energy, given[argument])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, r"`duration` must be given, or `length`.*neither was given"),
        ({"duration": 5.0, "length": 50.0}, r"`duration` must be.*not both, but is 5.0 s, and length 50.0 m as well"),
        ({"length": -5.0}, r"`length` must be positive and finite, but is -5.0"),
        ({"duration": 0.0}, r"`duration` must be positive and finite, but is 0.0"),
        ({"length": 5.0, "cutoff": 0.0}, r"`cutoff` must be positive.*grows without end"),
        ({"length": 5.0, "spacing": 0.0}, r"`spacing` must be positive"),
        ({"length": 5.0, "speed": -1.0}, r"`speed` must be positive.*driven forwards"),
        ({"length": 5.0, "road_class": "X"}, r"`road_class` must be one of"),
        ({"length": 5.0, "ramp": -1.0}, r"`ramp` must be finite and not negative"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        iso8608_filtered(**{"road_class": "C", "speed": 20.0, "seed": 0, **arguments})


def test_duration_needs_a_known_speed():
    with pytest.raises(ValueError, match=r"`duration` must be left out where `speed` is traced.*give `length`"):
        jax.grad(lambda v: jnp.sum(iso8608_filtered("C", v, 10.0, seed=0).height(jnp.zeros(1))))(20.0)


def test_filtered_roads_drawn_again_stay_independent_and_in_their_distribution():
    roads = [iso8608_filtered("C", 20.0, seed=seed, length=4000.0, spacing=5.0) for seed in (1, 2)]
    drawn: list[Any] = [road.reseeded(seed) for road, seed in zip((*roads, roads[0]), (3, 3, 4), strict=True)]
    again: Any = iso8608_filtered("C", 20.0, seed=1, length=4000.0, spacing=5.0).reseeded(3)
    np.testing.assert_array_equal(drawn[0].samples, again.samples)
    # 801 samples, increments nearly free of correlation: 4 standard errors
    increments = [np.diff(road.samples[:, 0]) for road in (*roads, *drawn)]
    np.testing.assert_allclose(np.corrcoef(increments), np.eye(5), atol=4 / np.sqrt(800))
    step = np.sqrt(2 * VARIANCE * -np.expm1(-2 * np.pi * N1 * 5.0))
    assert all(stats.kstest(each / step, "norm").pvalue > 1e-4 for each in increments)
