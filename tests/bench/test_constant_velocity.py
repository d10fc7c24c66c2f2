"""Strokes at constant velocity, of which only stroke and force are measured: turns show no velocity of the damper."""

import numpy as np
import pytest

from jaxdamp.bench import BenchRun, estimate_velocity, evaluate, peak_velocity_points


AMPLITUDE, GAS, RATE = 0.03, -200.0, 3000.0  # m, N, N/m
DAMPING = {"rebound": 2000.0, "compression": 1000.0}  # N s/m


def triangle(velocity: float, turn: float = 0.004, duration: float = 12.0, rate: int = 1000, noise: float = 5e-6):
    """Time, stroke with noise, velocity: strokes of 60 mm with turns of so many seconds at constant acceleration."""
    fine = 20
    time = np.arange(0.0, duration, 1.0 / (rate * fine))
    sharp = velocity * np.where((velocity / (4 * AMPLITUDE) * time) % 1 < 0.5, 1.0, -1.0)
    width = max(round(turn * rate * fine), 1)
    padded = np.concatenate([np.full(width, sharp[0]), sharp, np.full(width, sharp[-1])])
    true = np.convolve(padded, np.ones(width) / width, "same")[width:-width]
    stroke = (np.cumsum(true) / (rate * fine) - AMPLITUDE)[::fine]
    return time[::fine], stroke + noise * np.random.default_rng(1).standard_normal(len(stroke)), true[::fine]


def record(velocity: float, turn: float = 0.004) -> BenchRun:
    time, stroke, true = triangle(velocity, turn)
    force = np.where(true > 0, DAMPING["rebound"], DAMPING["compression"]) * true + GAS + RATE * stroke
    force += np.random.default_rng(2).normal(0.0, 2.0, len(force))
    return BenchRun.from_arrays(f"{velocity:g} m/s", time, stroke, force)


@pytest.mark.parametrize("turn", [0.0, 0.004, 0.02])
@pytest.mark.parametrize("velocity", [0.03, 0.2])
def test_no_corner_makes_the_velocity_overshoot(velocity, turn):
    time, stroke, true = triangle(velocity, turn, duration=6.0, noise=0.0)
    found = estimate_velocity(time, stroke)[0]
    assert np.abs(found[50:-50]).max() < 1.002 * velocity  # 1.17 to 1.22 times, by a quintic around sharp corners
    assert np.sqrt(np.mean((found - true)[50:-50] ** 2)) < (0.06 if turn == 0.0 else 0.015) * velocity


def test_strokes_of_several_velocities_in_one_record_do_not_overshoot_either():
    each = [triangle(velocity, duration=8 * 0.03 / velocity, noise=0.0) for velocity in (0.05, 0.1, 0.2)]
    stroke = np.concatenate([part[1] for part in each])
    velocity, how = estimate_velocity(np.arange(len(stroke)) / 1000, stroke)
    assert "order 2" in how and np.abs(velocity[50:-50]).max() < 1.002 * 0.2


@pytest.mark.parametrize("turn", [0.004, 0.02])
def test_forces_are_those_of_the_constant_velocities(turn):
    found = evaluate([record(velocity, turn=turn) for velocity in (0.03, 0.1, 0.2)])
    for velocity in (0.052, 0.131):
        for direction, sign in (("rebound", 1.0), ("compression", -1.0)):
            measured = found.get(f"{direction} force", velocity=velocity)
            assert measured.value == pytest.approx(sign * DAMPING[direction] * velocity + GAS, abs=1.5), direction
    for direction in ("rebound", "compression"):
        assert found.get(f"{direction} velocity", record="0.1 m/s").value == pytest.approx(
            0.1 if direction == "rebound" else -0.1, rel=0.005
        )
    assert not any(measurement.quantity in ("rebound rate", "compression rate") for measurement in found.measurements)


def test_velocities_that_only_turns_pass_have_no_force():
    run = record(0.16)
    found = evaluate([run], method="loop", velocities=(0.052, 0.16))
    assert np.isnan(found.get("rebound force", velocity=0.052).value)
    assert found.get("rebound force", velocity=0.16).value == pytest.approx(0.16 * DAMPING["rebound"] + GAS, abs=3.0)
    assert found.notes[0] == "No force at 0.052 m/s: the records give forces at 0.16 m/s."
    points = peak_velocity_points(run)
    np.testing.assert_allclose(points.velocity, [[-0.16, 0.16]], rtol=0.005)
    np.testing.assert_allclose(points.force, [[-360.0, 120.0]], atol=2.0)
    alone = evaluate([run])
    (stated,) = alone.velocities  # that of the record, since 0.15 m/s is none
    assert stated == pytest.approx(0.16, rel=0.005)
    assert alone.get("rebound force", velocity=stated).value == pytest.approx(120.0, abs=3.0)
