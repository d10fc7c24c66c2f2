from typing import Any

import numpy as np
import pytest

from jaxdamp.bench import RandomTest, SineTest, programmes


@pytest.mark.parametrize("test", [SineTest(0.01, 3.0), SineTest(0.02, 0.5, warm_up_cycles=0), RandomTest(seed=3)])
def test_velocity_is_the_derivative_of_the_stroke(test):
    time = np.linspace(-1.2 * test.warm_up - 0.01, test.duration, 2001)[1:-1]
    h = 1e-6
    difference = (test.stroke(time + h) - test.stroke(time - h)) / (2 * h)
    np.testing.assert_allclose(test.velocity(time), difference, atol=1e-7)


@pytest.mark.parametrize("test", [SineTest(0.01, 3.0), RandomTest(seed=3)])
def test_warm_up_grows_out_of_rest(test):
    start = np.array([-test.warm_up, -test.warm_up - 1.0])
    np.testing.assert_array_equal(test.stroke(start), 0.0)
    np.testing.assert_array_equal(test.velocity(start), 0.0)
    grid = np.linspace(-1.1 * test.warm_up, 0.5, 20001)
    steps = np.diff(test.velocity(grid)) / np.diff(grid)
    assert np.max(np.abs(np.diff(steps))) < 0.02 * np.max(np.abs(steps))  # no jump of the acceleration


ENDS: dict[str, Any] = {"rest_before": 0.5, "run_up": 0.6, "run_down": 0.4, "rest_after": 0.3}


@pytest.mark.parametrize("test", [SineTest(0.01, 3.0, **ENDS), RandomTest(duration=6.0, seed=3, **ENDS)])
def test_rest_and_ramps(test):
    time = np.linspace(-0.1, test.duration + 0.1, 30001)
    stroke, velocity = test.stroke(time), test.velocity(time)
    end = test.duration - 0.3
    at_rest = (time <= 0.5) | (time >= end)
    assert test.warm_up == 0.0
    np.testing.assert_array_equal(stroke[at_rest], 0.0)
    np.testing.assert_array_equal(velocity[at_rest], 0.0)
    h = time[1] - time[0]
    np.testing.assert_allclose(velocity[1:-1], (stroke[2:] - stroke[:-2]) / (2 * h), atol=1e-4 * velocity.max())
    assert np.max(np.abs(np.diff(velocity))) < 5e-3 * np.max(velocity)  # no jump at the joints


def test_full_amplitude_between_the_ramps():
    test = SineTest(0.01, 3.0, cycles=4, **ENDS)
    assert test.duration == pytest.approx(0.5 + 0.6 + 4 / 3 + 0.4 + 0.3)
    time = np.linspace(1.1, 1.1 + 4 / 3, 500)
    np.testing.assert_allclose(test.stroke(time), 0.01 * np.sin(6 * np.pi * (time - 1.1)), atol=1e-16)


def test_a_rest_needs_a_ramp_and_a_random_test_some_duration():
    with pytest.raises(ValueError, match="`run_up` must be positive beside a `rest_before`"):
        SineTest(0.01, 3.0, rest_before=1.0)
    with pytest.raises(ValueError, match="`run_down` must be positive beside a `rest_after`"):
        RandomTest(rest_after=1.0)
    with pytest.raises(ValueError, match="`duration` must be longer than rests and ramps together, 4 s"):
        RandomTest(duration=4.0, run_up=4.0)


def test_sine_is_steady_from_the_second_half_of_its_warm_up_on():
    test = SineTest(0.01, 3.0)
    time = np.linspace(-1 / 3, 1.0, 500)
    np.testing.assert_allclose(test.stroke(time), 0.01 * np.sin(6 * np.pi * time), atol=1e-17)


def test_random_test_keeps_its_limits_and_touches_one():
    time = np.linspace(0, 20, 200001)
    for seed in range(4):
        test = RandomTest(seed=seed)
        used = np.max(np.abs(test.stroke(time))) / 0.006, np.max(np.abs(test.velocity(time))) / 0.06
        assert max(used) <= 1.0
        assert max(used) > 0.999
        assert min(used) > 0.8  # paper 001 states both limits
        assert test.peak_velocity == pytest.approx(used[1] * 0.06, rel=1e-3)


def test_random_test_is_reproducible_and_band_limited():
    time = np.arange(4000) / 200
    one, same, other = (RandomTest(seed=seed).stroke(time) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.max(np.abs(one - other)) > 0.003
    spectrum, frequency = np.abs(np.fft.rfft(one)) ** 2, np.fft.rfftfreq(4000, 1 / 200)
    inside = (frequency >= 0.25) & (frequency <= 2.5)
    assert np.sum(spectrum[~inside]) < 1e-20 * np.sum(spectrum[inside])


def test_paper_000_table_1():
    tests = programmes.paper_000_table_1()
    peaks = np.array([test.peak_velocity for test in tests])
    assert len(tests) == len({test.name for test in tests}) == 30
    shown = next(test for test in tests if test.name == "15mm_15Hz")  # figure 3 of the paper
    assert (shown.amplitude, shown.frequency) == (0.0075, 15.0)
    assert peaks.min() == pytest.approx(0.0157, abs=5e-5)
    assert peaks.max() == pytest.approx(1.571, abs=5e-4)
    assert (np.sum(peaks > 1.3), np.sum(peaks > 1.5)) == (2, 1)
    doubled = np.array([test.peak_velocity for test in programmes.paper_000_table_1("zero-to-peak", cycles=5)])
    np.testing.assert_allclose(doubled, 2 * peaks)
    assert (np.sum(doubled > 1.3), np.sum(doubled > 1.5)) == (15, 14)
    with pytest.raises(ValueError, match=r"`reading`.*Did you mean 'peak-to-peak'"):
        programmes.paper_000_table_1("peak to peak")


def test_qct_545_and_paper_003():
    tests = programmes.qct_545()
    assert len(tests) == 16
    assert tests[-1].name == "20mm_2.5Hz"
    assert max(test.peak_velocity for test in tests) == pytest.approx(0.314, abs=2e-4)
    peaks = [test.peak_velocity for test in programmes.paper_003()]
    assert peaks == pytest.approx([0.1571, 0.2199], abs=5e-5)


def test_bad_tests():
    with pytest.raises(ValueError, match="`amplitude` must be positive"):
        SineTest(-0.01, 1.0)
    with pytest.raises(ValueError, match="`cycles`"):
        SineTest(0.01, 1.0, cycles=0)
    with pytest.raises(ValueError, match="`band` must hold two multiples"):
        RandomTest(band=(1.01, 1.02))
    with pytest.raises(ValueError, match="`velocity_limit`"):
        RandomTest(velocity_limit=0.0)


@pytest.mark.parametrize("rate", [400.0, 401.0, 399.7])
def test_random_motion_by_a_transform_is_the_sum_of_its_lines(rate):
    test = RandomTest(duration=9.0, band=(0.3, 12.0), seed=4)
    time = np.arange(-700, 4000) / rate
    order = np.random.default_rng(0).permutation(len(time))  # of scattered instants each line is summed
    for motion in (test.stroke, test.velocity):
        np.testing.assert_allclose(motion(time)[order], motion(time[order]), rtol=0, atol=1e-12)
