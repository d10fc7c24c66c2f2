import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from jaxdamp.metrics import max_transient_value, running_rms, smooth_peak, weighted_signal


@pytest.mark.parametrize("window", [0.1, 0.137, 1.0, 3.0])
def test_linear_averaging_equals_the_integral(rng, window):
    # the samples as a staircase, integrated by brute force on a hundred times finer grid
    signal, dt, fine = rng.standard_normal(300), 0.01, 100
    square = np.repeat(signal**2, fine)
    before = np.zeros(round(window / dt * fine))
    padded = np.concatenate([before, square])
    ends = before.size + fine * np.arange(1, 301)
    expected = [np.sqrt(np.mean(padded[end - before.size : end])) for end in ends]
    np.testing.assert_allclose(running_rms(signal, dt, window), expected, rtol=1e-9)


def test_exponential_averaging_equals_the_integral():
    dt, tau = 0.05, 0.4
    time = dt * np.arange(60)
    signal = np.sin(3.0 * time) * np.exp(-time)
    result = running_rms(signal, dt, tau, averaging="exponential")
    for k in (7, 23, 59):  # the square runs straight from sample to sample
        integrand = lambda s, k=k: np.interp(s, time, signal**2) * np.exp((s - time[k]) / tau) / tau  # noqa: E731
        expected = np.sqrt(quad(integrand, 0.0, time[k], points=time[1:k], limit=500)[0])
        assert float(result[k]) == pytest.approx(expected, rel=1e-9)


def test_steady_vibration_has_its_rms():
    sine = 1.7 * np.sin(2 * np.pi * 10.0 * np.arange(5000) * 0.001)
    np.testing.assert_allclose(running_rms(sine, 0.001)[1000:], 1.7 / np.sqrt(2), rtol=1e-12)
    # the lag follows the square's 20 Hz by 1/(40 pi tau) and has its own 1/40 s of delay at the start
    slow = running_rms(sine, 0.001, 0.5, averaging="exponential")[4000:]
    np.testing.assert_allclose(slow, 1.7 / np.sqrt(2), rtol=0.01)


def test_maximum_of_a_short_burst():
    # b seconds of amplitude a in one second: a sqrt(b/2), and a sqrt((1 - exp(-b))/2) with the exponential average
    burst = np.where(np.arange(4000) < 250, 2.0 * np.sin(2 * np.pi * 40.0 * np.arange(4000) * 0.001), 0.0)
    assert float(max_transient_value(burst, 0.001, None)) == pytest.approx(2.0 * np.sqrt(0.125), rel=1e-12)
    exponential = float(max_transient_value(burst, 0.001, None, averaging="exponential"))
    assert exponential == pytest.approx(2.0 * np.sqrt((1 - np.exp(-0.25)) / 2), rel=2e-3)
    longer = float(max_transient_value(burst, 0.001, None, time_constant=2.0))
    assert longer == pytest.approx(2.0 * np.sqrt(0.125 / 2), rel=1e-12)


def test_weighting_is_applied():
    sine = np.sin(2 * np.pi * 8.0 * np.arange(6000) * 0.001)
    weighted = weighted_signal(sine, 0.001, "Wd")
    assert float(max_transient_value(sine, 0.001, "Wd")) == float(max_transient_value(weighted, 0.001, None))
    # the start of the filter is in the first windows
    assert float(max_transient_value(sine, 0.001, "Wk")) == pytest.approx(1.0364 / np.sqrt(2), rel=1e-2)


def test_rest_after_a_shock_is_rest(rng):
    signal = np.concatenate([1e3 * rng.standard_normal(200), np.zeros(300)])
    assert float(running_rms(signal, 0.01)[-1]) == pytest.approx(0.0, abs=1e-4)  # sqrt of rounding of 1e8
    assert np.all(np.isfinite(jax.jit(jax.grad(lambda x: jnp.sum(running_rms(x, 0.01))))(jnp.asarray(signal))))


@pytest.mark.parametrize("window", [0.5, 1.0, 1.237])
def test_single_precision_hears_a_quiet_stretch_after_a_loud_one(rng, window):
    signal = np.concatenate([30.0 * rng.standard_normal(3000), 1e-3 * rng.standard_normal(2000)])
    exact = running_rms(signal, 1e-3, window)
    found = running_rms(jnp.asarray(signal, jnp.float32), 1e-3, window)
    np.testing.assert_allclose(found[1:], exact[1:], rtol=2e-6 if window < 1.1 else 2e-5)
    brute = [np.sqrt(np.mean(signal[end - 500 : end] ** 2)) for end in (500, 2999, 3400, 5000)]
    if window == 0.5:
        np.testing.assert_allclose(exact[np.array([499, 2998, 3399, 4999])], brute, rtol=1e-12)


def test_time_constant_may_be_traced_and_has_a_slope():
    signal = jnp.asarray(np.sin(2.0 * np.arange(400) * 0.01) + 0.2)

    def last(tau, averaging="linear"):
        return running_rms(signal, 0.01, tau, averaging=averaging)[-1]

    traced = jax.jit(lambda tau: last(tau, "exponential"))(0.7531)
    assert float(traced) == pytest.approx(float(last(0.7531, "exponential")), rel=1e-12)
    value, slope = jax.jit(jax.value_and_grad(last))(0.7531)
    assert float(value) == pytest.approx(float(last(0.7531)), rel=1e-12)
    assert float(slope) == pytest.approx(float(last(0.7541) - last(0.7521)) / 0.002, rel=1e-4)


def test_smooth_maximum_follows_the_maximum():
    burst = np.where(np.abs(np.arange(6000) - 3000) < 300, 2.0, 0.2)
    exact = float(max_transient_value(burst, 0.001, None))
    smooth = float(smooth_peak(running_rms(burst, 0.001), 16))
    assert 0.8 * exact < smooth < exact


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"time_constant": 2.0}, r"`time_constant` must lie between dt \(0.01 s\) and the length.*\(1 s\), but is 2.0"),
        ({"time_constant": 0.001}, r"`time_constant` must lie between dt"),
        ({"time_constant": -1.0}, r"`time_constant` must be positive and finite, but is -1.0"),
        ({"dt": 0.0}, r"`dt` must be positive and finite, but is 0.0"),
        ({"dt": 0.001}, r"`time_constant` must lie between.*Take a longer record"),
        (
            {"averaging": "exponent"},
            r"`averaging` must be one of 'linear', 'exponential'.*Did you mean 'exponential'\?",
        ),
    ],
)
def test_errors(options, message):
    with pytest.raises(ValueError, match=message):
        running_rms(np.ones(100), **{"dt": 0.01, **options})
