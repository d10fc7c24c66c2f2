"""What holds for all metrics of signals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import metrics
from jaxdamp._guesses import shared_names


pytestmark = pytest.mark.slow

DT = 0.01
FREQUENCY = np.arange(1.0, 302.0)
EDGES = np.array([-np.inf, -0.5, 0.5, np.inf])


def of_power(metric):
    """A metric of a power spectral density, given the square of the signal."""
    return lambda x: metric(jnp.asarray(FREQUENCY, x.dtype), x * x)


# name -> (metric of one signal as one number, the power of the scale of the signal it grows with; None: no power)
METRICS = {
    "rms": (metrics.rms, 1),
    "peak": (metrics.peak, 1),
    "smooth_peak": (metrics.smooth_peak, 1),
    "crest_factor": (metrics.crest_factor, 0),
    "running_rms": (lambda x: jnp.sum(metrics.running_rms(x, DT, 0.333)), 1),
    "working_space_rms": (metrics.working_space_rms, 1),
    "working_space_mean": (metrics.working_space_mean, 1),
    "working_space_peak_to_peak": (metrics.working_space_peak_to_peak, 1),
    "working_space_exceedance": (lambda x: metrics.working_space_exceedance(x, -1.0, 1.5), None),
    "gaussian_exceedance": (lambda x: metrics.gaussian_exceedance(x[3], metrics.rms(x), -1.0, 1.5), None),
    "dynamic_load_coefficient": (lambda x: metrics.dynamic_load_coefficient(x, 5.0), 1),
    "road_stress_factor": (lambda x: metrics.road_stress_factor(x, 5.0), None),
    "lift_off_fraction": (metrics.lift_off_fraction, 0),
    "aggregate_force": (lambda x: jnp.sum(metrics.aggregate_force(jnp.stack([x, 2 * x]), [0.0, 0.123], DT)), 4),
    "aggregate_force_percentile": (lambda x: metrics.aggregate_force_percentile(x), 1),
    "dissipated_energy": (lambda x: metrics.dissipated_energy(x, x, DT), 2),
    "dissipated_power": (lambda x: metrics.dissipated_power(x, x), 2),
    "equivalent_damping": (lambda x: metrics.equivalent_damping(x * x * x, x), 2),
    "velocity_histogram": (lambda x: metrics.velocity_histogram(x, EDGES, width=0.3)[1], None),
    "dissipation_histogram": (lambda x: metrics.dissipation_histogram(x, x, EDGES, width=0.3)[1], None),
    "damper_temperature": (lambda x: metrics.damper_temperature(x * x, DT, 3.0, 0.5, 0.0)[-1], 2),
    "temperature_rise": (lambda x: metrics.temperature_rise(metrics.rms(x), 4.0, 3.0, 0.5), 1),
    "power_spectral_density": (lambda x: jnp.sum(metrics.power_spectral_density(x, DT, 64)[1]), 2),
    "transmissibility": (lambda x: jnp.abs(metrics.transmissibility(x, x * x, DT, 64)[1][7]), 1),
    "coherence": (lambda x: metrics.coherence(x, x * x, DT, 64)[1][7], 0),
    "weighted_signal": (lambda x: metrics.weighted_signal(x, DT, "Wk", method="step")[200], 1),
    "weighted_rms": (lambda x: metrics.weighted_rms(x, DT, "Wd"), 1),
    "max_transient_value": (lambda x: metrics.max_transient_value(x, DT, None), 1),
    "vibration_dose_value": (lambda x: metrics.vibration_dose_value(x, DT, None), 1),
    "estimated_vibration_dose_value": (lambda x: metrics.estimated_vibration_dose_value(metrics.rms(x), 9.0), 1),
    "motion_sickness_dose": (lambda x: metrics.motion_sickness_dose(x, DT), 1),
    "motion_sickness_percentage": (lambda x: metrics.motion_sickness_percentage(metrics.rms(x)), 1),
    "shock_ratios": (lambda x: sum(metrics.shock_ratios(x, DT, None)), 0),
    "vibration_total_value": (lambda x: metrics.vibration_total_value({"seat_z": x[3], "floor_z": x[4]}), 1),
    "total_vibration": (lambda x: metrics.total_vibration({"seat_z": x, "seat_pitch": x}, DT), 1),
    "settling_time": (lambda x: metrics.settling_time(x, DT, 0.5), 0),
    "smooth_settling_time": (lambda x: metrics.smooth_settling_time(x, DT), 0),
    "logarithmic_decrement": (metrics.logarithmic_decrement, 0),
    "damping_ratio": (lambda x: metrics.damping_ratio(metrics.logarithmic_decrement(x)), 0),
    "spectral_moments": (of_power(lambda f, g: metrics.spectral_moments(f, g)[2]), 2),
    "spectral_damage": (of_power(lambda f, g: metrics.spectral_damage(f, g, 4)), 4),
    "international_roughness_index": (lambda x: metrics.international_roughness_index(x, 0.05), 1),
    "international_roughness_by_segment": (
        lambda x: metrics.international_roughness_by_segment(x, 0.05, segment=5.0).segments[-1],
        1,
    ),
}
# Numbers of frequencies, words, tables and types.
OTHERS = {
    "AXES",
    "Evaluation",
    "Gathered",
    "Metric",
    "MetricValues",
    "Reduction",
    "rainflow_cycles",  # neither compiled nor differentiated
    "RoughnessBySegment",
    "STATISTICS",
    "ShockRatios",
    "StateSpace",
    "Statistic",
    "Term",
    "percentile",
    "comfort_reaction",
    "current_name",
    "current_names",
    "evaluation_method",
    "weighting_factor",
    "weighting_response",
    "weighting_state_space",
    "discrete_weighting",
    "third_octave_rms",
    "lift_off_below",
}
COUNTS = {"lift_off_fraction", "working_space_exceedance"}
DIFFERENTIABLE = [name for name in METRICS if name not in COUNTS]


def everything(signal):
    """All metrics at once: one function to compile."""
    return jnp.stack([metric(signal) for metric, _ in METRICS.values()])


compiled = jax.jit(everything)
batched = jax.jit(jax.vmap(everything))
forward = jax.jit(lambda signal, direction: jax.jvp(everything, (signal,), (direction,))[1])


def value(name, signal):
    """One of the metrics, compiled with all others."""
    return compiled(signal)[list(METRICS).index(name)]


@pytest.fixture
def signal(rng):
    return rng.standard_normal(301) + 0.3


@pytest.mark.parametrize("name", METRICS)
def test_compiled_equals_plain_and_numpy_equals_jax(name, signal):
    metric, _ = METRICS[name]
    plain = metric(jnp.asarray(signal))
    assert plain.shape == () and plain.dtype == jnp.float64
    np.testing.assert_allclose(value(name, signal), plain, rtol=1e-12)
    np.testing.assert_array_equal(metric(signal), plain)


def test_single_precision_is_kept(signal):
    single = compiled(signal.astype(np.float32))
    assert single.dtype == jnp.float32  # of the stack: strict promotion refuses a mixture
    np.testing.assert_allclose(single, compiled(signal), rtol=1e-4)


def test_batch_equals_loop(rng):
    batch = jnp.asarray(rng.standard_normal((3, 301)))
    np.testing.assert_allclose(batched(batch), jnp.stack([compiled(row) for row in batch]), rtol=1e-11)


@pytest.mark.parametrize("name", [name for name, (_, power) in METRICS.items() if power is not None])
def test_scaling(name, signal):
    np.testing.assert_allclose(value(name, 3.0 * signal), 3.0 ** METRICS[name][1] * value(name, signal), rtol=1e-11)


@pytest.mark.parametrize("name", DIFFERENTIABLE)
def test_gradient_equals_difference_along_a_direction(name, signal, rng):
    direction, h, i = rng.standard_normal(301), 1e-5, list(METRICS).index(name)
    difference = (value(name, signal + h * direction) - value(name, signal - h * direction)) / (2 * h)
    assert abs(difference) > 1e-6
    np.testing.assert_allclose(forward(signal, direction)[i], difference, rtol=1e-6)


def test_reverse_equals_forward(signal, rng):
    # along one direction and for one mixture of the metrics, to which each adds about as much
    direction = rng.standard_normal(301)
    slopes = forward(signal, direction)
    mixture = jnp.where(slopes == 0.0, 1.0, rng.uniform(0.5, 1.5, len(METRICS)) / slopes)
    gradient = jax.jit(lambda x, c: jax.vjp(everything, x)[1](c)[0])(signal, mixture)
    np.testing.assert_allclose(gradient @ direction, mixture @ slopes, rtol=1e-10)


@pytest.mark.parametrize("name", METRICS)
def test_nan_is_not_hidden(name, signal):
    signal[3] = np.nan
    assert np.isnan(value(name, signal))


def test_zero_signal_has_zero_gradient():
    names = """rms smooth_peak running_rms working_space_rms dynamic_load_coefficient road_stress_factor
        power_spectral_density dissipated_energy weighted_rms vibration_dose_value motion_sickness_dose
        vibration_total_value total_vibration""".split()
    total = lambda x: jnp.sum(jnp.stack([METRICS[name][0](x) for name in names]))  # noqa: E731
    np.testing.assert_array_equal(jax.jit(jax.grad(total))(jnp.zeros(301)), np.zeros(301))


ONE_SIGNAL = {
    "signal": [
        metrics.rms,
        metrics.peak,
        metrics.crest_factor,
        metrics.smooth_peak,
        metrics.logarithmic_decrement,
        lambda x: metrics.power_spectral_density(x, 0.01),
        lambda x: metrics.running_rms(x, 0.01),
        lambda x: metrics.settling_time(x, 0.01),
    ],
    "acceleration": [
        lambda x: metrics.weighted_rms(x, 0.01, "Wk"),
        lambda x: metrics.vibration_dose_value(x, 0.01, None),
        lambda x: metrics.max_transient_value(x, 0.01, "Wk"),
        lambda x: metrics.motion_sickness_dose(x, 0.01),
    ],
    "input_signal": [lambda x: metrics.transmissibility(x, x, 0.01), lambda x: metrics.coherence(x, x, 0.01)],
    "velocity": [lambda x: metrics.velocity_histogram(x, EDGES)],
    "power": [lambda x: metrics.damper_temperature(x, 0.01, 1.0, 1.0, 0.0)],
    "profile": [lambda x: metrics.international_roughness_index(x, 0.1)],
    "frequency": [lambda x: metrics.spectral_damage(x, x, 4.0)],
    "deflection": [
        metrics.working_space_rms,
        metrics.working_space_peak_to_peak,
        lambda x: metrics.working_space_exceedance(x, -1.0, 1.0),
    ],
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
    names = {*metrics.__all__, *shared_names(metrics)}
    assert all(hasattr(metrics, name) for name in names)
    assert names == set(METRICS) | OTHERS
