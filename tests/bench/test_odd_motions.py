"""Evaluation of motions that are easily taken for others: far apart, of constant velocity, of a single cycle."""

import numpy as np
import pytest

from jaxdamp.bench import BenchRun, evaluate, separate_gas_and_friction


REBOUND, COMPRESSION = 2600.0, 1200.0  # N s/m


def kneed(frequency):
    """Five cycles of 20 mm, with a knee at 0.08 m/s."""
    t = np.arange(2000) / (400 * frequency)
    v = 0.02 * 2 * np.pi * frequency * np.cos(2 * np.pi * frequency * t)
    force = np.sign(v) * (4000.0 * np.minimum(np.abs(v), 0.08) + 1000.0 * np.maximum(np.abs(v) - 0.08, 0.0))
    return BenchRun(f"{frequency:g} Hz", t, 0.02 * np.sin(2 * np.pi * frequency * t), v, force)


def test_a_slow_record_does_not_draw_a_straight_line_to_a_fast_one():
    fast, slow = kneed(3.0), kneed(0.3)
    both = evaluate([slow, fast])
    assert both.method == "loop"
    assert both.get("rebound force", velocity=0.131).value == pytest.approx(320.0 + 51.0, rel=2e-3)  # on the curve


def test_friction_of_a_triangle_contains_its_damping_and_says_so():
    """Also where the velocity comes from the stroke, whose turns then look like slow motion."""
    t = np.arange(4000) / 500
    inner = (1.0 - 1e-3) * np.sin(np.pi * t)
    stroke, way = 0.02 * 2 / np.pi * np.arcsin(inner), np.sign(np.cos(np.pi * t))
    run = BenchRun.from_arrays("triangle", t, stroke, 2000.0 * 0.04 * way + 40.0 * way - 150.0)
    assert "The velocity hardly varies: the friction contains the damping" in separate_gas_and_friction(run).note


@pytest.mark.parametrize("phase", [0.0, 1.0, np.pi / 2, np.pi])
@pytest.mark.parametrize("count", [500, 501])
def test_a_record_of_one_cycle_is_a_cycle(phase, count):
    """As the mean cycles that bench software exports, with the first sample once more or without."""
    time = np.arange(count) / 1000
    angle = 4 * np.pi * time + phase
    velocity = 0.02 * 4 * np.pi * np.cos(angle)
    force = np.where(velocity > 0, REBOUND, COMPRESSION) * velocity
    run = BenchRun.from_arrays("mean", time, 0.02 * np.sin(angle), force)
    assert run.frequency == pytest.approx(2.0, rel=3e-3) and run.cycles == 1
    energy = np.pi * 4 * np.pi * 0.02**2 * (REBOUND + COMPRESSION) / 2
    assert evaluate(run).get("energy per cycle").value == pytest.approx(energy, rel=1e-2)
