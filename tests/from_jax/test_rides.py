"""Rides and laws in programs of one's own: compiled, batched, differentiated, spread over devices."""

import os
import subprocess
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, _checks, dampers, roads, simulate, tune, vehicles
from jaxdamp.parameters import replace
from jaxdamp.vehicles.presets import half_car_002, quarter_car_000


BUMP = roads.cosine_bump(0.05, start=0.02, duration=0.1)
RMS = "rms_sprung_acceleration"
LINEAR = dampers.Linear(1500.0)


@pytest.fixture(scope="module")
def ride():
    return Ride(quarter_car_000(LINEAR), BUMP, metrics=[RMS], duration=0.2)


def test_rides_and_laws_are_functions_that_jit_takes(ride):
    point = {"rate": 1200.0}
    assert float(jax.jit(ride)(point)[RMS]) == pytest.approx(float(ride(point)[RMS]), rel=1e-12)
    assert float(jax.jit(LINEAR.force)(0.0, 2.0, jnp.zeros(0))) == 3000.0
    assert float(jax.jit(LINEAR.force_velocity)(2.0)) == 3000.0


def test_a_ride_is_a_tree_of_numbers(ride):
    half = Ride(half_car_002(LINEAR), roads.iso8608("C", 20.0, 1.0, seed=1), duration=0.2)
    for one in (ride, half):
        assert all(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(one))
    doubled = jax.tree.map(lambda leaf: 2.0 * leaf, ride)
    assert float(jax.jit(lambda ride: ride.vehicle.damper.rate)(doubled)) == 3000.0


def test_a_number_out_of_its_domain_is_refused_in_whatever_it_comes(ride):
    wrong = (-5.0, np.float64(-5.0), np.asarray(-5.0), jnp.asarray(-5.0))
    calls = [lambda value=value: ride({"rate": value}) for value in wrong]
    calls += [lambda: jax.vmap(ride)({"rate": jnp.asarray([5.0, -5.0])})]
    calls += [lambda: jax.grad(lambda rate: ride({"rate": rate})[RMS])(-5.0)]
    for call in calls:
        with pytest.raises(ValueError, match=r"`Linear.rate` must be positive"):
            call()


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: dampers.Linear(1.0 + 2.0j), "`rate` must be a real number"),
        (lambda: dampers.Linear(jnp.asarray(1.0 + 2.0j)), "`rate` must be a real number"),
        (lambda: dampers.PiecewiseLinear([0.1], [1.0, 2.0j]), "`slopes` must be a real number"),  # pyright: ignore
        (lambda: dampers.PiecewiseLinear([0.1], ["stiff", 2.0]), r"`slopes` must be numbers, but is \['stiff', 2.0\]"),  # pyright: ignore
        (lambda: dampers.PiecewiseLinear([0.1], [[1.0, 2.0], [3.0]]), r"`slopes` must be numbers, but is \[\[1.0"),  # pyright: ignore
        (lambda: dampers.Linear(10**400), "`rate` must be numbers, but is"),
        (lambda: dampers.Linear(object()), "`rate` must be numbers, but is"),  # pyright: ignore
        (lambda: simulate(quarter_car_000(eqx.filter_vmap(dampers.Linear)(jnp.ones(2))), BUMP), "must be one number"),
        (lambda: Ride(quarter_car_000(eqx.filter_vmap(dampers.Linear)(jnp.ones(2))), BUMP), "must be one number"),
        (lambda: jax.jit(lambda dt: _checks.plain_number("dt", dt))(1e-3), "`dt` must be a plain number"),
        (lambda: jax.grad(lambda dt: _checks.plain_number("dt", dt))(1e-3), "`dt` must be a plain number"),
        (lambda: jax.grad(lambda c: vehicles.modes(quarter_car_000(dampers.Linear(c))))(1500.0), "known"),
        (lambda: jax.jit(lambda c: tune.minimise(RMS, quarter_car_000(dampers.Linear(c)), BUMP))(1e3), "outside"),
    ],
)
def test_what_cannot_be_computed_is_refused_in_a_sentence(call, said):
    with pytest.raises(ValueError, match=said):
        call()


@pytest.mark.slow
def test_a_plain_vmap_drives_cars_side_by_side():
    ride = Ride(half_car_002(LINEAR), roads.iso8608("C", 20.0, 1.0, seed=1), metrics=[RMS], duration=0.2)
    wide, point = ride.side_by_side(), {"sprung_mass": jnp.asarray([600.0, 700.0])}

    def program(ride, transform):
        return str(jax.make_jaxpr(transform(lambda point: ride(point)[RMS]))(point))

    for transform in (jax.vmap, lambda f: jax.vmap(jax.grad(f)), lambda f: jax.grad(lambda p: jax.vmap(f)(p).sum())):
        assert program(ride, transform) == program(wide, transform)


def test_another_vehicle_has_the_road_under_its_own_axles():
    car = half_car_002(LINEAR)
    ride = Ride(car, roads.iso8608("C", 20.0, 1.0, seed=1), metrics=[RMS], duration=0.2)

    def of_vehicle(distance):
        return ride.of_vehicle(replace(car, {"rear_distance": distance}))()[RMS]

    start, way = (jnp.asarray(car.rear_distance),), (jnp.ones(()),)
    value, slope = jax.jvp(of_vehicle, start, way)
    expected = jax.jvp(lambda distance: ride({"rear_distance": distance})[RMS], start, way)
    np.testing.assert_allclose((value, slope), expected, rtol=1e-9)
    longer = ride.of_vehicle(replace(car, {"rear_distance": 2.0}))
    assert longer.heights is not None and ride.heights is not None
    assert not np.array_equal(longer.heights, ride.heights)


ON_TWO_DEVICES = """
import jax, jax.numpy as jnp, numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxdamp import Ride, dampers, respond, roads, simulate, vehicles
from jaxdamp.vehicles.presets import quarter_car_000

bump = roads.cosine_bump(0.05, start=0.02, duration=0.1)
car = quarter_car_000(dampers.Lag(dampers.Linear(1500.0), 0.004))
ride = Ride(car, bump, metrics=["rms_sprung_acceleration"], duration=0.1)
time = np.linspace(0.0, 0.05, 51)

def numbers(rate):
    law = dampers.Lag(dampers.Linear(rate), 0.004)
    run = simulate(quarter_car_000(law), bump, duration=0.1, substeps=1)
    force = respond(law, time, 0.01 * np.sin(20 * time))
    gas = vehicles.QuarterCar(300.0, 40.0, 20e3, 180e3, dampers.Linear(1500.0),
        extra_spring=dampers.GasSpring(1e3 * rate, 6e-5, 1e-4))
    lift = vehicles.static_equilibrium(gas)["z_sprung"]
    return jnp.stack([ride({"rate": rate})["rms_sprung_acceleration"], run["stroke"][-1], force[-1], 100.0 * lift])

rates, spec = jnp.asarray([900.0, 1500.0]), PartitionSpec("device")
mesh = Mesh(np.array(jax.devices()), ("device",))
spread = jax.jit(jax.shard_map(jax.vmap(numbers), mesh=mesh, in_specs=spec, out_specs=spec))(rates)
assert len(spread.sharding.device_set) == 2
alone = jax.jit(jax.vmap(numbers))(rates)
np.testing.assert_allclose(spread, alone, rtol=1e-4)

placed = jax.device_put(rates, NamedSharding(mesh, spec))
together = jax.jit(jax.vmap(numbers))(placed)
assert len(together.sharding.device_set) == 2
np.testing.assert_allclose(together, alone, rtol=1e-4)

def lift(charge):
    return numbers(charge)[3]

slopes = jax.jit(jax.shard_map(jax.vmap(jax.grad(lift)), mesh=mesh, in_specs=spec, out_specs=spec))(rates)
np.testing.assert_allclose(slopes, jax.jit(jax.vmap(jax.grad(lift)))(rates), rtol=1e-3)
"""


@pytest.mark.slow
def test_runs_are_spread_over_devices_by_shard_map():
    flags = f"{os.environ['XLA_FLAGS']} --xla_force_host_platform_device_count=2"
    env = os.environ | {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"}
    done = subprocess.run([sys.executable, "-c", ON_TWO_DEVICES], env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
