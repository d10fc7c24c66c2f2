import numpy as np
import pytest

from jaxdamp import Ride, roads, simulate
from jaxdamp.dampers import CoulombFriction, Linear
from jaxdamp.vehicles import Guide, Guided, linearise, presets, stationary_rms


CAR = presets.quarter_car_mathworks()
ROAD = roads.sine(0.01, frequency=1.5)


def test_a_guide_with_a_dashpot_is_a_damper_to_the_ground():
    guided = Guided(CAR, (Guide(stiffness=500.0, damping=80.0),))
    free, held = (np.asarray(linearise(car).state_matrix) for car in (CAR, guided))
    change = np.zeros((4, 4))
    change[2, 0], change[2, 2] = -500.0 / 300.0, -80.0 / 300.0
    np.testing.assert_allclose(held - free, change, atol=1e-9)


@pytest.mark.slow
def test_on_a_white_road_a_spring_to_the_ground_lets_what_follows_the_height_grow_without_end():
    road = roads.white("C", 20.0)
    held = Guided(CAR, (Guide(stiffness=500.0),))
    rms = stationary_rms(held, road.velocity_psd)
    endless = {name for name, value in rms.items() if np.isinf(value)}
    assert endless == {"z_sprung", "z_unsprung", "stroke", "dynamic_tyre_load", "relative_tyre_load"}
    values = Ride(held, road, metrics=["rms_sprung_acceleration", "working_space_rms"])()
    assert np.isfinite(values["rms_sprung_acceleration"]) and np.isinf(values["working_space_rms"])
    damped = stationary_rms(Guided(CAR, (Guide(CoulombFriction(30.0, 0.01), damping=50.0),)), road.velocity_psd)
    assert [name for name, value in damped.items() if np.isinf(value)] == ["sprung_guide_stroke"]


def test_friction_of_guides_takes_energy_and_keeps_the_balance():
    free, held = (
        simulate(car, ROAD, duration=4.0)
        for car in (CAR, Guided(CAR, (Guide(Linear(30.0) + CoulombFriction(60.0, 0.02)), Guide(body="unsprung"))))
    )
    assert float(np.max(held["z_sprung"])) < float(np.max(free["z_sprung"]))
    energies = {name: float(value) for name, value in held.energy_balance().items()}
    np.testing.assert_allclose(held["sprung_guide_stroke"], held["z_sprung"], atol=1e-12)
    assert abs(energies["error"]) < 1e-3 * energies["road_work"]
