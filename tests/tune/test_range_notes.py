"""A tuning says by how much its start and its result leave the range of their records."""

import re
from typing import Any

import numpy as np
import pytest

from jaxdamp import dampers, roads, tune, vehicles
from jaxdamp.simulation import Exponential
from jaxdamp.vehicles import linearise, stationary_rms


GRIP = "rms_dynamic_tyre_load"
LAW = dampers.with_fitted_range(dampers.Linear(2500.0), velocity=(-0.02, 0.02))


def test_on_a_white_road_velocities_reach_three_standard_deviations():
    road = roads.white("C", speed=20.0)
    car = vehicles.presets.quarter_car_000(LAW)
    result = tune.minimise("rms_sprung_acceleration", car, road)
    plain = tune.minimise("rms_sprung_acceleration", vehicles.presets.quarter_car_000(dampers.Linear(2500.0)), road)
    assert result.after == plain.after and not plain.warnings
    assert result.vehicle.elements()[0].fitted_to == LAW.fitted_to
    whens = ("At the start (velocities of 3 standard deviations)", "After the tuning (velocities of 3 standard")
    for when, vehicle, note in zip(whens, (result.start, result.vehicle), result.warnings, strict=True):
        sigma = float(stationary_rms(linearise(vehicle), road.velocity_psd, speed=road.speed)["damper_velocity"])
        assert note.startswith(when) and f"({3 * sigma / 0.02:.2g} times)" in note
        percent = float(re.findall(r"(\d+) % of the time", note)[0])
        inside = np.mean(np.abs(np.random.default_rng(0).normal(0.0, sigma, 100_000)) < 0.02)
        assert percent == pytest.approx(100 * (1 - inside), abs=1.0)
    assert f"warning: {result.warnings[0]}" in repr(result)


@pytest.mark.slow
def test_on_a_driven_road_the_run_itself_is_looked_at():
    car = vehicles.presets.quarter_car_000(LAW)
    road = roads.cosine_bump(0.05, start=0.2, duration=0.3)
    result = tune.minimise("rms_sprung_acceleration", car, road, duration=1.0, dt=0.005, max_steps=1)
    start, after = [note for note in result.warnings if "fitted to" in note]
    for note, metrics in ((start, result.before), (after, result.after)):
        times = float(re.findall(r"\(([\d.e+]+) times\)", note)[0])
        assert times == pytest.approx(metrics["peak_damper_velocity"] / 0.02, rel=0.05)
    assert start.startswith("At the start, damper:") and after.startswith("After the tuning, damper:")


def test_a_tuned_damper_that_the_given_steps_do_not_bear_is_noted_and_its_range_left_out():
    """The search was lost at its end, by the refusal of the run that looks at the range."""
    law = dampers.with_fitted_range(dampers.Linear(30e3), velocity=(-0.02, 0.02))
    car, road = vehicles.presets.quarter_car_000(law), roads.cosine_bump(0.05, start=0.1, duration=0.25)
    run: dict[str, Any] = {"duration": 0.5, "dt": 5e-3, "engine": Exponential(substeps=1)}
    result = tune.minimise("travel", car, road, over={"damper.rate": (1000.0, 9e4)}, **run)
    assert "must keep every law stable, but is 1" in result.warnings[-1]
    assert not any("fitted to" in note for note in result.warnings)


def test_the_motion_in_each_condition_is_looked_at():
    """A worn damper moves faster than that of the design, which no scenario drives."""
    car = vehicles.presets.quarter_car_000(dampers.with_fitted_range(dampers.Linear(2500.0), velocity=(-2.0, 2.0)))
    how: dict[str, Any] = {"over": ["damper.rate"], "bounds": {"damper.rate": (2000.0, 3000.0)}, "max_steps": 2}
    assert not [note for note in tune.minimise(GRIP, car, roads.white("C", 20.0), **how).warnings if "fitted" in note]
    for factor, outside in ((0.05, True), (1.0, False)):
        worn = tune.Scenarios([roads.white("C", 20.0)], [tune.Condition(factors={"damper.rate": factor})])
        assert bool([note for note in tune.minimise(GRIP, car, worn, **how).warnings if "fitted" in note]) == outside
