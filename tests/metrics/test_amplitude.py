import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import beta

from jaxdamp.metrics import crest_factor, peak, rms, settling_time, smooth_peak, vibration_dose_value


CYCLE = np.sin(2 * np.pi * np.arange(128) / 128)


def test_rms_of_a_sine():
    assert float(rms(3.0 * CYCLE)) == pytest.approx(3.0 / np.sqrt(2), rel=1e-14)


def test_rms_keeps_the_mean():
    assert float(rms(2.0 + 3.0 * CYCLE)) == pytest.approx(np.sqrt(4.0 + 4.5), rel=1e-14)


def test_rms_gradient_is_the_closed_form():
    x = jnp.asarray(0.5 + CYCLE)
    np.testing.assert_allclose(jax.jit(jax.grad(rms))(x), x / (128 * rms(x)), rtol=1e-13)


def test_rms_gradient_in_amplitude():
    assert float(jax.jit(jax.grad(lambda a: rms(a * jnp.asarray(CYCLE))))(0.3)) == pytest.approx(
        1 / np.sqrt(2), rel=1e-13
    )
    assert float(jax.jit(jax.grad(lambda a: rms(a * jnp.asarray(CYCLE))))(0.0)) == 0.0


def test_peak_is_the_largest_magnitude():
    assert float(peak(np.array([0.5, -2.5, 2.0]))) == 2.5
    np.testing.assert_array_equal(jax.jit(jax.grad(peak))(jnp.array([0.5, -2.5, 2.0])), [0.0, -1.0, 0.0])


def test_crest_factors():
    assert float(crest_factor(0.01 * CYCLE)) == pytest.approx(np.sqrt(2), rel=1e-14)
    assert float(crest_factor(np.sign(CYCLE + 1e-3))) == pytest.approx(1.0, rel=1e-14)
    assert np.isnan(crest_factor(np.zeros(5)))


@pytest.mark.parametrize("order", [2, 8, 16, 33.5])
def test_smooth_peak_of_a_sine(order):
    # (1/pi B((p+1)/2, 1/2))^(1/p)
    wave = 3.0 * np.sin(2 * np.pi * (np.arange(4096) + 0.5) / 4096)
    expected = 3.0 * (beta((order + 1) / 2, 0.5) / np.pi) ** (1 / order)
    assert float(smooth_peak(wave, order)) == pytest.approx(expected, rel=1e-6)


def test_smooth_peak_lies_below_the_peak_and_rises_to_it(rng):
    signal = rng.standard_normal(500)
    values = [float(smooth_peak(signal, order)) for order in (2, 4, 16, 64, 1000)]
    assert values == sorted(values)
    assert values[0] == pytest.approx(float(rms(signal)), rel=1e-13)
    for value, order in zip(values, (2, 4, 16, 64, 1000), strict=True):
        assert float(peak(signal)) / 500 ** (1 / order) <= value < float(peak(signal))
    assert values[-1] == pytest.approx(float(peak(signal)), rel=0.01)


def test_smooth_peak_does_not_overflow_and_does_not_see_the_sampling():
    assert float(smooth_peak(1e200 * CYCLE)) == pytest.approx(1e200 * float(smooth_peak(CYCLE)), rel=1e-12)
    assert float(smooth_peak(np.repeat(CYCLE, 7))) == pytest.approx(float(smooth_peak(CYCLE)), rel=1e-13)


def test_smooth_peak_gradient_is_shared_by_all_large_samples():
    gradient = jax.jit(jax.grad(smooth_peak))(jnp.array([1.0, -0.99, 0.1]))
    assert gradient[0] > -gradient[1] > 0.3 * gradient[0] > 0.0
    np.testing.assert_array_equal(jax.jit(jax.grad(smooth_peak))(jnp.zeros(4)), np.zeros(4))


@pytest.mark.parametrize(("order", "message"), [(1, "be at least 2, but is 1"), (np.nan, "be finite, but is nan")])
def test_smooth_peak_errors(order, message):
    with pytest.raises(ValueError, match=rf"`order` must {message}"):
        smooth_peak(CYCLE, order)


def test_instants_in_place_of_the_interval_and_complex_signals_are_refused(unchecked):
    signal = np.sin(np.arange(200.0))
    for metric in (lambda dt: vibration_dose_value(signal, dt, None), lambda dt: settling_time(signal, dt)):
        with pytest.raises(ValueError, match=r"`dt` must be one number, but is of shape \(200,\).*evenly spaced"):
            metric(np.full(200, 0.01))
    with pytest.raises(ValueError, match="`signal` must be real, but is of type complex"):
        rms(1j * signal)
