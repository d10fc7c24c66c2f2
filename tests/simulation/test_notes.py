"""What a response says of itself in words, and vehicles whose tyres can leave the road."""

import inspect
import itertools

import jax
import numpy as np
import pytest

from jaxdamp import dampers, roads, simulate
from jaxdamp.vehicles import Frame, LumpedVehicle, presets
from jaxdamp.vehicles.frame import LiftOff, LiftOffWithLaws

from ..vehicles.fleet import bumps, tracks


PRESETS = {
    name: make for name, make in inspect.getmembers(presets, inspect.isfunction) if make.__module__ == presets.__name__
}


def over_a_bump(car, height=0.06, count=401):
    """A short bump under one axle after the other, 0.1 s apart."""
    return simulate(car, tracks(bumps(0.05 + 0.1 * np.arange(len(car.wheel_names)), count, height, 0.08)))


@pytest.mark.slow
def test_a_truck_whose_tyres_pull_says_so_and_one_whose_tyres_lift_does_not():
    pulling = over_a_bump(presets.truck_001())
    load = pulling["front_dynamic_tyre_load"] + pulling.vehicle.static_wheel_loads()[0]
    assert load.min() < -30e3
    (note,) = pulling.notes
    assert f"front {float(load.min()) / 1e3:.3g} kN at {float(pulling.time[load.argmin()]):.3f} s" in note
    assert "tandem 1" in note and "Pass `tyre_lifts=True` to the vehicle" in note
    lifting = over_a_bump(presets.truck_001(tyre_lifts=True))
    assert lifting.notes == ()
    for wheel in lifting.vehicle.wheel_names:
        relative = np.asarray(lifting[f"{wheel}_relative_tyre_load"])
        assert -1.0 - 1e-9 < relative.min() < -0.999


@pytest.mark.slow
def test_a_tracked_hull_lifts_with_spring_and_damper_together():
    """Without a mass between, a wheel in the air carries nothing: the forces on the hull are its weight at least."""
    lifting = over_a_bump(presets.m113_003(tyre_lifts=True), 0.25)
    assert lifting.notes == ()
    loads = sum(np.asarray(lifting[f"wheel_{i}_dynamic_tyre_load"]) for i in range(1, 6))
    np.testing.assert_allclose(loads, 7819.0 * np.asarray(lifting["sprung_acceleration"]), atol=1e-5)
    for i in range(1, 6):
        assert -1.0 - 1e-9 < float(lifting[f"wheel_{i}_relative_tyre_load"].min()) < -0.99


def test_a_law_with_states_lifts_with_its_wheel():
    """Spring, law and what stands beside them: their sum never pulls, and the law runs with its own states."""
    linear, law = LiftOff(2e5, 100.0, 3e3), dampers.Lag(dampers.Bilinear(20e3, 12e3), 0.01)
    beside, moves = LiftOffWithLaws(linear, law), [(0.0, 0.0), (-0.01, -0.5), (0.001, 0.6), (0.002, 0.1)]
    state = law.initial_state()
    for (x0, v0), (x1, v1) in itertools.pairwise(moves):
        np.testing.assert_allclose(beside.state_rate(x0, v0, state), law.state_rate(x0, v0, state), rtol=1e-14)
        state, same = law.advance(x0, v0, x1, v1, state, 0.02), beside.advance(x0, v0, x1, v1, state, 0.02)
        np.testing.assert_allclose(state, same, rtol=1e-14)
        wanted = 2e5 * x1 + 100.0 * v1 + float(law.force(x1, v1, state))
        total = wanted + float(beside.force(x1, v1, state))
        assert total == pytest.approx(min(wanted, 3e3), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("make", "height"), [(presets.truck_001, 0.06), (presets.m113_003, 0.25)])
def test_the_energy_of_wheels_in_the_air_closes(make, height):
    response = over_a_bump(make(tyre_lifts=True), height)
    balance = response.energy_balance()
    assert abs(float(balance["error"])) < 5e-3 * float(balance["road_work"])


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_can_lift(name):
    car = PRESETS[name](tyre_lifts=True)
    assert all(wheel.lifts for wheel in car.frame().wheels)
    assert not any(wheel.lifts for wheel in PRESETS[name]().frame().wheels)


def test_a_vehicle_of_parts_can_lift():
    frame = presets.half_car_002().frame()
    assert isinstance(frame, Frame) and not any(wheel.lifts for wheel in frame.wheels)
    assert [w.lifts for w in LumpedVehicle(frame, tyre_lifts=True).frame().wheels] == [True, True]


def test_nothing_to_note_on_a_smooth_road_and_none_while_traced():
    car, bump = presets.quarter_car_000(), roads.cosine_bump(0.01, start=0.05, duration=0.25)
    assert simulate(car, bump, duration=0.3).notes == ()
    found = []

    @jax.jit
    def run(rate):
        response = simulate(presets.quarter_car_000(dampers.Linear(rate)), bump, duration=0.3, substeps=1)
        found.append(response.notes)
        return response["stroke"][-1]

    run(2500.0)
    assert found == [()]


def test_a_damper_beyond_its_stroke_says_so():
    """The piston of a tube was pulled through the guide of its rod without a word."""
    tube, bump = dampers.MonoTube.reference(), roads.cosine_bump(0.3, start=0.1, length=3.0, speed=15.0)
    car = presets.quarter_car_000(dampers.MotionRatio(tube, 0.8), tyre_lifts=True)
    response = simulate(car, bump, duration=0.5)
    stroke, (low, high) = np.asarray(response["stroke"]), (np.asarray(tube.stroke_limits) / 0.8).tolist()
    assert stroke.max() > high
    share = 100.0 * np.mean(stroke > high)
    (note,) = response.notes
    assert f"damper moved from {stroke.min():.3g} to {stroke.max():.3g} m" in note
    assert f"valid from {low:.3g} to {high:.3g} m ({share:.2g} % of the run outside)" in note
    assert "valid from" not in str(response.between(0.0, 0.1).notes)
