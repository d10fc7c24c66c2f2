"""Fits end at vehicles that `simulate` accepts."""

import numpy as np
import pytest

from jaxdamp import identify, roads, simulate
from jaxdamp.dampers import CoulombFriction, Linear
from jaxdamp.identify.vehicle_preparing import first_refused
from jaxdamp.parameters import free_parameters, replace
from jaxdamp.vehicles import QuarterCar


CAR = QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(1500.0), friction=CoulombFriction(300.0, 2e-5))


def test_the_number_that_is_refused_is_named_with_its_last_accepted_value():
    free = free_parameters(CAR.friction)
    start, end = np.array([100.0, 1e-2]), np.array([300.0, 1e-5])
    limit = first_refused(free, start, end, lambda values: bool(values[1] > 1e-3))
    assert limit is not None
    index, value, limited = limit
    assert index == 1 and value == pytest.approx(1e-3, rel=0.01) and value > 1e-3
    assert limited.limits()[0][1] == value and value < float(limited.values[1]) < 2e-3
    assert first_refused(free, start, end, lambda values: bool(np.all(values == start))) is None


@pytest.mark.slow
def test_friction_steeper_than_a_step_can_follow_stays_at_the_last_value_that_simulate_accepts():
    road = roads.sweep_sine(0.7, 6.0, duration=1.0, velocity_amplitude=0.15)
    noise = {"stroke": 1e-5, "sprung_acceleration": 1e-2}
    ride = identify.virtual_ride(CAR, road, noise, sampling_rate=250.0, finer=40, seed=2)
    start = replace(CAR, {"friction.friction_velocity": 0.02, "friction.friction_force": 200.0})
    result = identify.fit(start, ride, over=["friction_force", "friction_velocity"], dt=4e-3)
    simulate(result.vehicle, road, dt=4e-3)
    assert any("friction_velocity was held at" in warning for warning in result.warnings)
