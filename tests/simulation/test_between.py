"""Parts of a run: channels, metrics and energy of a window of time."""

import numpy as np
import pytest

from jaxdamp import dampers, metrics, roads, simulate
from jaxdamp.vehicles.presets import quarter_car_000


LAW = dampers.Lag(dampers.Bilinear(4000.0, 1000.0), 0.004)


@pytest.fixture(scope="module")
def run():
    return simulate(quarter_car_000(LAW), roads.iso8608("C", 20.0, seed=1), duration=2.0)


def test_a_part_has_the_channels_and_metrics_of_its_time(run):
    part, inside = run.between(0.5, 1.5), slice(500, 1501)
    np.testing.assert_array_equal(part.time, run.time[inside])
    assert "from 0.5 to 1.5 s, 1001 instants" in repr(part)
    for name in ("stroke", "sprung_acceleration", "damper_force"):
        np.testing.assert_array_equal(part[name], run[name][inside], err_msg=name)
    found, stroke = part.metrics(), np.asarray(run["stroke"])[inside]
    assert float(found["working_space_rms"]) == pytest.approx(np.std(stroke), rel=1e-12)
    assert float(found["working_space_mean"]) == pytest.approx(stroke.mean(), rel=1e-9)
    moved = np.asarray(run["z_sprung"]) - float(run["z_sprung"][0])
    assert float(found["peak_sprung_displacement"]) == pytest.approx(np.abs(moved[inside]).max(), rel=1e-12)
    felt = metrics.weighted_signal(run["sprung_acceleration"], 1e-3, "Wk", method="step", remove_mean=False)
    expected = float(metrics.rms(felt[inside]))  # the weighting runs from the start of the run
    assert float(found["weighted_rms_sprung_acceleration"]) == pytest.approx(expected, rel=1e-9)
    assert float(part.comfort()["sprung_acceleration"].weighted_rms) == pytest.approx(expected, rel=1e-9)


def test_the_energy_of_parts_adds_up(run):
    parts = [run.between(0.0, 0.7), run.between(0.7, 2.0)]
    whole = run.energy_balance()
    for name in ("road_work", "absorbed", "stored"):
        assert sum(float(part.energy_balance()[name]) for part in parts) == pytest.approx(float(whole[name]), rel=1e-9)
    assert np.all(np.isnan(parts[0].final_state[0]))
    np.testing.assert_array_equal(parts[1].final_state[0], run.final_state[0])


def test_a_part_of_a_part_is_a_part(run):
    inner, direct = run.between(0.5, 1.5).between(0.9, 1.2), run.between(0.9, 1.2)
    np.testing.assert_array_equal(inner["sprung_acceleration"], direct["sprung_acceleration"])
    name = "weighted_rms_sprung_acceleration"
    assert float(inner.metrics([name])[name]) == pytest.approx(float(direct.metrics([name])[name]), rel=1e-12)


def test_settling_is_that_of_a_channel_from_the_event_on():
    kicked = simulate(quarter_car_000(), roads.step(0.02, start=0.5), duration=6.0)
    after = kicked.between(0.5, 6.0)
    time = metrics.settling_time(after["z_sprung"], 1e-3, final=0.02)
    z = np.abs(np.asarray(kicked["z_sprung"]) - 0.02)[500:]
    assert float(time) == pytest.approx(1e-3 * np.flatnonzero(z > 0.05 * z.max())[-1], abs=1.01e-3)


@pytest.mark.parametrize(("start", "stop"), [(-1.0, 1.0), (0.5, 3.0), (1.0, 1.0), (1.5, 0.5)])
def test_refuses_what_is_no_part_of_the_run(run, start, stop):
    with pytest.raises(ValueError, match=r"`start, stop` must be two instants or more of the run, 0 to 2 s"):
        run.between(start, stop)
