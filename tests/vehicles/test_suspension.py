"""What stands between two points takes the same laws everywhere."""

import dataclasses
import inspect

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers
from jaxdamp.vehicles import Cab, Corner, Ports, QuarterCar, Seat, SeatMass, Suspension, WalkingBeam, presets


ADDED = 7e3  # N/m
LAWS = {
    "extra_spring": dampers.Spring(ADDED),
    "bump_stop": dampers.BumpStop(0.05, 4e4),
    "friction": dampers.CoulombFriction(50.0, 0.02),
}


def truck(cab_laws, beam_laws, seat_laws, added=0.0):
    """A truck with a walking beam, a cab and a seat, with laws on them or stiffer linear springs."""
    own = presets.truck_001()
    assert isinstance(own.tandem, WalkingBeam)
    mounts = {f"{end}_{name}": law for end in ("front", "rear") for name, law in cab_laws.items()}
    law = dampers.Linear(4e3)
    cab = Cab(900.0, 900.0, 2.6, 0.9, 0.7, 60e3 + added, 60e3 + added, law, law, **mounts)
    seat = Seat((SeatMass(75.0, 8e3 + added, dampers.Linear(500.0), **seat_laws),), ahead=1.0)
    beam = dataclasses.replace(own.tandem, spring_rate=own.tandem.spring_rate + added, **beam_laws)
    return dataclasses.replace(own, tandem=beam, cab=cab, seats=(seat,))


def hull(laws, added=0.0):
    own = presets.m113_003()
    return dataclasses.replace(own, wheel_rate=own.wheel_rate + added, **laws)


@eqx.filter_jit
def stiffness_at_rest(vehicle):
    form = vehicle.port_form()
    slopes, _ = Ports(vehicle.elements()).stiffness_and_damping(jnp.zeros(form.ports.shape[0]))
    road = form.road_stiffness
    if form.port_road is not None:
        road = road + form.ports.T @ (slopes[:, None] * form.port_road)
    return form.stiffness + form.ports.T @ (slopes[:, None] * form.ports), road


@pytest.mark.parametrize(
    ("with_laws", "stiffer", "places"),
    [
        (
            truck(LAWS, LAWS, LAWS),
            truck({}, {}, {}, ADDED),
            ("tandem", "cab_front", "cab_rear", "seat"),
        ),
        (hull(LAWS), hull({}, ADDED), ("wheel_1", "wheel_2", "wheel_3", "wheel_4", "wheel_5")),
    ],
    ids=["truck", "hull"],
)
@pytest.mark.exhaustive_cases("hull")
def test_a_spring_beside_is_a_stiffer_spring_wherever_it_stands(with_laws, stiffer, places):
    names = {channel.name for channel in with_laws.layout.channels}
    assert {f"{place}_{law}_force" for place in places for law in LAWS} <= names
    for found, expected in zip(stiffness_at_rest(with_laws), stiffness_at_rest(stiffer), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-6)


def test_laws_of_a_hull_are_those_of_one_wheel_on_both_sides():
    frame = hull(LAWS).frame()
    assert frame.element("wheel_3_bump_stop").count == 2  # wheel 3 has no shock absorber
    with pytest.raises(ValueError, match="must be one of"):
        frame.element("wheel_3_damper")


def test_a_suspension_names_its_laws():
    suspension = Suspension(2e4, dampers.Linear(1.0), damper_count=2, **LAWS)
    assert [(e.name, e.count) for e in suspension.elements] == [("damper", 2), *[(name, 1) for name in LAWS]]
    assert Suspension(2e4).elements == ()
    with pytest.raises(ValueError, match=r"Suspension.spring_rate` must be positive \[N/m\]"):
        Suspension(-1.0)


def test_the_order_of_arguments_is_that_of_the_fields_of_a_corner():
    corner = ["unsprung_mass", "spring_rate", "tyre_stiffness", "damper", "tyre_damping"]
    corner += ["extra_spring", "bump_stop", "friction", "tyre_lifts"]
    assert list(inspect.signature(Corner).parameters) == [*corner, "damper_count"]
    assert list(inspect.signature(QuarterCar).parameters) == ["sprung_mass", *corner, "seats", "damper_count"]
