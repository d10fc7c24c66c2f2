import tracemalloc

import numpy as np
import pytest
from scipy.signal import savgol_coeffs, savgol_filter

from jaxdamp.bench import RandomTest, estimate_velocity
from jaxdamp.bench.motion import savitzky_golay, savitzky_golay_factors


def _error(estimate: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean((estimate - truth) ** 2) / np.mean(truth**2)))


def _sine(rate: float, frequency: float, amplitude: float, cycles: float = 5):
    time = np.arange(int(rate * cycles / frequency)) / rate
    omega = 2 * np.pi * frequency
    return time, amplitude * np.sin(omega * time + 0.4), amplitude * omega * np.cos(omega * time + 0.4)


@pytest.mark.parametrize(("rate", "frequency"), [(2000, 60), (2000, 0.5), (300, 1.5), (200, 17.3)])
def test_clean_sine_is_exact(rate, frequency):
    time, stroke, truth = _sine(rate, frequency, 0.01)
    velocity, how = estimate_velocity(time, stroke)
    assert _error(velocity, truth) < 1e-10
    assert "harmonic regression" in how
    assert f"{frequency:g} Hz" in how


def test_noise_averages_out_at_its_theoretical_rate(rng):
    time, stroke, truth = _sine(2000, 5, 0.01)
    errors = []
    for _ in range(20):
        velocity, _ = estimate_velocity(time, stroke + 1e-4 * rng.standard_normal(len(time)))
        errors.append(_error(velocity, truth) ** 2)
    # amplitude, phase and frequency: three numbers, efficiently estimated
    expected = 1e-4 / 0.01 * np.sqrt(2) * np.sqrt(3 / len(time))
    assert 0.4 * expected < np.sqrt(np.mean(errors)) < 2 * expected
    assert _error(np.gradient(stroke + 1e-4 * rng.standard_normal(len(time)), time), truth) > 0.4


def test_mains_ripple_of_a_public_dyno_record(rng):
    """300 Hz, ripple of 0.14 mm peak to peak at about 50 Hz: differenced, it is 20 mm/s of false velocity."""
    time, stroke, truth = _sine(300, 1.5, 0.02)
    rippled = stroke + 7e-5 * np.sin(2 * np.pi * 50.3 * time)
    assert np.max(np.abs(np.gradient(rippled, time) - truth)) > 0.015
    for method, bound in ((None, 1e-4), ("savitzky-golay", 5e-3)):
        velocity, _ = estimate_velocity(time, rippled, method=method)
        assert _error(velocity, truth) < bound


def test_harmonics_of_a_distorted_sine(rng):
    time, stroke, truth = _sine(1000, 3, 0.02)
    omega = 2 * np.pi * 3
    stroke = stroke + 4e-4 * np.sin(2 * omega * time) + 2e-4 * np.cos(3 * omega * time)
    truth = truth + 8e-4 * omega * np.cos(2 * omega * time) - 6e-4 * omega * np.sin(3 * omega * time)
    velocity, how = estimate_velocity(time, stroke + 1e-5 * rng.standard_normal(len(time)))
    assert "3 harmonics" in how
    assert _error(velocity, truth) < 1e-3


def _with_rest():
    _, stroke, truth = _sine(1000, 2, 0.02, 6)
    rest = np.zeros(800)
    parts = [np.concatenate([rest, part, rest]) for part in (stroke - stroke[0], truth)]
    return np.arange(len(parts[0])) / 1000, *parts


def _growing():
    time, stroke, truth = _sine(1000, 2, 0.02, 6)
    grown = 1 + 0.05 * time / time[-1]
    return time, grown * stroke, grown * truth + 0.05 / time[-1] * stroke


def _triangle():
    time = _sine(1000, 2, 0.02, 6)[0]
    phase = (2 * time) % 1
    return time, 0.02 * (4 * np.abs(phase - 0.5) - 1), np.where(phase < 0.5, -0.16, 0.16)


def _random():
    test = RandomTest(duration=10.0)
    time = np.arange(5000) / 500
    return time, test.stroke(time), test.velocity(time)


def _short():
    return _sine(1000, 2, 0.02, 1.2)


@pytest.mark.parametrize(
    ("motion", "bound"), [(_with_rest, 0.07), (_growing, 0.01), (_triangle, 0.25), (_random, 0.01), (_short, 0.02)]
)
def test_what_is_not_steady_and_periodic_goes_to_savitzky_golay(motion, bound, rng):
    time, stroke, truth = motion()
    noisy = stroke + 1e-5 * rng.standard_normal(len(time))
    velocity, how = estimate_velocity(time, noisy)
    assert "Savitzky-Golay" in how
    assert _error(velocity, truth) < bound
    with pytest.raises(ValueError, match="no steady periodic motion"):
        estimate_velocity(time, noisy, method="harmonic")


@pytest.mark.parametrize(("noise", "bound"), [(0.0, 1e-4), (1e-5, 0.005), (1e-4, 0.025)])
@pytest.mark.parametrize(("rate", "frequency"), [(2000, 1.5), (2000, 10), (2000, 30)])
def test_savitzky_golay_window_follows_the_noise(rate, frequency, noise, bound, rng):
    time, stroke, truth = _sine(rate, frequency, 0.01)
    for _ in range(5 if noise else 1):
        noisy = stroke + noise * rng.standard_normal(len(time))
        velocity, _ = estimate_velocity(time, noisy, method="savitzky-golay")
        assert _error(velocity, truth) < bound
        assert _error(velocity, truth) < 0.5 * _error(np.gradient(noisy, time), truth)


def test_stroke_is_left_as_it_is(rng):
    time, stroke, _ = _sine(1000, 2, 0.02)
    before = stroke.copy()
    estimate_velocity(time, stroke)
    np.testing.assert_array_equal(stroke, before)


def test_bad_arguments():
    time, stroke, _ = _sine(1000, 2, 0.02)
    with pytest.raises(ValueError, match="`method`"):
        estimate_velocity(time, stroke, method="spline")
    with pytest.raises(ValueError, match="shape of the time"):
        estimate_velocity(time, stroke[1:])
    with pytest.raises(ValueError, match="only 10 samples"):
        estimate_velocity(time[:10], stroke[:10])
    with pytest.raises(ValueError, match="stroke is constant"):
        estimate_velocity(time, np.full_like(time, 0.1))
    with pytest.raises(ValueError, match="stroke is nan"):
        estimate_velocity(time, np.where(time == time[7], np.nan, stroke))


@pytest.mark.parametrize(("window", "order"), [(5, 3), (11, 4), (31, 5), (301, 3)])
@pytest.mark.parametrize("derivative", [0, 1])
def test_the_filter_is_that_of_scipy(window, order, derivative, rng):
    """At the ends too, where the polynomial of the last window goes on."""
    values = rng.standard_normal(400)
    expected = np.asarray(savgol_filter(values, window, order, deriv=derivative))
    ours = savitzky_golay(values, window, order, derivative)
    np.testing.assert_allclose(ours, expected, atol=1e-9 * np.max(np.abs(expected)))
    at, fitted = savitzky_golay_factors(window // 2, order, derivative)
    weights = at[window // 2] @ fitted
    coefficients = np.asarray(savgol_coeffs(window, order, deriv=derivative, use="dot"))
    np.testing.assert_allclose(weights, coefficients, atol=1e-9 * np.max(np.abs(coefficients)))


def test_a_long_window_takes_memory_by_its_length_alone(rng):
    """One cycle of ten seconds at 1 kHz took 800 MB: a number for each pair of samples of the longest window."""
    time = np.arange(2001) * 1e-3
    stroke = 0.01 * np.sin(np.pi * time) + 1e-5 * rng.standard_normal(time.size)
    tracemalloc.start()
    try:
        estimate_velocity(time, stroke)
        savitzky_golay(stroke, 2001, 4, 1)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 1000 * 8 * time.size  # 16 MB


def _slow_and_fast(t):
    w = 2 * np.pi
    x = 0.02 * np.sin(0.5 * w * t) + 0.002 * np.sin(8 * w * t)
    return x, w * (0.01 * np.cos(0.5 * w * t) + 0.016 * np.cos(8 * w * t))


def _wide_band(t):
    x, v = np.zeros_like(t), np.zeros_like(t)
    for f, phase in zip(np.linspace(0.5, 20.0, 60), np.random.default_rng(0).uniform(0, 6, 60), strict=True):
        x, v = x + 0.002 / f * np.sin(2 * np.pi * f * t + phase), v + 0.004 * np.pi * np.cos(2 * np.pi * f * t + phase)
    return x, v


def _rounded_triangle(t):
    near, w = 1.0 - 1e-3, 2 * np.pi
    inner = near * np.sin(w * t)
    return 0.0127 * np.arcsin(inner), 0.0127 * near * w * np.cos(w * t) / np.sqrt(1.0 - inner**2)


def _slow_and_a_little_fast(t):
    w = 2 * np.pi
    x = 0.02 * np.sin(0.5 * w * t) + 0.0004 * np.sin(20 * w * t)
    return x, w * (0.01 * np.cos(0.5 * w * t) + 0.008 * np.cos(20 * w * t))


def _sweep(t):
    """0.25 to 25 Hz of constant speed within a stroke: the fast end is a small part of the stroke, at the end alone."""
    growth = np.log(100.0) / 8.0
    rate = 0.5 * np.pi * np.exp(growth * t)
    phase, size = (rate - rate[0]) / growth, np.minimum(0.05, 0.3 / rate)
    v = size * rate * np.cos(phase) - np.where(size < 0.05, size * growth * np.sin(phase), 0.0)
    return size * np.sin(phase), v


@pytest.mark.parametrize("motion", [_sweep, _slow_and_fast, _slow_and_a_little_fast, _wide_band, _rounded_triangle])
@pytest.mark.parametrize("noise", [0.0, 2e-6])
def test_fast_motion_is_no_noise(motion, noise, rng):
    """Above ten times the frequency of the motion too: the velocity was up to 85 % wrong."""
    t = np.arange(8000) / 1000
    x, v = motion(t)
    velocity, how = estimate_velocity(t, x + noise * rng.standard_normal(t.size))
    assert "ripple" not in how
    assert np.std(velocity - v) < 0.02 * np.std(v)


@pytest.mark.parametrize("shape", [np.sin, lambda phase: np.arcsin(0.99 * np.sin(phase))])
@pytest.mark.parametrize("cycles", [3, 6])
def test_coloured_noise_of_the_stroke_is_no_motion(shape, cycles, rng):
    """32 micrometres below 10 Hz on a slow stroke of 2 mm: the velocity was mostly this noise."""
    t = np.arange(cycles * 2000) / 200
    stroke = 0.002 * shape(2 * np.pi * 0.1 * t)
    lines = np.fft.rfft(rng.standard_normal(t.size)) / (1 + (np.fft.rfftfreq(t.size, 1 / 200) / 10) ** 2)
    noise = np.fft.irfft(lines, t.size)
    velocity, how = estimate_velocity(t, stroke + 3.2e-5 * noise / np.std(noise))
    truth = np.gradient(stroke, t)
    assert np.std(velocity - truth) < 0.15 * np.std(truth)
    assert "without ripple above 1 Hz of" in how


def test_ripple_of_the_mains_is_left_out_and_named():
    t = np.arange(20000) / 1000
    grown = 0.002 * (1.0 + 0.1 * t / 20) * np.sin(2 * np.pi * 0.2 * t)
    velocity, how = estimate_velocity(t, grown + 1e-5 * np.sin(2 * np.pi * 50 * t))
    assert np.std(velocity - np.gradient(grown, t)) < 0.005 * np.std(velocity)
    assert "without ripple above 2 Hz of" in how
