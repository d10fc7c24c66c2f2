"""The assembled vehicle: matrices and channels by hand, and kinds that no name decides."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers, simulate
from jaxdamp.parameters import replace
from jaxdamp.simulation import response
from jaxdamp.vehicles import Body, ChannelKind, Frame, LumpedVehicle, QuarterCar, Suspension, Wheel, base

from .fleet import bumps, tracks, vehicles


FLEET = vehicles()
CAR = QuarterCar(300.0, 40.0, 20e3, 180e3, dampers.Linear(1500.0), 120.0, damper_count=2)


def test_matrices_and_channels_of_a_quarter_car_by_hand(rng):
    """Signals drawn at random; f is the force of both dampers together."""
    system = CAR.system()
    (zs, zu, vs, vu), (f,), (road,), (rate,) = (rng.normal(size=n) for n in (4, 1, 1, 1))
    spring, tyre = 20e3 * (zs - zu), 180e3 * (zu - road) + 120.0 * (vu - rate)
    body, wheel = -(spring + f) / 300.0, (spring + f - tyre) / 40.0
    at = [jnp.array(values) for values in ((zs, zu, vs, vu), (f,), (road,), (rate,))]
    np.testing.assert_allclose(system.motion(*at), [vs, vu, body, wheel], rtol=1e-12)
    expected = {
        "z_sprung": zs,
        "sprung_acceleration": body,
        "z_unsprung": zu,
        "unsprung_acceleration": wheel,
        "stroke": zs - zu,
        "damper_velocity": vs - vu,
        "damper_force": f / 2,
        "z_road": road,
        "dynamic_tyre_load": -tyre,
        "relative_tyre_load": -tyre / (340.0 * 9.80665),
        "sprung_velocity": vs,
        "unsprung_velocity": vu,
    }
    assert set(expected) == set(system.layout.units)
    for found, name in zip(system.outputs(*at), system.layout.units, strict=True):
        assert float(found) == pytest.approx(expected[name], rel=1e-12), name
    two = system.channels(["stroke", "z_road"]).scalars()(*map(tuple, at))
    assert [float(value) for value in two] == pytest.approx([zs - zu, road], rel=1e-14)


@pytest.mark.parametrize("vehicle", FLEET.values(), ids=FLEET)
def test_every_channel_has_a_kind_and_a_place(vehicle):
    layout, frame = vehicle.layout, vehicle.frame()
    kinds = [channel.kind for channel in layout.channels]
    for kind in (ChannelKind.TYRE_LOAD, ChannelKind.RELATIVE_TYRE_LOAD, ChannelKind.ROAD_HEIGHT):
        assert [c.place for c in layout.channels if c.kind is kind] == [wheel.name for wheel in frame.wheels]
    assert kinds.count(ChannelKind.FORCE) == len([name for name in layout.ports if "lift_off" not in name])
    turns = sum(len(body.turns) for body in frame.bodies)
    assert kinds.count(ChannelKind.ANGLE) == kinds.count(ChannelKind.ANGULAR_ACCELERATION) == turns
    weighted = [m.channel for m in layout.metrics if m.weighting is not None]
    assert {layout.weighting(name) for name in weighted} <= {"Wk", "We"}
    assert layout.weighting("sprung_acceleration") == "Wk"


def test_no_name_decides_what_a_channel_is():
    body = Body("z_cab_stroke", 300.0, pitch_inertia=100.0)
    ends = [Wheel(name, body.at(x), 2e4, behind=1.0 - x) for name, x in (("left", 1.0), ("lift_off", -1.0))]
    vehicle = LumpedVehicle(Frame((body,), (), tuple(ends)))
    assert (
        vehicle.units["z_cab_stroke_pitch"] == "rad" and vehicle.units["z_cab_stroke_pitch_acceleration"] == "rad/s^2"
    )
    assert vehicle.layout.by_name["z_cab_stroke_pitch"].kind is ChannelKind.ANGLE
    assert "rms_z_cab_stroke_pitch_angle" in {metric.name for metric in vehicle.ride_metrics}
    with pytest.raises(ValueError, match="`channel` must be an acceleration, which ISO 2631-1 weights"):
        vehicle.layout.weighting("z_left_road")


def test_axles_are_named_by_what_their_wheels_share():
    assert FLEET["full car"].layout.axle_names == ("front", "rear")
    assert FLEET["walking beam"].layout.axle_names == ("front", "tandem_1", "tandem_2")
    assert FLEET["roll car"].layout.axle_names == ("number 1",)


def test_a_channel_is_computed_alone_and_once(monkeypatch):
    run, calls = simulate(CAR, tracks(bumps([0.02], 101))), []
    compute = response._channel
    monkeypatch.setattr(response, "_channel", lambda *arguments: calls.append(1) or compute(*arguments))
    assert run["stroke"] is run["stroke"] and len(calls) == 1
    assert set(run.channels) == set(run.units) and len(calls) == len(run.units)
    other = simulate(CAR, tracks(bumps([0.02], 101)))
    traced = jax.jit(lambda: 2.0 * other["stroke"])()
    np.testing.assert_array_equal(traced, 2.0 * other["stroke"])  # nothing traced was remembered
    scaled = eqx.tree_at(lambda response: response.motion, run, 2.0 * run.motion)
    np.testing.assert_allclose(scaled["stroke"], 2.0 * run["stroke"])  # nor what belongs to another response


def test_what_is_remembered_compiles_nothing_again():
    """A module with anything beside its fields is another pytree, and a compiled function would compile again."""
    car = QuarterCar(301.0, 40.0, 20e3, 180e3, dampers.Linear(1500.0))
    run = simulate(car, tracks(bumps([0.02], 101)))
    before = [jax.tree.structure(tree) for tree in (car, run, car.system())]
    assert run.channels and car.layout.by_name and run.metrics()
    assert [jax.tree.structure(tree) for tree in (car, run, car.system())] == before
    assert car.layout is QuarterCar(302.0, 40.0, 20e3, 180e3, dampers.Linear(1.0)).layout


def test_a_suspension_of_a_vehicle_of_ones_own():
    body, axle = Body("sprung", 600.0), Body("unsprung", 60.0)
    link = Suspension(45e3, dampers.Linear(3e3)).link("", body.at() - axle.at())
    own = LumpedVehicle(Frame((body, axle), (link,), (Wheel("", axle.at(), 4e5),)))
    ready = QuarterCar(600.0, 60.0, 45e3, 4e5, dampers.Linear(3e3))
    assert own.layout == ready.layout
    np.testing.assert_array_equal(own.system().outputs.motion, ready.system().outputs.motion)


def test_the_layout_adds_nothing_to_a_program():
    """A program is the same with and without the layout in the cache."""
    base._layout_of.cache_clear()

    def program() -> str:
        return str(jax.make_jaxpr(lambda mass: mass * len(replace(CAR, {"sprung_mass": mass}).coordinates))(500.0))

    assert program() == program()
    layouts = base._layout_of.cache_info()
    assert layouts.hits == layouts.misses == 1


def test_the_cache_of_layouts_is_bounded_and_holds_no_numbers():
    """Cars that differ in numbers only share one entry, and the cache cannot grow without bound."""
    base._layout_of.cache_clear()
    for mass in (300.0, 400.0, 500.0):
        assert replace(CAR, {"sprung_mass": mass}).layout is CAR.layout
    layouts = base._layout_of.cache_info()
    assert layouts.currsize == 1 and layouts.maxsize == 256
