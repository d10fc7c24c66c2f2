"""Records of velocity and force without a stroke."""

import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import RandomTest, evaluate, preflight, read
from jaxdamp.bench.velocity import integrate_velocity
from jaxdamp.dampers import Linear, Spring


@pytest.fixture
def folder(write, tmp_path):
    """A record with a velocity in mm/s that is 3 mm/s too large, and noise, but without a stroke."""
    t, rng = np.arange(600) / 300, np.random.default_rng(1)
    velocity = 1e3 * 0.02 * 3 * np.pi * np.cos(3 * np.pi * t) + 3.0 + rng.standard_normal(600)
    write("fast.csv", header="t_s,F_N,v_mm_s", scale=(1.0, 0.0, 1.0), extra=[velocity])
    return tmp_path


def test_the_error_names_the_remedy(folder):
    with pytest.raises(ValueError, match="stroke_from_velocity=True"):
        read(folder)


def test_points_of_a_curve_are_told_from_a_record(tmp_path):
    (tmp_path / "points.csv").write_text("velocity [m/s],force [N]\n-0.2,-400\n-0.1,-250\n0,5\n0.1,300\n0.2,500\n")
    with pytest.raises(ValueError, match=r"a force-velocity curve .*dampers\.Table"):
        read(tmp_path)


def test_stroke_is_integrated_without_drift_and_marked(folder, tmp_path):
    (run,) = read(folder, stroke_from_velocity=True)
    np.testing.assert_allclose(run.stroke, 0.02 * np.sin(3 * np.pi * run.time), atol=2e-4)
    np.testing.assert_allclose(run.velocity.mean(), 0.0, atol=1e-3)
    assert run.stroke_is_integrated and "less a constant 0.00" in run.describe()
    assert run.process(last_cycles=2).stroke_is_integrated
    again = read(run.to_csv(tmp_path / "again.csv"))[0]
    assert again.stroke_is_integrated
    np.testing.assert_array_equal(again.stroke, run.stroke)
    (folder / "jaxdamp.toml").write_text("stroke_from_velocity = true\n")
    assert read(folder)[1].stroke_is_integrated


def test_what_needs_the_place_of_the_stroke_says_so(folder):
    runs = read(folder, stroke_from_velocity=True)
    assert [f.name for f in preflight(runs).findings] == ["stroke integrated"]
    evaluation = evaluate(runs)
    assert "wherever in the damper" in evaluation.notes[0]
    assert evaluation.get("equivalent damping").value == pytest.approx(3000.0, rel=0.01)
    with_spring = identify.fit(Linear(1000.0) + Spring(10.0), runs)
    assert any("depends on the place of the stroke" in note for note in with_spring.warnings)
    assert not any("place of the stroke" in note for note in identify.fit(Linear(1000.0), runs).warnings)


def test_random_motion_and_a_stroke_channel_that_is_there(write):
    test, t = RandomTest(duration=20.0), np.arange(4000) / 200
    stroke, velocity, note = integrate_velocity(t, test.velocity(t) + 0.01, "here")
    middle = np.mean(stroke - test.stroke(t))
    assert np.max(np.abs(stroke - test.stroke(t) - middle)) < 0.1 * test.stroke_limit and "from cycle to cycle" in note
    np.testing.assert_allclose(velocity, test.velocity(t), atol=2e-4)
    assert not read(write(), stroke_from_velocity=True)[0].stroke_is_integrated


def test_a_velocity_without_a_cycle_is_refused(write):
    ramp = write(header="t_s,F_N,v_m_s", scale=(1.0, 0.0, 1.0), extra=[np.linspace(0.0, 1.0, 600)])
    with pytest.raises(ValueError, match="the velocity has no full cycle"):
        read(ramp, stroke_from_velocity=True)
    with pytest.raises(ValueError, match="no column for the velocity"):
        read(write("force.csv", header="t_s,F_N", scale=(1.0, 0.0, 1.0)), stroke_from_velocity=True)
