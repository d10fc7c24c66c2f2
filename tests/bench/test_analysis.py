"""Peak-velocity points and loops of sines, against the closed forms of the laws that made them."""

import numpy as np
import pytest

from jaxdamp.bench import (
    BenchRun,
    BenchSet,
    continuous_velocity_loop,
    last_steady_cycle,
    peak_velocity_points,
    steady_cycles,
)


RATE, LAG = 2000.0, 0.004  # N s/m, s


def lagging(frequency: float, amplitude: float = 0.01, cycles: float = 6.0, noise: float = 0.0, phase: float = 0.3):
    """A linear damper behind a first-order lag, settled: F = c v₀ cos(φ) cos(ωt − φ), tan φ = ω τ."""
    omega = 2 * np.pi * frequency
    time = np.arange(round(400 * cycles)) / (400 * frequency)
    angle, lag = omega * time + phase, np.arctan(omega * LAG)
    force = RATE * omega * amplitude * np.cos(lag) * np.cos(angle - lag)
    force = force + noise * np.random.default_rng(0).standard_normal(len(time))
    stroke, velocity = amplitude * np.sin(angle), omega * amplitude * np.cos(angle)
    return BenchRun(f"{frequency:g} Hz, {cycles:g} cycles", time, stroke, velocity, force)


# ---- cycles


def test_the_last_cycle_is_one_period_at_the_end():
    run = lagging(2.0)
    part = last_steady_cycle(run)
    assert len(run.time[part]) == pytest.approx(400, abs=2) and run.time[part][-1] > 2.5 - 0.01
    assert len(steady_cycles(run)) == run.cycles


def test_a_cycle_in_which_the_machine_runs_down_is_passed_over():
    time = np.arange(5000) / 1000
    size = np.where(time < 4.0, 0.01, 0.006)
    run = BenchRun.from_arrays("stop", time, size * np.sin(2 * np.pi * time), np.cos(2 * np.pi * time))
    part = last_steady_cycle(run)
    assert run.time[part][-1] == pytest.approx(4.0, abs=0.01) and np.ptp(run.stroke[part]) > 0.0199
    assert continuous_velocity_loop(run).cycles == (4,)


def test_a_record_without_a_full_cycle_is_taken_whole():
    time = np.arange(50) / 100
    run = BenchRun.from_arrays("half", time, 0.01 * np.sin(2 * time), np.cos(2 * time))
    assert run.cycles == 0 and steady_cycles(run) == []
    assert len(run.time[last_steady_cycle(run)]) == 50
    points = peak_velocity_points(run)  # all of it in rebound
    assert np.isnan(points.force[0, 0]) and points.velocity[0, 1] == pytest.approx(0.02, rel=0.05)
    with pytest.raises(ValueError, match=r"`runs` must be records with a full cycle, but is 'half'"):
        continuous_velocity_loop(run)


# ---- peak-velocity points


def test_peak_points_of_several_records_lie_on_the_closed_form():
    runs = BenchSet([lagging(f) for f in (1.0, 3.0, 8.0)])
    points = peak_velocity_points(runs)
    assert points.velocity.shape == points.force.shape == (3, 2)
    for (compression, rebound), forces, f in zip(points.velocity, points.force, (1.0, 3.0, 8.0), strict=True):
        # Over |angle| ≤ a with cos a = 0.98 the mean of cos is sin(a)/a, and the force's sine part is odd there.
        a, peak = np.arccos(0.98), 2 * np.pi * f * 0.01
        mean = np.sin(a) / a
        assert (compression, rebound) == pytest.approx((-peak * mean, peak * mean), rel=1e-3)
        through = RATE * peak * mean * np.cos(np.arctan(2 * np.pi * f * LAG)) ** 2
        assert tuple(forces) == pytest.approx((-through, through), rel=1e-2)


def test_compression_stands_before_rebound():
    time = np.arange(2000) / 1000
    velocity = 0.1 * np.cos(2 * np.pi * time)
    force = np.where(velocity > 0, 2600.0, 1200.0) * velocity
    run = BenchRun("bilinear", time, 0.1 / (2 * np.pi) * np.sin(2 * np.pi * time), velocity, force)
    points = peak_velocity_points(run)
    np.testing.assert_allclose(points.force / points.velocity, [[1200.0, 2600.0]], rtol=1e-12)


# ---- loops


def test_loops_of_several_records_follow_the_closed_form():
    loops = continuous_velocity_loop([lagging(1.0), lagging(5.0, cycles=3.0, phase=-2.0)], points=100)
    assert loops.force.shape == (2, 100) and loops.cycles == (5, 2)
    for row, frequency in enumerate((1.0, 5.0)):
        omega = 2 * np.pi * frequency
        start = np.arcsin(loops.stroke[row, 0] / 0.01)  # the first point is less than a step behind mid-stroke
        assert -1e-4 < start < 2 * np.pi / 100
        angle, lag = omega * loops.time[row] + start, np.arctan(omega * LAG)
        scale = omega * 0.01
        np.testing.assert_allclose(loops.stroke[row], 0.01 * np.sin(angle), atol=1e-4 * 0.01)
        np.testing.assert_allclose(loops.velocity[row], scale * np.cos(angle), atol=1e-3 * scale)
        expected = RATE * scale * np.cos(lag) * np.cos(angle - lag)
        np.testing.assert_allclose(loops.force[row], expected, atol=1e-3 * RATE * scale)


def test_the_work_of_a_loop_is_that_of_the_record():
    run = lagging(4.0)
    loops = continuous_velocity_loop(run)
    work = float(np.mean(loops.force * loops.velocity) / run.frequency)
    assert work == pytest.approx(run.work_per_cycle, rel=1e-3)


def test_noise_falls_with_the_root_of_the_number_of_cycles():
    clean, noisy = (
        continuous_velocity_loop(lagging(2.0, cycles=50.0, noise=noise, phase=0.0)) for noise in (0.0, 10.0)
    )
    scatter = float(np.std(noisy.force - clean.force))
    # between samples a straight line averages two of them, so somewhat below 10/√50
    assert noisy.cycles == (50,) and 0.6 < scatter / (10.0 / np.sqrt(50)) < 1.1


def test_what_cannot_be_analysed_is_refused():
    with pytest.raises(ValueError, match="`runs` must hold at least one record"):
        peak_velocity_points([])
    with pytest.raises(ValueError, match="`points` must be 4 or more, but is 2"):
        continuous_velocity_loop(lagging(1.0), points=2)
