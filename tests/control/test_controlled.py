"""A controlled vehicle in simulations, rides, sweeps and derivatives, and what is refused."""

from typing import cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdamp
from jaxdamp import Ride, roads, simulate, simulation, vehicles
from jaxdamp.control import (
    AbstractPolicy,
    AccelerationDriven,
    BandSkyhook,
    Controlled,
    Groundhook,
    PowerDriven,
    Skyhook,
    StateFeedback,
    lqr,
)
from jaxdamp.dampers import AbstractDamper, Bilinear, BoucWen, Lag, Linear, LuGre, MotionRatio, Scheduled, SeriesSpring
from jaxdamp.vehicles import Body, Corner, Element, Frame, HalfCar, Link, QuarterCar, Seat, SeatMass, Wheel


METRICS = ["rms_sprung_acceleration", "rms_dynamic_tyre_load"]
DAMPER = Scheduled((Linear(300.0), Linear(3900.0)), levels=[0.0, 1.0], command=0.25)
SPRUNG = Scheduled(tuple(SeriesSpring(Linear(c), 2e5) for c in (300.0, 3900.0)), levels=[0.0, 1.0], command=0.0)
NO_POLICY = cast("AbstractPolicy", 3000.0)
ROAD = roads.iso8608("C", speed=20.0, seed=1, duration=4.0)


def quarter(damper: AbstractDamper = DAMPER):
    return QuarterCar(400.0, 50.0, 20e3, 250e3, damper)


@pytest.fixture(scope="module")
def car():
    return Controlled(quarter(), Skyhook(3000.0, 0.01), actuator_lag=4e-3, sensor_lag=2e-3, delay=3e-3)


@pytest.fixture(scope="module")
def ride(car):
    return Ride(car, ROAD, metrics=METRICS, duration=2.0)


@pytest.fixture(scope="module")
def response(car):
    return simulate(car, ROAD, duration=2.0)


def test_the_numbers_of_a_policy_with_a_filter_are_swept():
    """Its states, which begin at zero, were no arrays to the loop that is printed as C, and the sweep failed."""
    axes = {"policy.low": [0.1, 1.0], "policy.high": [5.0]}
    ride = Ride(Controlled(quarter(), BandSkyhook(3000.0)), ROAD, metrics=METRICS[:1], duration=0.5)
    data = jaxdamp.sweep(ride, axes, chunk=2)
    for low in axes["policy.low"]:
        alone = ride({"policy.low": low, "policy.high": 5.0})[METRICS[0]]
        assert float(data[METRICS[0]].sel({"policy.low": low})[0]) == pytest.approx(float(alone), rel=1e-9)


def test_simulation_ride_sweep_and_printed_loop_give_the_same_numbers(car, ride, response):
    gains = np.array([3000.0, 1500.0])
    printed = Ride(car, ROAD, metrics=METRICS, duration=2.0, engine=simulation.Exponential(printed=True))
    one, swept = ride({"policy.gain": 3000.0}), jaxdamp.sweep(ride, {"policy.gain": gains}, chunk=2)
    in_c = jax.vmap(lambda gain: printed({"policy.gain": gain}))(gains)
    of_response = response.metrics(METRICS)
    for name in METRICS:
        np.testing.assert_allclose(one[name], of_response[name], rtol=1e-11)
        np.testing.assert_allclose(swept[name][0], one[name], rtol=1e-11)
        np.testing.assert_allclose(swept[name], in_c[name], rtol=1e-11)
        assert swept[name][0] != swept[name][1]


def test_a_run_goes_on_where_it_stopped_with_what_the_controller_knew(car, response):
    first, state = simulate(car, ROAD, duration=1.002, return_state=True)  # 1002 steps, no whole number of periods
    second = simulate(car, ROAD, duration=0.998, state=state)
    np.testing.assert_allclose(second.motion[-1], response.motion[-1], rtol=1e-12)
    np.testing.assert_array_equal(first["damper_command"], response["damper_command"][:1003])
    np.testing.assert_allclose(second["damper_command"], response["damper_command"][1002:], rtol=1e-12)


def test_derivatives_are_those_of_differences(ride):
    start = {"policy.gain": 3000.0, "policy.lead": 0.01, "actuator_lag": 4e-3, "car.damper.laws.1.rate": 3900.0}

    def cost(point):
        return ride(point)["rms_sprung_acceleration"]

    along = {name: value * np.cos(i) for i, (name, value) in enumerate(start.items())}  # shows each slope
    reverse, forward = jax.jit(lambda point: (jax.grad(cost)(point), jax.jvp(cost, (point,), (along,))[1]))(start)
    np.testing.assert_allclose(sum(reverse[name] * along[name] for name in start), forward, rtol=1e-9)
    for name, value in start.items():
        step = 1e-4 * value
        slope = (cost(start | {name: value + step}) - cost(start | {name: value - step})) / (2.0 * step)
        np.testing.assert_allclose(reverse[name], slope, rtol=1e-5)


def test_the_energy_of_a_controlled_run_is_that_of_its_forces(response):
    balance = response.energy_balance()
    assert abs(balance["error"]) < 3e-3 * balance["road_work"]  # trapezoids over jumps of the force
    rate = 300.0 + 3600.0 * np.asarray(response["damper_command"])
    np.testing.assert_allclose(response["damper_force"], rate * response["damper_velocity"], rtol=1e-10)


def test_without_lag_a_command_is_held_from_its_time_to_the_next(car):
    held = Controlled(car.car, Skyhook(3000.0), delay=2e-3)
    command = np.asarray(simulate(held, ROAD, duration=0.5)["damper_command"])
    assert np.all(command[:3] == 0.25)  # up to and with the instant at which the first is applied
    changes = np.flatnonzero(np.diff(command)) + 1
    assert changes.size > 80 and np.all(changes % 5 == 3)  # the first instant under a new command


@pytest.mark.parametrize(
    "damper",
    [
        Scheduled((Linear(300.0), Linear(900.0), Linear(3900.0)), levels=[-1.0, 0.0, 2.0], command=0.0),
        pytest.param(
            Scheduled((Linear(300.0), Bilinear(3900.0, 3900.0)), levels=[0.0, 1.0], command=0.0, blend="force"),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            MotionRatio(Scheduled((Linear(600.0), Linear(7800.0)), levels=[0.0, 1.0], command=0.0), 0.5**0.5),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            3.0 * Scheduled((Linear(100.0), Linear(1300.0)), levels=[0.0, 1.0], command=0.0) + Linear(1e-3),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["three levels", "forces", "motion ratio", "scaled, in a sum"],
)
def test_a_demanded_force_is_given_where_the_damper_can(damper):
    run = simulate(
        Controlled(quarter(damper), StateFeedback(velocity=1500.0), still=1e-3, period=1e-3), ROAD, duration=1.0
    )
    force, velocity = run["damper_force"], run["damper_velocity"]
    fast = np.abs(velocity) > 0.05
    assert np.count_nonzero(fast) > 300
    np.testing.assert_allclose(force[fast] / velocity[fast], 1500.0, rtol=0.03)  # limits are rounded


def test_beyond_its_limits_a_damper_gives_what_comes_nearest():
    on_off = simulate(Controlled(quarter(), Skyhook(1e9), period=1e-3), ROAD, duration=1.0)
    command, demand = np.asarray(on_off["damper_command"])[1:], np.asarray(on_off["damper_demand"])[1:]
    moves = np.abs(np.asarray(on_off["damper_velocity"])[:-1]) > 0.01
    hard = demand * np.asarray(on_off["damper_velocity"])[:-1] > 0.0
    assert np.all(command[moves & hard] > 0.99) and np.all(command[moves & ~hard] < 0.01)
    assert 0.2 < np.mean(hard) < 0.8


def test_dampers_have_policies_and_states_of_their_own():
    half = HalfCar(700.0, 1200.0, 1.2, 1.5, Corner(40.0, 18e3, 200e3, DAMPER), Corner(45.0, 22e3, 200e3, DAMPER))
    front = Controlled(half, {"front_damper": Skyhook(3000.0)})
    run = simulate(front, ROAD, duration=1.0)
    assert {"front_damper_command", "front_damper_demand"} <= set(run.units) and "rear_damper_command" not in run.units
    assert run.units["front_damper_demand"] == "N"
    rear = np.asarray(run["rear_damper_force"] / run["rear_damper_velocity"])[50:]
    np.testing.assert_allclose(rear, 1200.0, rtol=1e-6)  # keeps its command
    both = simulate(Controlled(half, Skyhook(3000.0)), ROAD, duration=1.0)
    assert np.any(both["front_damper_command"] != both["rear_damper_command"])
    metrics = both.metrics()
    assert float(metrics["rms_pitch_angle"]) > 0.0  # from the static equilibrium, which has no commands
    part = both.between(0.5, 1.0)
    np.testing.assert_array_equal(part["rear_damper_command"], both["rear_damper_command"][500:])


def test_commands_and_demands_are_those_of_their_damper():
    seat = Seat((SeatMass(80.0, 6e3, DAMPER),), name="aft")  # before the damper of the wheel in the alphabet only
    car = Controlled(QuarterCar(400.0, 50.0, 20e3, 250e3, DAMPER, seats=(seat,)), Skyhook())
    assert car.layout.ports == car.system().control.dampers == ("damper", "aft_damper")
    names = [f"{name}_{what}" for what in ("command", "demand") for name in car.layout.ports]
    assert [channel.name for channel in car.layout.channels[-4:]] == names


@pytest.mark.slow
def test_the_body_is_what_stands_above_a_damper_also_on_seats_and_road_wheels():
    seat = Seat((SeatMass(80.0, 6e3, Scheduled((Linear(100.0), Linear(2000.0)), [0.0, 1.0], 0.0)),))
    with_seat = QuarterCar(400.0, 50.0, 20e3, 250e3, Linear(1500.0), seats=(seat,))
    hull = vehicles.presets.m113_003(damper=Scheduled((Linear(5e3), Linear(5e4)), [0.0, 1.0], 0.0))
    half = HalfCar(700.0, 1200.0, 1.2, 1.5, Corner(40.0, 18e3, 200e3, DAMPER), Corner(45.0, 22e3, 200e3, DAMPER))
    names = {"seat": ["z_seat"], "hull": ["z_sprung", "pitch"], "half": ["z_sprung", "pitch"]}
    for case, car in {"seat": with_seat, "hull": hull, "half": half}.items():
        run = simulate(Controlled(car, Skyhook(1.0), period=1e-3), ROAD, duration=0.5)  # demands the velocity
        rates = np.asarray(run.motion)[:, len(car.coordinates) :]
        for name in (unit.removesuffix("_demand") for unit in run.units if unit.endswith("_demand")):
            row = np.asarray(run.system.form.ports)[run.system.layout.ports.index(name)]
            body = [car.coordinates.index(coordinate) for coordinate in names[case]]
            expected = rates[:-1, body] @ row[body] / car.frame().element(name).count
            assert np.ptp(expected) > 0.01
            np.testing.assert_allclose(run[f"{name}_demand"][1:], expected, rtol=1e-9, atol=1e-12)


class Network(AbstractPolicy):
    """A network with a memory of the last body velocity."""

    layers: eqx.nn.MLP

    def initial_state(self):
        return jnp.zeros(())

    def __call__(self, seen, state):
        inputs = jnp.stack([seen.body_velocity, seen.body_velocity - state, seen.velocity])
        return 1e3 * self.layers(inputs), seen.body_velocity


@pytest.mark.slow
def test_a_network_is_trained_through_the_ride():
    network = Network(eqx.nn.MLP(3, "scalar", 8, 1, jnp.tanh, key=jax.random.key(0)))
    ride = Ride(Controlled(quarter(), network), ROAD, metrics=METRICS, duration=1.0)

    @eqx.filter_jit
    @eqx.filter_value_and_grad
    def cost(network):
        return eqx.tree_at(lambda ride: ride.vehicle.policy, ride, network)()["rms_sprung_acceleration"]

    before, slope = cost(network)
    downhill = jax.tree.map(lambda w, s: w - 0.1 * s if eqx.is_inexact_array(w) else w, network, slope)
    assert 0.0 < float(cost(downhill)[0]) < float(before)


def test_a_law_with_states_is_commanded():
    laws = tuple(
        BoucWen(c, 1e3, 4e4, 8e3, 8e3, 1.0, 2.0) if False else Linear(c) + Lag(Linear(c), 0.01) for c in (300.0, 1500.0)
    )
    run = simulate(Controlled(quarter(Scheduled(laws, levels=[0.0, 1.0], command=0.0)), Skyhook()), ROAD, duration=1.0)
    assert np.ptp(run["damper_command"]) > 0.8 and np.all(np.isfinite(run["damper_force"]))


@pytest.mark.parametrize(
    ("law", "blend"),
    [
        (lambda f: BoucWen(600.0, 0.0, 150.0 * f, 1e-3), "parameters"),
        pytest.param(
            lambda f: LuGre(1e5 * f, 300.0, 500.0, 100.0 * f, 120.0 * f, 0.02), "force", marks=pytest.mark.slow
        ),
        pytest.param(lambda f: Linear(600.0) + SeriesSpring(Linear(500.0 * f), 2e5), "force", marks=pytest.mark.slow),
    ],
    ids=["Bouc-Wen", "LuGre", "series spring"],
)
def test_laws_whose_states_give_the_force_are_commanded(law, blend):
    damper = Scheduled((law(1.0), law(6.0)), levels=[0.0, 1.0], command=0.2, blend=blend)
    car = Controlled(quarter(damper), Skyhook(2e4), actuator_lag=5e-3)
    bump = roads.cosine_bump(0.05, start=0.2, length=2.0, speed=10.0)
    coarse, fine = (simulate(car, bump, duration=1.0, dt=dt) for dt in (1e-3, 2.5e-4))
    assert np.ptp(fine["damper_command"]) > 0.7
    error = coarse["z_sprung"] - fine["z_sprung"][::4]
    assert np.abs(error).max() < 2e-3 * np.abs(fine["z_sprung"]).max()


@pytest.mark.slow
def test_lags_shorter_than_a_step_are_driven_too():
    car = Controlled(quarter(), Skyhook(3000.0))
    lags = {"actuator_lag": [0.0, 1e-9, 1e-5, 1e-4, 5e-4, 9.99e-4, 1.001e-3]}  # of 1 ms
    steps = (1e-3, 1.25e-4)
    coarse, exact = (jaxdamp.sweep(Ride(car, ROAD, metrics=METRICS, duration=2.0, dt=dt), lags) for dt in steps)
    for name in METRICS:
        np.testing.assert_allclose(coarse[name], exact[name], rtol=3e-3)


def test_steps_are_short_enough_for_all_commands():
    steep = quarter(Scheduled((Linear(300.0), Linear(2e5)), levels=[0.0, 1.0], command=0.0))
    ride = Ride(Controlled(steep, Skyhook(1e9)), ROAD, metrics=METRICS, duration=1.0)
    assert ride.substeps > Ride(steep, ROAD, metrics=METRICS, duration=1.0).substeps == 1
    assert float(ride()["rms_sprung_acceleration"]) < 10.0


@pytest.mark.slow
def test_the_error_of_a_coarse_step_is_estimated_without_the_controller():
    half = HalfCar(700.0, 1200.0, 1.2, 1.5, Corner(40.0, 18e3, 2e6, DAMPER), Corner(45.0, 22e3, 2e6, DAMPER))
    with pytest.warns(simulation.CoarseStepWarning, match="coarse for this vehicle"):
        Ride(Controlled(half, Skyhook()), roads.iso8608("C", speed=20.0, seed=1), duration=2.0, dt=5e-3)


@pytest.mark.slow
def test_a_wheel_that_lifts_on_a_commanded_damper_never_pulls():
    """Lift-off computes the force of the damper a second time, which must be that of the same command."""
    law = Scheduled((Linear(5e3), Linear(3e4)), levels=[0.0, 1.0], command=1.0)
    hull = Controlled(vehicles.presets.m113_003(law, tyre_lifts=True), Skyhook(gain=1e4))
    response = simulate(hull, roads.iso8608("E", speed=8.0, seed=1), duration=1.0, dt=1e-3)
    load, command = (np.asarray(response[f"wheel_1_{name}"]) for name in ("relative_tyre_load", "damper_command"))
    assert 0.0 < np.max(command[load < -0.999]) < 0.5  # in the air, not at the command of the law itself
    assert np.min(load) == pytest.approx(-1.0, abs=1e-9)


@pytest.mark.slow
def test_single_precision_drives_too(car):
    with jax.enable_x64(False):
        single = Controlled(quarter(Scheduled((Linear(300.0), Linear(3900.0)), [0.0, 1.0], 0.25)), Groundhook())
        values = Ride(single, roads.iso8608("C", speed=20.0, seed=1), metrics=METRICS, duration=1.0)()
        on_off = Controlled(single.car, AccelerationDriven(1e12))
        command = simulate(on_off, roads.iso8608("C", speed=20.0, seed=1), duration=1.0)["damper_command"]
    assert values[METRICS[0]].dtype == jnp.float32 and 0.5 < float(values[METRICS[0]]) < 5.0
    assert -1e-4 < float(jnp.min(command)) < 0.01 and 0.99 < float(jnp.max(command)) < 1.0001


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Controlled(quarter(Linear(1500.0)), Skyhook()), "`car` must have a damper with one `Scheduled` law"),
        (lambda: Controlled(quarter(Lag(DAMPER, 0.01)), Skyhook()), "`damper` must have a force that changes at once"),
        (lambda: Controlled(quarter(SPRUNG), Skyhook()), "Blend the forces of its levels"),
        (lambda: Controlled(_lever(0.7), Skyhook()), "`damper` must have the difference .* 0.7 times"),
        (lambda: lqr(_lever(0.7)), "`damper` must have the difference .* 0.7 times"),
        (lambda: Controlled(quarter(), {"rear_damper": Skyhook()}), "`policy` must be one of 'damper'"),
        (
            lambda: Controlled(quarter(), {"damper": cast("AbstractPolicy", 3000.0)}),
            r"`policy\['damper'\]` must be a policy",
        ),
        (lambda: Controlled(quarter(), Skyhook(), period=0.0), "`period` must"),
        (lambda: Controlled(quarter(), Skyhook(), delay=-1e-3), "`delay` must be finite and not negative"),
        (lambda: Controlled(quarter(), Skyhook(gain=-1.0)), "gain"),
        (lambda: simulate(_period(7.5e-4), ROAD, duration=1.0), "`period` must be a whole number of steps of 0.001 s"),
        (lambda: Ride(_period(5e-3, 5e-4), ROAD, duration=1.0), "`delay` must be a whole number of steps"),
        (lambda: Ride(_period(5e-3), roads.white("C", speed=20.0)), "without a controller for a ride on a white road"),
        (lambda: vehicles.linearise(_period(5e-3)), "without a controller for a linear vehicle"),
        (
            lambda: simulate(_period(5e-3), ROAD, duration=1.0, engine=simulation.Adaptive(diffrax.Tsit5())),
            "fixed steps",
        ),
        (lambda: simulation.harmonic_response(_period(5e-3), [1.0], 0.01), "for a periodic response"),
    ],
)
def test_what_cannot_be_controlled_is_refused(make, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=message):
        make()


def _lever(ratio):
    """A quarter car whose damper has another travel than the wheel, by its points."""
    body, wheel = Body("sprung", 400.0), Body("unsprung", 50.0)
    rise = body.at() - wheel.at()
    links = Link("spring", rise, 20e3), Link("", ratio * rise, elements=(Element("damper", DAMPER),))
    return vehicles.LumpedVehicle(Frame((body, wheel), links, (Wheel("", wheel.at(), 250e3),)))


def test_a_damper_between_points_is_controlled_as_one_of_a_car():
    assert Controlled(_lever(1.0), Skyhook()).commanded(["damper"])[0] == ("damper",)


def _period(period, delay=0.0):
    return Controlled(quarter(), PowerDriven(20e3), period=period, delay=delay)
