"""Channels say what they are: descriptions, and forces and powers of one damper where several act together."""

import numpy as np
import pytest

from jaxdamp import dampers, simulate
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
    assert said["tandem_damper_force"].startswith("force of tandem_damper, both sides together")
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
