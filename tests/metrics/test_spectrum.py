import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal

from jaxdamp.metrics import power_spectral_density


@pytest.fixture
def noise(rng):
    return 1.3 + np.cumsum(rng.standard_normal(5003)) * 0.1 + rng.standard_normal(5003)


@pytest.mark.parametrize("window", ["hann", "hamming", "blackman", "rectangular"])
@pytest.mark.parametrize("length", [500, 501])
@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.75])
def test_equals_scipy(noise, window, length, overlap):
    frequency, psd = power_spectral_density(noise, 0.002, length, overlap=overlap, window=window)
    f, expected = scipy.signal.welch(
        noise, 1 / 0.002, window="boxcar" if window == "rectangular" else window, nperseg=length,
        noverlap=int(overlap * length),
    )  # fmt: skip
    np.testing.assert_allclose(frequency, f, rtol=1e-14)
    np.testing.assert_allclose(psd, expected, rtol=1e-10, atol=1e-18)


def test_equals_scipy_with_the_mean_kept(noise):
    _, psd = power_spectral_density(noise, 0.002, 512, remove_mean=False)
    expected = scipy.signal.welch(noise, 500.0, nperseg=512, detrend=False)[1]  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(psd, expected, rtol=1e-10)


def test_default_is_fifteen_half_overlapped_segments(noise):
    signal = noise[:4000]
    _, psd = power_spectral_density(signal, 0.002)
    np.testing.assert_allclose(psd, scipy.signal.welch(signal, 500.0, nperseg=500, noverlap=250)[1], rtol=1e-10)


@pytest.mark.parametrize("size", [1000, 1001])
def test_one_rectangular_segment_integrates_to_the_variance(noise, size):
    frequency, psd = power_spectral_density(noise[:size], 0.002, size, window="rectangular")
    assert float(jnp.sum(psd) * frequency[1]) == pytest.approx(np.var(noise[:size]), rel=1e-12)


def test_white_noise_has_its_level_and_variance(rng):
    signal = 2.0 * rng.standard_normal(200_000)
    frequency, psd = power_spectral_density(signal, 0.01, 200)
    # variance of the sum over the spectrum: that of the sample variance, 2 sigma^4/n
    assert float(jnp.sum(psd) * frequency[1]) == pytest.approx(4.0, rel=4 * np.sqrt(2 / 200_000) + 1 / 200)
    # 1999 half-overlapped segments count as 0.947 of as many independent ones; the two ends have fewer
    np.testing.assert_allclose(psd[2:-1], 4.0 * 2 * 0.01, rtol=5 / np.sqrt(0.947 * 1999))


def test_sine_stands_at_its_frequency():
    signal = 0.7 * np.sin(2 * np.pi * 12.5 * np.arange(8000) * 0.001)
    frequency, psd = power_spectral_density(signal, 0.001, 800)
    assert float(frequency[jnp.argmax(psd)]) == pytest.approx(12.5)
    # a Hann line is 1.5 bins wide
    assert float(jnp.max(psd)) == pytest.approx(0.7**2 / 2 / (1.5 * 1.25), rel=1e-10)


def test_gradient_of_the_variance(noise):
    def variance(x):
        frequency, psd = power_spectral_density(x, 0.002, 1000, window="rectangular")
        return jnp.sum(psd) * frequency[1]

    x = jnp.asarray(noise[:1000])
    np.testing.assert_allclose(jax.jit(jax.grad(variance))(x), 2 * (x - x.mean()) / 1000, atol=1e-14)


def test_density_is_proportional_to_the_interval(noise):
    x = jnp.asarray(noise)
    slope = jax.jit(jax.grad(lambda dt: power_spectral_density(x, dt, 512)[1][7]))(0.002)
    assert float(slope) == pytest.approx(float(power_spectral_density(x, 1.0, 512)[1][7]), rel=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"dt": 0.0}, r"`dt` must be positive and finite, but is 0.0. It is the sampling interval in s"),
        (
            {"segment_length": 5004},
            r"`segment_length` must lie between 2 and the length of the signal \(5003\), but is 5004",
        ),
        ({"segment_length": 50.0}, r"`segment_length` must be a whole number of samples, but is 50.0"),
        ({"segment_length": 1}, r"`segment_length` must lie between 2 and .*but is 1. Shorten the segments"),
        ({"overlap": 50}, r"`overlap` must be at least 0 and below 1, but is 50.*write 0.5 for 50 %"),
        ({"overlap": -0.1}, r"`overlap` must be at least 0 and below 1, but is -0.1"),
        (
            {"window": "hanning"},
            r"`window` must be one of 'rectangular', 'hann'.*but is 'hanning'. Did you mean 'hann'\?",
        ),
    ],
)
def test_errors(noise, options, message, unchecked):
    with pytest.raises(ValueError, match=message):
        power_spectral_density(noise, **{"dt": 0.002, **options})


def test_one_sample_has_no_spectrum():
    with pytest.raises(ValueError, match=r"`signal` must hold at least 2 samples, but is of length 1"):
        power_spectral_density(np.ones(1), 0.002)
