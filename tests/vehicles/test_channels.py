"""Channels say what they are: descriptions, and forces and powers of one damper where several act together."""

import numpy as np
import pytest

from jaxdamp import dampers, simulate
from jaxdamp.metrics import Metric
from jaxdamp.vehicles import Corner, Element, HalfCar, QuarterCar, presets

from .fleet import bumps, tracks, vehicles


FLEET = vehicles()


@pytest.mark.parametrize("name", FLEET)
def test_every_channel_has_a_unit_and_a_description(name):
    car = FLEET[name]
    assert set(car.descriptions) == set(car.units)
    assert all(car.descriptions.values())


def test_descriptions_say_of_how_many_a_channel_is():
    said = presets.truck_001().descriptions
    assert said["front_damper_force"].startswith("force of front_damper, of one of 2 equal ones")
    assert said["tandem_friction_force"].startswith("force of tandem_friction, both sides together")
    assert "both sides together" in said["tandem_1_dynamic_tyre_load"]
    hull = presets.m113_003().descriptions
    assert "one of 2" in hull["wheel_1_damper_force"] and "both sides" in hull["wheel_3_dynamic_tyre_load"]
    assert "sides" not in "".join(presets.half_car_002().descriptions.values())


@pytest.mark.parametrize(
    ("make", "damper"), [(presets.truck_001, "front_damper"), (presets.m113_003, "wheel_1_damper")]
)
@pytest.mark.exhaustive_cases("m113_003-wheel_1_damper")
def test_force_and_power_are_of_one_damper(make, damper):
    car = make(damper=dampers.Linear(15e3))
    run = simulate(car, tracks(bumps(0.05 + 0.1 * np.arange(len(car.wheel_names)), 301)))
    force, velocity = np.asarray(run[f"{damper}_force"]), np.asarray(run[f"{damper}_velocity"])
    np.testing.assert_allclose(force, 15e3 * velocity, rtol=1e-9, atol=1e-9)
    name = f"{damper}_dissipated_power"
    assert float(run.metrics([name])[name]) * 0.3 * 2 == pytest.approx(float(run.absorbed_by()[damper]), rel=1e-9)


def test_two_dampers_are_as_one_of_twice_the_force():
    corners = [
        {"damper": dampers.Linear(1000.0), "damper_count": 2},
        {"damper": dampers.Linear(2000.0)},
    ]
    two, one = (QuarterCar(300.0, 40.0, 20e3, 180e3, **corner) for corner in corners)
    runs = [simulate(car, tracks(bumps([0.05], 201))) for car in (two, one)]
    np.testing.assert_allclose(runs[0].motion, runs[1].motion, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(2.0 * runs[0]["damper_force"], runs[1]["damper_force"], rtol=1e-9, atol=1e-9)
    axle = Corner(40.0, 20e3, 180e3, dampers.Linear(1000.0), damper_count=2)
    frame = HalfCar(600.0, 900.0, 1.2, 1.4, axle, axle).frame()
    assert frame.element("front_damper").count == 2 and repr(frame.element("rear_damper").law) == "Linear(rate=1000.0)"


def test_refuses_what_cannot_be():
    with pytest.raises(ValueError, match="`count` must be 1 or more, but is 0"):
        Element("damper", dampers.Linear(1.0), 0)
    with pytest.raises(ValueError, match="Did you mean 'damper'"):
        presets.quarter_car_000().frame().element("dampr")


def test_velocities_of_bodies_wheels_places_and_struts_are_channels_and_have_metrics():
    car = presets.half_car_002()
    run = simulate(car, tracks(bumps([0.02, 0.15], 301)))
    rate = dict(zip(car.coordinates, np.asarray(run.motion).T[len(car.coordinates) :], strict=True))
    for name in ("sprung", "front_unsprung", "rear_unsprung"):
        np.testing.assert_allclose(run[f"{name}_velocity"], rate[f"z_{name}"], rtol=1e-12)
        middle = np.gradient(np.asarray(run[f"z_{name}"]), 1e-3)
        np.testing.assert_allclose(run[f"{name}_velocity"][1:-1], middle[1:-1], atol=2e-3 * np.abs(middle).max())
    np.testing.assert_allclose(run["pitch_velocity"], rate["pitch"], rtol=1e-12)
    assert run.units["pitch_velocity"] == "rad/s" and run.units["sprung_velocity"] == "m/s"
    for end in ("front", "rear"):
        own = run[f"{end}_body_velocity"] - run[f"{end}_unsprung_velocity"]
        np.testing.assert_allclose(own, run[f"{end}_damper_velocity"], rtol=1e-9, atol=1e-12)
    value = run.metrics([Metric("sprung_velocity", "rms")])["rms_sprung_velocity"]
    assert float(value) == pytest.approx(np.sqrt(np.mean(np.square(run["sprung_velocity"]))), rel=1e-12)


def test_a_turning_hull_has_the_velocity_above_each_road_wheel_with_a_damper():
    hull = presets.m113_003()
    names = [name for name in hull.units if name.endswith("_body_velocity")]
    assert names == [f"{name.removesuffix('_force').removesuffix('_damper')}_body_velocity" for name in _forces(hull)]


def _forces(car):
    return [name for name in car.units if name.endswith("_damper_force")]
