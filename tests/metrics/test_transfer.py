import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal

from jaxdamp.metrics import coherence, transmissibility


@pytest.fixture
def pair(rng):
    x = rng.standard_normal(6001) + 0.4
    y = scipy.signal.lfilter([0.3, 0.2], [1.0, -0.7], x) + 0.5 * rng.standard_normal(6001)
    return x, y


@pytest.mark.parametrize(("window", "length", "overlap"), [("hann", 512, 0.5), ("blackman", 501, 0.75)])
def test_equal_scipy(pair, window, length, overlap):
    x, y = pair
    options = {"fs": 200.0, "window": window, "nperseg": length, "noverlap": int(overlap * length)}
    f, cross = scipy.signal.csd(x, y, **options)
    power = scipy.signal.welch(x, **options)[1]
    frequency, response = transmissibility(x, y, 0.005, length, overlap=overlap, window=window)
    np.testing.assert_allclose(frequency, f, rtol=1e-13)
    np.testing.assert_allclose(response[1:], (cross / power)[1:], rtol=1e-9)
    _, gamma2 = coherence(x, y, 0.005, length, overlap=overlap, window=window)
    np.testing.assert_allclose(gamma2[1:], scipy.signal.coherence(x, y, **options)[1][1:], rtol=1e-9)


def test_a_known_filter_is_found(pair):
    x, _ = pair
    y = np.asarray(scipy.signal.lfilter([0.3, 0.2], [1.0, -0.7], x))
    frequency, response = transmissibility(x, y, 0.005, 400)
    z = np.exp(-2j * np.pi * np.asarray(frequency) * 0.005)
    exact = (0.3 + 0.2 * z) / (1.0 - 0.7 * z)
    # what is left is the filter's memory at the edges of a segment, some 3 of 400 samples
    np.testing.assert_allclose(response[2:], exact[2:], rtol=0.02, atol=0.005)
    _, gamma2 = coherence(x, y, 0.005, 400)
    assert float(jnp.min(gamma2[2:])) > 0.99


def test_signs_and_gain_are_exact(pair):
    x, _ = pair
    response = transmissibility(x, -3.0 * x, 0.005, 400, remove_mean=False)[1]
    np.testing.assert_allclose(response, -3.0, rtol=1e-12)


def test_noise_biases_at_the_input_only(pair, rng):
    x, _ = pair
    noise = rng.standard_normal(x.size)
    # 119 segments: a single value scatters by about 1/sqrt(119), the mean over 49 frequencies by 0.015
    output = transmissibility(x, x + noise, 0.005, 100)[1][1:-1]
    assert abs(complex(jnp.mean(output)) - 1.0) < 0.05
    # as much noise as signal: half of the response
    disturbed = transmissibility(x + noise, x, 0.005, 100)[1][1:-1]
    assert abs(complex(jnp.mean(disturbed)) - 0.5) < 0.05


def test_coherence_of_unrelated_and_of_half_related_signals(rng):
    x, noise = rng.standard_normal((2, 40_000))
    few = 0.947 * (2 * 40_000 / 200 - 1)  # independent segments
    assert float(jnp.mean(coherence(x, noise, 0.01, 200)[1])) == pytest.approx(1 / few, rel=0.3)
    assert float(jnp.mean(coherence(x, x + noise, 0.01, 200)[1])) == pytest.approx(0.5, abs=0.02)


def test_gradient(pair):
    x, y = (jnp.asarray(part[:400]) for part in pair)
    direction = jnp.cos(jnp.arange(400.0))

    def metric(y):
        gain = jnp.abs(transmissibility(x, y, 0.005, 64)[1][5])
        return gain + coherence(x, y, 0.005, 64)[1][5]

    slope = jax.jit(lambda y: jax.grad(metric)(y) @ direction)(y)
    difference = (metric(y + 1e-5 * direction) - metric(y - 1e-5 * direction)) / 2e-5
    assert float(slope) == pytest.approx(float(difference), rel=1e-6)


def test_errors(pair):
    x, y = pair
    for metric in (transmissibility, coherence):
        with pytest.raises(ValueError, match=r"`segment_length` must lie between 2 and the length.*but is 7000"):
            metric(x, y, 0.005, 7000)
        with pytest.raises(ValueError, match=r"`dt` must be positive and finite, but is -0.005"):
            metric(x, y, -0.005)
        with pytest.raises(ValueError, match=r"`window` must be one of.*Did you mean 'hann'\?"):
            metric(x, y, 0.005, window="han")


def test_one_segment_has_no_coherence(pair):
    x, y = (part[:100] for part in pair)
    with pytest.raises(ValueError, match=r"`segment_length` must leave two segments in 100 samples.*but is 80"):
        coherence(x, y, 0.01, 80)
    assert transmissibility(x, y, 0.01, 80)[1].shape == (41,)


def test_lengths_must_match(unchecked):
    for metric in (transmissibility, coherence):
        with pytest.raises(ValueError, match=r"`output_signal` must be as long as `input_signal` \(90 samples\)"):
            metric(np.ones(90), np.ones(80), 0.01)
