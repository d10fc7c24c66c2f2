import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.metrics import damping_ratio, logarithmic_decrement, settling_time, smooth_settling_time


TIME = np.arange(4000) * 0.005


def free_decay(ratio: float, frequency: float = 1.2, phase: float = 0.4) -> np.ndarray:
    """A free decay with an undamped frequency [Hz]."""
    w = 2 * np.pi * frequency
    return np.exp(-ratio * w * TIME) * np.cos(w * np.sqrt(1 - ratio**2) * TIME + phase)


@pytest.mark.parametrize("band", [0.05, 0.02])
def test_settling_of_an_exponential(band):
    # straight lines between the samples of an exponential: within (s dt)^2/8 of a time constant
    expected = np.log(1 / band) / 1.5
    decay = 4.0 * np.exp(-1.5 * TIME)
    assert float(settling_time(decay, 0.005, band)) == pytest.approx(expected, abs=1e-5)
    assert float(settling_time(0.3 - decay, 0.005, band, final=0.3)) == pytest.approx(expected, abs=1e-5)


def test_settling_is_the_last_crossing():
    wave = free_decay(0.1, phase=0.0)
    time = float(settling_time(wave, 0.005))
    after = np.abs(wave[TIME > time])
    assert np.all(after <= 0.05) and np.interp(time, TIME, np.abs(wave)) == pytest.approx(0.05, abs=1e-6)


def test_settling_at_the_edges():
    assert float(settling_time(np.zeros(9), 0.1)) == 0.0
    assert float(settling_time(np.ones(9), 0.1)) == np.inf
    assert float(settling_time(np.array([1.0, 0.0]), 0.1)) == pytest.approx(0.095)
    assert np.isnan(settling_time(np.array([1.0, np.nan, 0.0]), 0.1))
    gradient = jax.jit(jax.grad(lambda x: settling_time(x, 0.1)))(jnp.zeros(9))
    assert np.all(np.isfinite(gradient))


@pytest.mark.parametrize("decay_rate", [0.8, 2.5])
def test_smooth_settling_of_an_exponential(decay_rate):
    decay = np.exp(-decay_rate * np.arange(40000) * 0.001)
    expected = np.log(20.0) / decay_rate
    # the sums miss the integrals by half a step
    assert float(smooth_settling_time(decay, 0.001)) == pytest.approx(expected, rel=2 * decay_rate * 0.001)


@pytest.mark.parametrize("ratio", [0.05, 0.1, 0.2])
def test_smooth_settling_of_an_oscillation(ratio):
    envelope = np.log(20.0) / (ratio * 2 * np.pi * 1.2)
    assert float(smooth_settling_time(free_decay(ratio, phase=0.0), 0.005)) == pytest.approx(envelope, rel=2.5 * ratio)
    # and it falls with damping, as the exact one does on the whole
    assert smooth_settling_time(free_decay(1.1 * ratio), 0.005) < smooth_settling_time(free_decay(ratio), 0.005)


@pytest.mark.parametrize("ratio", [0.005, 0.05, 0.2, 0.36779])
def test_decrement_of_a_free_decay(ratio):
    # turning points by parabolas through samples 1/170 cycle apart
    decrement = logarithmic_decrement(0.01 * free_decay(ratio))
    assert float(decrement) == pytest.approx(2 * np.pi * ratio / np.sqrt(1 - ratio**2), rel=1e-4)
    assert float(damping_ratio(decrement)) == pytest.approx(ratio, rel=1e-4)


def test_decrement_about_another_rest():
    wave = 0.25 + free_decay(0.1)
    assert float(logarithmic_decrement(wave, final=0.25)) == pytest.approx(0.63148, rel=1e-4)


def test_decrement_of_an_asymmetric_decay_is_the_mean():
    # half-waves fall by 0.2 after a high, by 0.6 after a low; a full cycle by 0.8
    heights = np.exp(-np.cumsum([0, 0.2, 0.6, 0.2, 0.6, 0.2, 0.6]))
    wave = np.concatenate([h * (-1) ** i * np.sin(np.pi * np.arange(100) / 100) for i, h in enumerate(heights)])
    # a regression over seven points that alternate about the line
    assert float(logarithmic_decrement(wave)) == pytest.approx(0.8, rel=0.05)


def test_decrement_counts_a_flat_top_once():
    wave = np.array([0.0, 1.0, 1.0, 0.0, -0.5, -0.5, 0.0, 0.25, 0.25, 0.0])
    # a parabola through (0, 1, 1) peaks at 1 + 1/8 of the drop, the same part each time
    assert float(logarithmic_decrement(wave)) == pytest.approx(2 * np.log(2.0), rel=1e-12)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_decrement_of_a_digitised_decay(bits):
    # steps of the converter make plateaus, of up to some hundred samples at a top; the tops are half a step off
    time, step = np.arange(4000) * 0.001, 2.0 / 2**bits
    wave = np.round(np.exp(-0.8 * time) * np.cos(4.0 * np.pi * time) / step) * step
    assert float(logarithmic_decrement(wave)) == pytest.approx(0.4, rel=2.0 * step)


def test_small_turning_points_are_left_out(rng):
    wave = free_decay(0.05) + 1e-3 * np.sin(2 * np.pi * 23.0 * TIME)
    exact = 2 * np.pi * 0.05 / np.sqrt(1 - 0.05**2)
    assert abs(float(logarithmic_decrement(wave, threshold=0.0)) / exact - 1) > 0.5
    smooth = free_decay(0.05)
    assert float(logarithmic_decrement(smooth, threshold=0.3)) == pytest.approx(exact, rel=1e-4)


def test_without_turning_points_there_is_no_decrement():
    assert np.isnan(logarithmic_decrement(np.exp(-TIME)))
    assert np.isnan(logarithmic_decrement(np.zeros(20)))
    assert np.isnan(logarithmic_decrement(np.repeat([0.0, 1.0, 2.0, 3.0], 3)))  # steps of one direction


def test_damping_ratio_gradient():
    zeta = jax.jit(jax.grad(damping_ratio))(0.0)
    assert float(zeta) == pytest.approx(1 / (2 * np.pi), rel=1e-12)


@pytest.mark.parametrize("metric", [settling_time, smooth_settling_time])
def test_errors(metric):
    with pytest.raises(ValueError, match=r"`band` must lie between 0 and 1, but is 5.0.*write 0.05 for 5 %"):
        metric(np.ones(9), 0.1, 5.0)
    with pytest.raises(ValueError, match=r"`dt` must be positive and finite, but is -0.1"):
        metric(np.ones(9), -0.1)
    with pytest.raises(ValueError, match=r"`final` must be finite, but is nan"):
        metric(np.ones(9), 0.1, final=np.nan)
    with pytest.raises(ValueError, match=r"`signal` must hold at least 2 samples"):
        metric(np.ones(1), 0.1)


def test_errors_of_the_decrement():
    with pytest.raises(ValueError, match=r"`signal` must hold at least 5 samples, but is of length 4"):
        logarithmic_decrement(np.ones(4))
    with pytest.raises(ValueError, match=r"`threshold` must be at least 0 and below 1, but is 2"):
        logarithmic_decrement(np.ones(9), threshold=2.0)
    with pytest.raises(ValueError, match=r"`decrement` must be finite, but is nan.*two turning points"):
        damping_ratio(np.nan)
