"""Critical damping: against the damping ratio of a mass alone, and loads by hand."""

import dataclasses

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxdamp import dampers
from jaxdamp.parameters import replace
from jaxdamp.vehicles import (
    Body,
    Element,
    Frame,
    Link,
    LumpedVehicle,
    QuarterCar,
    Seat,
    SeatMass,
    Wheel,
    critical_damping,
    modes,
)
from jaxdamp.vehicles.presets import full_car_jazar, half_car_002, m113_003, truck_001


LAW = dampers.Linear(900.0)


def test_it_is_that_of_the_modes_where_one_mass_moves_alone():
    on_stiff_tyre = QuarterCar(300.0, 1e-3, 18e3, 1e10, LAW)
    body = critical_damping(on_stiff_tyre)["damper"].body
    assert 900.0 / float(body) == pytest.approx(modes(on_stiff_tyre).damping_ratio[0], rel=1e-4)
    below_heavy_body = QuarterCar(1e9, 40.0, 18e3, 200e3, LAW)
    wheel = critical_damping(below_heavy_body)["damper"].wheel
    assert 900.0 / float(wheel) == pytest.approx(modes(below_heavy_body).damping_ratio[-1], rel=1e-4)


def test_between_scaled_points_it_is_of_the_rate_there():
    body, wheel = Body("sprung", 300.0), Body("unsprung", 40.0)
    link = Link("", 0.7 * (body.at() - wheel.at()), 18e3 / 0.7**2, elements=(Element("damper", LAW),))
    scaled = critical_damping(LumpedVehicle(Frame((body, wheel), (link,), (Wheel("", wheel.at(), 2e5),))))["damper"]
    plain = critical_damping(QuarterCar(300.0, 40.0, 18e3, 2e5, LAW))["damper"]
    np.testing.assert_allclose(scaled, np.array(plain) / 0.7**2, rtol=1e-12)


def test_a_spring_among_the_laws_counts():
    law = LAW + dampers.Spring(6e3)
    pairs = [critical_damping(QuarterCar(300.0, 40.0, k, 2e5, d)) for k, d in ((18e3, LAW), (12e3, law))]
    np.testing.assert_allclose(*(np.array(pair["damper"]) for pair in pairs), rtol=1e-12)


def test_an_air_spring_counts_where_the_car_stands():
    """Its charge raises the car, where it is softer: with the slope at zero stroke the ratio is 6 % lower."""
    car = QuarterCar(300.0, 1e-3, 18e3, 1e10, LAW, extra_spring=dampers.GasSpring(3e5, 1e-3, 5e-3))
    body = critical_damping(car)["damper"].body
    assert 900.0 / float(body) == pytest.approx(modes(car).damping_ratio[0], rel=1e-4)


def test_each_wheel_carries_its_share():
    front, rear = (critical_damping(half_car_002())[f"{end}_damper"] for end in ("front", "rear"))
    np.testing.assert_allclose(front.body, 2.0 * np.sqrt(23.5e3 * 580.0 * 1.5 / 2.5), rtol=1e-9)
    np.testing.assert_allclose(rear.body, 2.0 * np.sqrt(23.5e3 * 580.0 * 1.0 / 2.5), rtol=1e-9)
    assert set(critical_damping(full_car_jazar())) == {
        f"{end}_{side}_damper" for end in ("front", "rear") for side in ("left", "right")
    }
    assert set(critical_damping(truck_001())) == {"front_damper", "tandem_friction"}
    hull, seat = m113_003(), Seat((SeatMass(80.0, 30e3, LAW),), ahead=0.5)
    for seats in ((), (seat,)):  # its wheels have no mass, and it is none itself
        assert critical_damping(dataclasses.replace(hull, seats=seats)) == {}


def test_it_is_differentiable():
    slope = jax.jit(jax.grad(lambda k: critical_damping(QuarterCar(300.0, 40.0, k, 2e5, LAW))["damper"].body))(18e3)
    assert float(slope) == pytest.approx(np.sqrt(300.0 / 18e3), rel=1e-9)


def test_it_is_differentiable_beside_an_anti_roll_bar():
    car = full_car_jazar()

    def body(car):
        return critical_damping(car)["front_left_damper"].body

    rate = car.front.corner.spring_rate
    stiffer = replace(car, {"front.corner.spring_rate": 1.001 * rate})
    slope = eqx.filter_jit(eqx.filter_grad(body))(car).front.corner.spring_rate
    difference = (body(stiffer) - body(car)) / (1e-3 * rate)
    assert float(slope) == pytest.approx(float(difference), rel=1e-3)
