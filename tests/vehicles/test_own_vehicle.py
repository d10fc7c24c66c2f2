"""Vehicles put together from parts."""

import dataclasses

import jax
import numpy as np
import pytest

from jaxdamp import dampers, roads, simulate
from jaxdamp.parameters import parameters, replace
from jaxdamp.vehicles import (
    Body,
    Element,
    Frame,
    Link,
    LumpedVehicle,
    Place,
    Point,
    Seat,
    SeatMass,
    Wheel,
    modes,
    stationary_rms,
)
from jaxdamp.vehicles.parts import matrix
from jaxdamp.vehicles.presets import full_car_jazar, half_car_002, quarter_car_000


BUMP = roads.cosine_bump(0.06, start=0.1, duration=0.25)
BODY, WHEEL = Body("sprung", 1200.0), Body("unsprung", 125.0)
DAMPER = Element("damper", dampers.Linear(2500.0))
LINK, TYRE = Link("", BODY.at() - WHEEL.at(), 60e3, elements=(DAMPER,)), Wheel("", WHEEL.at(), 220e3)


def test_parts_make_the_ready_made_car():
    own = LumpedVehicle(Frame((BODY, WHEEL), (LINK,), (TYRE,)))
    ready = quarter_car_000()
    assert own.units == ready.units and own.ride_metrics == ready.ride_metrics
    runs = [simulate(car, BUMP, duration=0.6) for car in (own, ready)]
    for channel, values in runs[1].channels.items():
        np.testing.assert_array_equal(runs[0][channel], values)


def test_its_parameters_are_those_of_the_parts():
    own = LumpedVehicle(Frame((BODY, WHEEL), (LINK,), (TYRE,)))
    paths = {p.path: (float(p.value), p.unit) for p in parameters(own)}
    assert paths["parts.links.0.elements.0.law.rate"] == (2500.0, "N s/m")
    assert paths["parts.bodies.0.mass"] == (1200.0, "kg")
    softer = replace(own, {"parts.links.0.stiffness": 30e3})
    assert modes(softer).undamped_frequency[0] < 0.75 * modes(own).undamped_frequency[0]


def test_points_are_linear_functions():
    body = Body("sprung", 1.0, pitch_inertia=1.0, roll_inertia=1.0)
    point = 2.0 * body.at(1.5, -0.7) - body.at(left=0.1) + -body.pitch
    np.testing.assert_allclose(
        matrix([point, body.roll], ["roll", "z_sprung", "pitch", "else"]), [[-1.5, 1.0, 2.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
    )


def test_a_dashpot_alone_takes_in_what_a_linear_damper_does():
    """A linear dashpot in the matrices and a linear law at a port are the same thing, to the order of the scheme."""
    bare = Link("", BODY.at() - WHEEL.at(), 60e3, 2500.0)
    runs = [
        simulate(LumpedVehicle(Frame((BODY, WHEEL), (link,), (TYRE,))), BUMP, duration=0.6) for link in (LINK, bare)
    ]
    np.testing.assert_allclose(runs[0].motion, runs[1].motion, atol=1e-3 * np.abs(runs[0].motion).max())
    taken = [float(run.energy_balance()[name]) for run, name in zip(runs, ("absorbed", "dashpots"), strict=True)]
    assert taken[0] == pytest.approx(taken[1], rel=1e-3)
    assert runs[1].port_force.shape[1] == 0 and abs(float(runs[1].energy_balance()["error"])) < 1e-3 * taken[1]


def test_two_masses_of_a_seat_isolate_and_say_so():
    seat = Seat((SeatMass(20.0, 8e3, dampers.Linear(300.0)), SeatMass(60.0, 6e4, dampers.Linear(800.0))))
    rms = stationary_rms(quarter_car_000(seats=(seat,)), 1e-3)
    bare = stationary_rms(quarter_car_000(), 1e-3)
    # 80 kg on 8 kN/m: 1.6 Hz, a little above the body's 1 Hz; a tenth of the car moves with it
    assert {"seat_acceleration", "seat_2_stroke", "seat_damper_force"} <= set(rms)
    assert float(rms["sprung_acceleration"]) == pytest.approx(float(bare["sprung_acceleration"]), rel=0.1)
    light = Seat((SeatMass(1e-3, 1e3, dampers.Linear(10.0)),))
    stiff = stationary_rms(quarter_car_000(seats=(light,)), 1e-3)
    # a mass of next to nothing on a spring of 160 Hz rides as the floor does
    assert float(stiff["seat_acceleration"]) == pytest.approx(float(bare["sprung_acceleration"]), rel=2e-2)


def test_a_road_of_other_tracks_is_refused_with_the_way_out():
    road = roads.from_profile(np.arange(200) * 5e-3, np.zeros((200, 3)))
    with pytest.raises(
        ValueError, match=r"`road` must have a column for each of 2 wheel\(s\) \(front, rear\).*delayed"
    ):
        simulate(half_car_002(), road)
    with pytest.raises(ValueError, match=r"each of 4 wheel\(s\) \(front_left, .*3 columns over time without a speed"):
        simulate(full_car_jazar(), road)
    with pytest.raises(ValueError, match=r"`start` must be one of .*Did you mean 'pitch'"):
        simulate(half_car_002(), roads.in_phase(BUMP), duration=0.2, start={"pich": 0.1})


def test_tracks_of_the_axles_go_under_both_sides():
    car = full_car_jazar()
    np.testing.assert_allclose(car.axle_positions, [0.0, 2.87])
    assert float(car.track_width) == pytest.approx(1.45)
    run = simulate(car, roads.delayed(BUMP, positions=car.axle_positions, speed=14.35), duration=0.6)
    heights = np.asarray(run.road)
    np.testing.assert_array_equal(heights[:, 0], heights[:, 1])
    np.testing.assert_allclose(heights[200:, 2], heights[:-200, 0], atol=1e-12)
    both = roads.delayed(
        roads.two_track(BUMP, roads.cosine_bump(0.0, duration=1.0)), positions=car.axle_positions, speed=14.35
    )
    tilted = simulate(car, both, duration=0.6)
    assert np.abs(tilted["roll"]).max() > 1e-3 > 1e-9 > np.abs(run["roll"]).max()
    assert float(tilted["roll"][160]) > 0  # left side up


@pytest.mark.slow
def test_gradients_of_ridden_metrics_agree_with_differences():
    """In geometry, mass and damper of a half car on a bump with delay, forward and in reverse."""
    names = ["front_distance", "sprung_mass", "rear.damper.rate"]
    road, car = roads.delayed(BUMP, delays=[0.0, 0.1]), half_car_002()
    start = np.array([1.0, 580.0, 1560.0])

    def metric(values):
        changed = replace(car, dict(zip(names, values, strict=True)))
        return simulate(changed, road, duration=0.8, substeps=1).metrics()["rms_sprung_acceleration"]

    derived = jax.jit(lambda values: (*jax.value_and_grad(metric)(values), jax.jacfwd(metric)(values)))
    _, reverse, forward = derived(start)
    np.testing.assert_allclose(forward, reverse, rtol=1e-9)
    for i, scale in enumerate(start):
        near, far = (
            (derived(start + s)[0] - derived(start - s)[0]) / (2 * s[i])
            for s in np.eye(3)[i] * scale * np.array([[1e-4], [2e-4]])
        )
        assert float(forward[i]) == pytest.approx(float((4 * near - far) / 3), rel=1e-6)


def replace_places(car, *places):
    return dataclasses.replace(car, places=places)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Frame((BODY, BODY), (LINK,), (TYRE,)), r"`bodies and places` must have names that differ"),
        (
            lambda: Frame((BODY, WHEEL), (LINK, LINK), (TYRE,)),
            r"`links and wheels with elements` must have names that differ",
        ),
        (lambda: Frame((BODY, WHEEL), (LINK,), (TYRE,), (Place("sprung"),)), r"`bodies and places` must have names"),
        (
            lambda: LumpedVehicle(Frame((BODY, WHEEL), (LINK,), (TYRE,), (Place("damper"),))).layout,
            r"must give each channel a name of its own, but is 'damper_velocity' of two: rate of the .* Rename",
        ),
        (lambda: replace_places(half_car_002(), Place("front_body", 1.0)).system(), r"'front_body_velocity' of two"),
        (lambda: replace_places(half_car_002(), Place("pitch", 1.0)).layout, r"'pitch_acceleration' of two"),
        (lambda: Frame((BODY,), (LINK,), (TYRE,)), r"`point` must be one of 'z_sprung'.*Did you mean"),
        (lambda: Frame((BODY, WHEEL), (LINK,), ()), r"`wheels` must hold one or more"),
        (lambda: Frame((BODY,), (), (Wheel("", Point({"pitch": 1.0}), 1e5),)), r"`point` must be one of 'z_sprung'"),
        (lambda: BODY.at(1.0), r"`axis` must be one that 'sprung' turns about, but is 'pitch'"),
        (lambda: Body("sprung", 1.0, pitch_inertia=-1.0), r"`Inertia.moment` must be positive \[kg m²\]"),
        (lambda: Seat(()), r"`masses` must hold one or more"),
        (lambda: Frame((BODY, WHEEL), (LINK,), (TYRE,)).place(Place("eye", body="cab")), r"`body` must be one of"),
    ],
)
def test_refuses_parts_that_do_not_fit(build, message):
    with pytest.raises(ValueError, match=message):
        build()


def test_a_law_across_an_angle_has_angles_and_moments():
    body = Body("sprung", 1200.0, pitch_inertia=2000.0)
    suspension = Link("heave", body.at() - WHEEL.at(), 60e3, elements=(DAMPER,))
    twist = Link("arm", body.pitch, 5e4, elements=(Element("bush", dampers.Linear(800.0)),), angular=True)
    car = LumpedVehicle(Frame((body, WHEEL), (suspension, twist), (TYRE,)))
    units = {"arm_stroke": "rad", "arm_damper_velocity": "rad/s", "arm_bush_force": "N m", "heave_stroke": "m"}
    assert {name: car.units[name] for name in units} == units
    of_metrics = {m.name: m.unit(car.units) for m in car.ride_metrics}
    assert of_metrics["arm_working_space_rms"] == "rad" and of_metrics["arm_bush_dissipated_power"] == "W"
    assert car.goal_metrics("travel") == ["heave_working_space_peak_to_peak"]
