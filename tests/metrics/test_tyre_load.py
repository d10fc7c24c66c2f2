import pickle

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.metrics import (
    STATISTICS,
    dynamic_load_coefficient,
    lift_off_below,
    lift_off_fraction,
    road_stress_factor,
)


VARIATION = 900.0 * np.sin(2 * np.pi * np.arange(128) / 128)


def test_coefficient_of_a_sine():
    assert float(dynamic_load_coefficient(VARIATION, 3000.0)) == pytest.approx(0.3 / np.sqrt(2), rel=1e-13)


def test_total_load_gives_the_same():
    total = float(dynamic_load_coefficient(3000.0 + VARIATION, 3000))
    assert total == pytest.approx(0.3 / np.sqrt(2), rel=1e-12)


def test_gradient_in_the_static_load():
    gradient = jax.jit(jax.grad(lambda w: dynamic_load_coefficient(VARIATION, w)))(3000.0)
    assert float(gradient) == pytest.approx(-0.3 / np.sqrt(2) / 3000.0, rel=1e-12)


def test_stress_factor_formula():
    s = 0.3 / np.sqrt(2)
    assert float(road_stress_factor(VARIATION, 3000.0)) == pytest.approx(1 + 6 * s**2 + 3 * s**4, rel=1e-13)


def test_stress_factor_is_the_mean_fourth_power_of_a_gaussian_load():
    # Gauss-Hermite quadrature: 1 + s g, g normal, fourth power integrated exactly
    s = 0.25
    nodes, weights = np.polynomial.hermite_e.hermegauss(6)
    exact = np.sum(weights * (1 + s * nodes) ** 4) / np.sum(weights)
    wave = s * np.sqrt(2) * np.sin(2 * np.pi * np.arange(64) / 64)
    assert float(road_stress_factor(wave, 1.0)) == pytest.approx(exact, rel=1e-12)


def test_lift_off_counts_samples():
    load = np.array([100.0, 0.0, -5.0, 3.0, 20.0])
    assert float(lift_off_fraction(load)) == pytest.approx(0.4)
    assert float(lift_off_fraction(load, 3.0)) == pytest.approx(0.6)
    assert float(lift_off_fraction(load - 1000.0)) == 1.0
    assert float(lift_off_fraction(load + 1000.0)) == 0.0


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_a_wheel_in_the_air_counts_as_lifted_also_with_the_rounding_of_its_load(precision):
    rounded = -1.0 + np.finfo(precision).eps * np.array([0.0, 1.0, -1.0, 2.0, -2.0])
    load = jnp.asarray(np.append(rounded, [-0.999, -0.5, 0.0]), precision)
    assert float(STATISTICS["lift_off_fraction"].of(load, 1e-3)) == pytest.approx(5 / 8)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_a_tyre_with_a_rounded_load_is_lifted_off_below_a_share_of_its_static_load(precision):
    load = jnp.asarray([-1.0, -0.9951, -0.9949, -0.5, 0.0], precision)
    rounded = lift_off_below(0.005)
    assert float(rounded.of(load, 1e-3)) == pytest.approx(2 / 5)
    copy = pickle.loads(pickle.dumps(rounded))
    assert copy == rounded and hash(copy) == hash(rounded) and copy != STATISTICS["lift_off_fraction"]


def test_lift_off_has_no_gradient():
    np.testing.assert_array_equal(jax.jit(jax.grad(lift_off_fraction))(jnp.array([1.0, -1.0, 0.0])), np.zeros(3))


@pytest.mark.parametrize("metric", [dynamic_load_coefficient, road_stress_factor])
@pytest.mark.parametrize("load", [0.0, -3000.0, np.nan])
def test_errors(metric, load):
    with pytest.raises(
        ValueError, match=rf"`static_tyre_load` must be positive and finite, but is {load}.*weight carried"
    ):
        metric(VARIATION, load)


def test_threshold_must_be_finite():
    with pytest.raises(ValueError, match=r"`threshold` must be finite, but is nan"):
        lift_off_fraction(VARIATION, np.nan)
