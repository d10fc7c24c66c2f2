"""What holds for every kind of vehicle."""

from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxdamp import simulate
from jaxdamp.vehicles import AbstractVehicle, linearise, static_equilibrium

from .fleet import bumps, tracks, vehicles


FLEET = vehicles()
GRAVITY = 9.80665
IN_OTHERS = ("quarter car", "half car", "roll car", "golden car")  # a part of others: not driven here
LONG = ("full car", "walking beam", "independent tandem with cab", "half car with seat", "tracked hull")  # to compile
DRIVEN = [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in FLEET if name not in IN_OTHERS]


class Ride(NamedTuple):
    """A run and all that it says of itself, compiled together."""

    vehicle: AbstractVehicle
    motion: np.ndarray
    channels: dict
    metrics: dict
    energy: dict
    absorbed: dict


@eqx.filter_jit
def said(run):
    return run.channels, run.metrics(), run.energy_balance(), run.absorbed_by()


@pytest.fixture(scope="module", params=DRIVEN)
def driven(request):
    vehicle = FLEET[request.param]
    delays = np.asarray(vehicle.axle_positions)[np.array(vehicle.frame().axles)] / 15.0
    run = simulate(vehicle, tracks(bumps(0.1 + delays)))
    return Ride(vehicle, np.asarray(run.motion), *jax.tree.map(np.asarray, said(run)))


@pytest.fixture(scope="module", params=FLEET)
def built(request):
    """A vehicle, its matrices and its wheel loads."""
    vehicle = FLEET[request.param]
    return vehicle, *eqx.filter_jit(lambda v: (v.port_form(), v.static_wheel_loads()))(vehicle)


def test_stiffness_is_symmetric_and_holds_every_motion(built):
    vehicle, form, _ = built
    stiffness, mass = np.asarray(form.stiffness), np.asarray(form.mass)
    np.testing.assert_allclose(stiffness, stiffness.T, atol=1e-15 * stiffness.max())  # rounding of three products
    assert np.linalg.eigvalsh(stiffness).min() > 0
    assert np.linalg.eigvalsh(np.asarray(form.damping)).min() >= -1e-9
    assert np.linalg.eigvalsh(mass).min() > 0
    lifted = {name: 1.0 if name.startswith("z_") else 0.0 for name in vehicle.coordinates}
    up = np.array(list(lifted.values()))
    # lifted as a whole with the road, nothing is strained
    np.testing.assert_allclose(stiffness @ up, np.asarray(form.road_stiffness).sum(axis=1), atol=1e-9)
    road = 0.0 if form.port_road is None else np.asarray(form.port_road).sum(axis=1)
    np.testing.assert_allclose(np.asarray(form.ports) @ up, road, atol=1e-12)


def test_wheel_loads_carry_the_weight_and_its_moments(built):
    vehicle, _, loads = built
    loads, frame = np.asarray(loads), vehicle.frame()
    assert loads.sum() == pytest.approx(GRAVITY * sum(float(body.mass) for body in frame.bodies), rel=1e-9)
    assert np.all(loads > 0)
    # without seats and cab every mass has a place: moments about the front axle
    if {"z_seat", "z_cab"}.isdisjoint(vehicle.coordinates) and hasattr(vehicle, "front_distance"):
        behind = np.asarray(vehicle.axle_positions)[np.array(frame.axles)]
        moment = float(vehicle.sprung_mass) * float(vehicle.front_distance)
        moment += sum(float(b.mass) * x for b, x in zip(frame.bodies[1:], _places(vehicle, behind), strict=True))
        assert loads @ behind == pytest.approx(GRAVITY * moment, rel=1e-9)


def _places(vehicle, behind):
    return [behind[0], behind[1:].mean()] if len(vehicle.frame().bodies) == 3 and len(behind) == 3 else behind


@pytest.mark.parametrize("vehicle", FLEET.values(), ids=FLEET)
def test_units_cover_the_channels_and_metrics_name_channels(vehicle: AbstractVehicle):
    units = vehicle.units
    assert {m.channel for m in vehicle.ride_metrics} <= set(units)
    assert len({m.name for m in vehicle.ride_metrics}) == len(vehicle.ride_metrics)
    assert {unit for unit in units.values()} <= {"m", "rad", "m/s", "rad/s", "m/s^2", "rad/s^2", "N", ""}
    assert "rms_sprung_acceleration" in {m.name for m in vehicle.ride_metrics}


def test_channels_are_those_of_the_units(driven):
    assert set(driven.channels) == set(driven.vehicle.units)
    assert all(np.all(np.isfinite(values)) for values in driven.channels.values())
    assert set(driven.metrics) == {m.name for m in driven.vehicle.ride_metrics}


def test_accelerations_are_the_slopes_of_the_motion(driven):
    """The channel is computed from forces, the motion by the engine."""
    n = len(driven.vehicle.coordinates)
    for i, name in enumerate(driven.vehicle.coordinates):
        acceleration = driven.channels[f"{name.removeprefix('z_')}_acceleration"]
        mean, slope = 0.5 * (acceleration[1:] + acceleration[:-1]), np.diff(driven.motion[:, n + i]) / 1e-3
        np.testing.assert_allclose(slope, mean, atol=2e-2 * np.abs(acceleration).max() + 1e-12)


def test_weight_and_tyres_are_all_that_moves_the_vehicle(driven):
    """Σ m z̈ = Σ dynamic tyre loads, at every instant and for any law: what is inside cancels."""
    bodies = driven.vehicle.frame().bodies
    momentum = sum(float(body.mass) * driven.channels[f"{body.name}_acceleration"] for body in bodies)
    loads = sum(values for name, values in driven.channels.items() if name.endswith("dynamic_tyre_load"))
    np.testing.assert_allclose(momentum, loads, atol=1e-9 * np.abs(loads).max() + 1e-9)


def test_energy_balance_closes(driven):
    parts = {name: float(value) for name, value in driven.energy.items()}
    given = parts["stored"] + parts["absorbed"] + parts["dashpots"]
    assert parts["road_work"] > 0
    assert parts["road_work"] == pytest.approx(given, rel=2e-3)
    by_element = driven.absorbed
    assert set(by_element) == set(driven.vehicle.frame().element_names)
    assert sum(map(float, by_element.values())) == pytest.approx(parts["absorbed"], rel=1e-12)
    assert all(float(energy) >= -1e-9 for name, energy in by_element.items() if name.endswith("damper"))


@pytest.mark.parametrize("name", ["full car", "walking beam"])
@pytest.mark.exhaustive_cases("full car")
def test_settled_vehicle_follows_level_and_tilted_ground(name):
    """On any plane the suspension is not strained; the linear vehicle says the same."""
    vehicle = FLEET[name]
    frame = vehicle.frame()
    behind = np.asarray(vehicle.axle_positions)[np.array(frame.axles)]
    heights = 0.2 - 0.01 * behind
    rest = static_equilibrium(vehicle, heights)
    assert float(rest["pitch"]) == pytest.approx(0.01, rel=1e-9)
    form = vehicle.port_form()
    position = np.array([float(value) for value in rest.values()])
    np.testing.assert_allclose(form.at_ports(jax.numpy.asarray(position), jax.numpy.asarray(heights)), 0.0, atol=1e-12)
    settled = np.asarray(linearise(vehicle).settled())[: len(position)] @ heights
    np.testing.assert_allclose(settled, position, atol=1e-9)
