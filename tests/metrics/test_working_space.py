import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

from jaxdamp.metrics import gaussian_exceedance, working_space_exceedance, working_space_peak_to_peak, working_space_rms


TRAVEL = 0.04 * np.sin(2 * np.pi * np.arange(128) / 128)


def test_sine():
    assert float(working_space_rms(TRAVEL)) == pytest.approx(0.04 / np.sqrt(2), rel=1e-13)
    assert float(working_space_peak_to_peak(TRAVEL)) == pytest.approx(0.08, rel=1e-13)


@pytest.mark.parametrize("metric", [working_space_rms, working_space_peak_to_peak])
def test_offset_changes_nothing(metric):
    assert float(metric(TRAVEL + 0.35)) == pytest.approx(float(metric(TRAVEL)), rel=1e-12)


def test_constant_deflection_uses_no_space():
    constant = jnp.full(10, 0.25)
    assert float(working_space_rms(constant)) == 0.0
    np.testing.assert_array_equal(jax.jit(jax.grad(working_space_rms))(constant), np.zeros(10))


def test_gradient_of_peak_is_at_the_extremes():
    np.testing.assert_array_equal(
        jax.jit(jax.grad(working_space_peak_to_peak))(jnp.array([0.0, 0.04, -0.02, 0.01])), [0, 1, -1, 0]
    )


def test_exceedance_counts_samples():
    travel = np.array([-0.07, -0.06, 0.0, 0.04, 0.041])
    assert float(working_space_exceedance(travel, -0.06, 0.04)) == pytest.approx(0.4)
    # a sine beyond half of its amplitude: two thirds of the time
    wave = 0.04 * np.sin(2 * np.pi * (np.arange(3000) + 0.5) / 3000)
    assert float(working_space_exceedance(wave, -0.02, 0.02)) == pytest.approx(2 / 3, abs=1e-3)
    np.testing.assert_array_equal(
        jax.jit(jax.grad(lambda d: working_space_exceedance(d, -0.02, 0.02)))(jnp.asarray(wave)), 0.0
    )


def test_gaussian_exceedance_equals_scipy():
    for mean, lower, upper in ((0.0, -0.06, 0.06), (0.01, -0.05, 0.08), (-0.02, -0.3, -0.01)):
        expected = norm.cdf(lower, mean, 0.02) + norm.sf(upper, mean, 0.02)
        assert float(gaussian_exceedance(mean, 0.02, lower, upper)) == pytest.approx(expected, rel=1e-10)


def test_gaussian_estimate_meets_the_count_of_a_gaussian_record(rng):
    travel = 0.005 + 0.02 * rng.standard_normal(200_000)
    counted = float(working_space_exceedance(travel, -0.03, 0.04))
    estimate = float(gaussian_exceedance(travel.mean(), working_space_rms(travel), -0.03, 0.04))
    assert counted == pytest.approx(estimate, abs=4 * np.sqrt(estimate / 200_000))
    slopes = jax.jit(jax.grad(gaussian_exceedance, argnums=(1, 2, 3)))(0.005, 0.02, -0.03, 0.04)
    assert slopes[0] > 0 and slopes[1] > 0 > slopes[2]


@pytest.mark.parametrize(
    "metric", [lambda *a: working_space_exceedance(TRAVEL, *a), lambda *a: gaussian_exceedance(0.0, 1.0, *a)]
)
def test_limits_must_be_in_order(metric):
    with pytest.raises(ValueError, match=r"`upper` must be above `lower` \(0.06\), but is -0.06"):
        metric(0.06, -0.06)
    with pytest.raises(ValueError, match=r"`lower` must be finite, but is nan"):
        metric(np.nan, 0.06)


def test_spread_must_be_positive():
    with pytest.raises(ValueError, match=r"`standard_deviation` must be positive and finite, but is 0.0"):
        gaussian_exceedance(0.0, 0.0, -0.06, 0.06)
