"""What holds for all metrics of signals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import metrics


# name -> (metric of one signal, the power of the scale of the signal it grows with)
METRICS = {
    "rms": (metrics.rms, 1),
    "peak": (metrics.peak, 1),
    "crest_factor": (metrics.crest_factor, 0),
    "working_space_rms": (metrics.working_space_rms, 1),
    "working_space_peak": (metrics.working_space_peak, 1),
    "dynamic_load_coefficient": (lambda x: metrics.dynamic_load_coefficient(x, 5.0), 1),
    "road_stress_factor": (lambda x: metrics.road_stress_factor(x, 5.0), None),
    "lift_off_fraction": (metrics.lift_off_fraction, 0),
    "dissipated_energy": (lambda x: metrics.dissipated_energy(x, x, 0.01), 2),
    "equivalent_damping": (lambda x: metrics.equivalent_damping(x * x * x, x), 2),
    "power_spectral_density": (lambda x: jnp.sum(metrics.power_spectral_density(x, 0.01, 64)[1]), 2),
}
DIFFERENTIABLE = [name for name in METRICS if name != "lift_off_fraction"]


@pytest.fixture
def signal(rng):
    return rng.standard_normal(301) + 0.3


@pytest.mark.parametrize("name", METRICS)
def test_compiled_equals_plain(name, signal):
    metric, _ = METRICS[name]
    value = metric(jnp.asarray(signal))
    assert value.shape == () and value.dtype == jnp.float64
    np.testing.assert_allclose(jax.jit(metric)(signal), value, rtol=1e-13)


@pytest.mark.parametrize("name", METRICS)
def test_numpy_equals_jax(name, signal):
    metric, _ = METRICS[name]
    np.testing.assert_array_equal(metric(signal), metric(jnp.asarray(signal)))


@pytest.mark.parametrize("name", METRICS)
def test_single_precision_is_kept(name, signal):
    metric, _ = METRICS[name]
    value = metric(signal.astype(np.float32))
    assert value.dtype == jnp.float32
    np.testing.assert_allclose(value, metric(signal), rtol=1e-4)


@pytest.mark.parametrize("name", METRICS)
def test_batch_equals_loop(name, rng):
    metric, _ = METRICS[name]
    batch = jnp.asarray(rng.standard_normal((3, 301)))
    np.testing.assert_allclose(jax.jit(jax.vmap(metric))(batch), jnp.stack([metric(row) for row in batch]), rtol=1e-13)


@pytest.mark.parametrize("name", [name for name in METRICS if name != "road_stress_factor"])
def test_scaling(name, signal):
    metric, power = METRICS[name]
    np.testing.assert_allclose(metric(3.0 * signal), 3.0**power * metric(signal), rtol=1e-12)


@pytest.mark.parametrize("name", DIFFERENTIABLE)
def test_gradient_equals_difference_along_a_direction(name, signal, rng):
    metric, _ = METRICS[name]
    direction, h = rng.standard_normal(301), 1e-5

    @jax.jit
    def slopes(x, d):
        difference = (metric(x + h * d) - metric(x - h * d)) / (2 * h)
        return difference, jax.grad(metric)(x) @ d, jax.jvp(metric, (x,), (d,))[1]

    difference, reverse, forward = slopes(signal, direction)
    assert abs(difference) > 1e-6
    np.testing.assert_allclose(reverse, difference, rtol=1e-6)
    np.testing.assert_allclose(forward, difference, rtol=1e-6)


@pytest.mark.parametrize("name", METRICS)
def test_nan_is_not_hidden(name, signal):
    metric, _ = METRICS[name]
    signal[17] = np.nan
    assert np.isnan(metric(signal))


@pytest.mark.parametrize(
    "metric",
    [
        metrics.rms,
        metrics.working_space_rms,
        lambda x: metrics.dynamic_load_coefficient(x, 5.0),
        lambda x: metrics.road_stress_factor(x, 5.0),
        lambda x: jnp.sum(metrics.power_spectral_density(x, 0.01)[1]),
        lambda x: metrics.dissipated_energy(x, x, 0.01),
    ],
)
def test_zero_signal_has_zero_gradient(metric):
    np.testing.assert_array_equal(jax.jit(jax.grad(metric))(jnp.zeros(50)), np.zeros(50))


ONE_SIGNAL = {
    "signal": [metrics.rms, metrics.peak, metrics.crest_factor, lambda x: metrics.power_spectral_density(x, 0.01)],
    "deflection": [metrics.working_space_rms, metrics.working_space_peak],
    "tyre_load_variation": [
        lambda x: metrics.dynamic_load_coefficient(x, 5.0),
        lambda x: metrics.road_stress_factor(x, 5.0),
    ],
    "tyre_load": [metrics.lift_off_fraction],
    "force": [lambda x: metrics.dissipated_energy(x, x, 0.01), lambda x: metrics.equivalent_damping(x, x)],
}


@pytest.mark.parametrize(("argument", "metric"), [(a, metric) for a, group in ONE_SIGNAL.items() for metric in group])
def test_errors_of_shape(argument, metric, unchecked):
    with pytest.raises(ValueError, match=rf"`{argument}` must have one axis, time, but is of shape \(9, 2\).*jax.vmap"):
        metric(np.ones((9, 2)))
    with pytest.raises(ValueError, match=rf"`{argument}` must hold at least \d samples?, but is of length 0"):
        metric(np.ones(0))


def test_names():
    assert all(hasattr(metrics, name) for name in metrics.__all__)
    assert len(metrics.__all__) == len(METRICS)
