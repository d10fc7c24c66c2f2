"""Each policy against its formula written again, and those of all dampers together in runs."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import cont2discrete

from jaxdamp import Ride, control, roads, simulate, vehicles
from jaxdamp.control import (
    AbstractVehiclePolicy,
    BandSkyhook,
    Controlled,
    ModalSkyhook,
    Preview,
    Signals,
    Skyhook,
    StateFeedback,
    VehicleFeedback,
    lqr,
)
from jaxdamp.dampers import Linear, Scheduled, Spring
from jaxdamp.export import from_json, to_json
from jaxdamp.parameters import replace
from jaxdamp.vehicles import Axle, Corner, HalfCar, QuarterCar, RollCar, Seat, SeatMass


DAMPER = Scheduled((Linear(300.0), Linear(3900.0)), levels=[0.0, 1.0], command=0.25)
QUARTER = QuarterCar(400.0, 50.0, 20e3, 250e3, DAMPER)
HALF = HalfCar(700.0, 1200.0, 1.2, 1.5, Corner(40.0, 18e3, 200e3, DAMPER), Corner(45.0, 22e3, 200e3, DAMPER))
ROAD = roads.iso8608("C", speed=20.0, seed=1, duration=2.0)


def signals(*values):
    return Signals(*map(jnp.asarray, values))


SEEN = signals(0.2, -0.1, 1.5, 0.01, 0.3, 0.05, -0.02, 0.003)


def test_modal_skyhook_has_a_gain_for_each_part_of_the_velocity():
    assert SEEN.heave_velocity == pytest.approx(0.17)
    force, _ = ModalSkyhook(1000.0, 2000.0, 4000.0)(SEEN, ())
    assert float(force) == pytest.approx(1000.0 * 0.17 + 2000.0 * 0.05 - 4000.0 * 0.02)
    equal, _ = ModalSkyhook(1000.0, 1000.0, 1000.0)(SEEN, ())
    assert float(equal) == pytest.approx(float(Skyhook(1000.0)(SEEN, ())[0]))


def test_state_feedback_is_the_sum_over_its_signals():
    force, _ = StateFeedback(100.0, 200.0, 3.0, 4000.0, 50.0, 6000.0)(SEEN, ())
    assert float(force) == pytest.approx(100 * 0.2 - 200 * 0.1 + 3 * 1.5 + 4000 * 0.01 + 50 * 0.3 + 6000 * 0.003)


def test_the_band_of_skyhook_is_that_of_its_transfer_function_for_a_velocity_straight_between_samples():
    gain, low, high, period = 1500.0, 0.4, 6.0, 4e-3
    velocity = np.random.default_rng(0).standard_normal(60)
    velocity[0] = 0.0  # at rest before, as the filter
    w, v = 2.0 * np.pi * low, 2.0 * np.pi * high
    a, b = np.array([[-w - v, -w * v], [1.0, 0.0]]), np.array([[1.0], [0.0]])
    discrete: Any = cont2discrete((a, b, np.array([[v, 0.0]]), np.zeros((1, 1))), period, method="foh")
    a, b, c, d = (np.asarray(part) for part in discrete[:4])
    x, expected = np.zeros((2, 1)), []
    for u in velocity:
        expected.append(gain * (c @ x + d * u).item())
        x = a @ x + b * u

    policy = BandSkyhook(gain, low, high).sampled(period)

    def sample(state, u):
        force, state = policy(signals(u, 0.0, 0.0, 0.0, 0.0), state)
        return state, force

    _, found = jax.lax.scan(sample, jax.tree.map(jnp.asarray, policy.initial_state()), velocity)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


class Probe(AbstractVehiclePolicy):
    """Demands the signals themselves, another one of each damper."""

    def initial_state(self, dampers):
        return jnp.zeros(len(dampers))

    def __call__(self, seen, state):
        values = [lambda s: s.heave_velocity, lambda s: s.pitch_velocity, lambda s: s.roll_velocity]
        each = zip(seen.items(), [*values, lambda s: s.tyre_deflection], strict=True)
        return {name: value(signals) for (name, signals), value in each}, state + 1.0


def test_a_policy_of_all_dampers_sees_heave_pitch_roll_and_tyres_of_each():
    full = vehicles.presets.full_car_jazar(damper=DAMPER)
    time = np.linspace(0.0, 0.5, 101)
    heights = 0.02 * np.sin(2.0 * np.pi * np.array([2.0, 3.0, 4.0, 5.0]) * time[:, None])
    rolling = roads.from_profile(time, heights)
    run = simulate(Controlled(full, Probe(), period=1e-3), rolling, duration=0.4)
    names = list(full.coordinates)
    motion = dict(zip([*names, *(f"{name}'" for name in names)], np.asarray(run.motion).T, strict=True))
    half_track = 0.5 * float(full.rear.track_width)
    expected = {
        "front_left_damper": motion["z_sprung'"],
        "front_right_damper": float(full.front_distance) * motion["pitch'"],
        "rear_left_damper": half_track * motion["roll'"],
        "rear_right_damper": motion["z_rear_right_unsprung"] - np.asarray(run.road)[:, 3],
    }
    for name, values in expected.items():
        assert np.ptp(values) > 1e-5
        np.testing.assert_allclose(run[f"{name}_demand"][1:], values[:-1], rtol=1e-9, atol=1e-12)


def test_preview_takes_the_front_wheel_to_the_sample():
    period, delay, gains = 5e-3, 0.115, jnp.array([800.0, 0.0, -300.0])  # of now, and of two periods later
    policy = Preview(Skyhook(2000.0), gains, delay)
    run = simulate(Controlled(HALF, policy, period=period), ROAD, duration=0.6)
    rates = np.asarray(run.motion)[::5, 4:]  # at the samples
    body, wheel = rates[:, 0] - 1.5 * rates[:, 1], rates[:, 2]
    late = 800.0 * np.append(np.zeros(23), wheel[:-23]) - 300.0 * np.append(np.zeros(21), wheel[:-21])
    demand = np.asarray(run["rear_damper_demand"])[1::5]  # decided at the sample before
    np.testing.assert_allclose(demand, (2000.0 * body - late)[: demand.size], rtol=1e-9, atol=1e-9)
    front = 2000.0 * (rates[:, 0] + 1.2 * rates[:, 1])
    np.testing.assert_allclose(run["front_damper_demand"][1::5], front[: demand.size], rtol=1e-9, atol=1e-9)


def by_eigenvectors(a, b, q, r, s):
    """The feedback of the Riccati equation by the stable eigenvectors of its Hamiltonian matrix."""
    inverse = np.linalg.inv(r)
    f = a - b @ inverse @ s.T
    g, h = b @ inverse @ b.T, q - s @ inverse @ s.T
    values, vectors = np.linalg.eig(np.block([[f, -g], [-h, -f.T]]))
    stable = vectors[:, np.real(values) < 0.0]
    n = a.shape[0]
    riccati = np.real(stable[n:] @ np.linalg.inv(stable[:n]))
    return inverse @ (b.T @ riccati + s.T)


def test_the_gains_of_the_quarter_car_are_those_of_the_hamiltonian_matrix():
    ms, mu, ks, kt, stroke, tyre = 400.0, 50.0, 20e3, 250e3, 1500.0, 4e4
    policy = lqr(QUARTER, stroke=stroke, tyre=tyre)
    body = np.array([0.0, 0.0, -ks / ms, 0.0])
    a = np.array([body, [0.0, 0.0, ks / mu, -kt / mu], [1.0, -1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    b = np.array([[-1.0 / ms], [1.0 / mu], [0.0], [0.0]])
    q = np.outer(body, body) + np.diag([0.0, 0.0, stroke, tyre])
    gains = by_eigenvectors(a, b, q, np.array([[ms**-2]]), -body[:, None] / ms)
    found = [policy.body_velocity, policy.wheel_velocity, policy.stroke, policy.tyre_deflection]
    np.testing.assert_allclose(found, -gains[0], rtol=1e-7)
    assert float(policy.stroke) == pytest.approx(ms * stroke**0.5 - ks, rel=1e-7)  # in closed form
    assert isinstance(policy, StateFeedback) and float(policy.velocity) == 0.0 == float(policy.body_acceleration)


def test_a_half_car_of_two_quarters_has_the_gains_of_each():
    front, rear = 800.0, 640.0  # kg, with J = m l_a l_b
    corners = Corner(40.0, 18e3, 200e3, DAMPER), Corner(45.0, 22e3, 200e3, DAMPER)
    half = HalfCar(front + rear, front * rear / (front + rear) * 2.7**2, 1.2, 1.5, *corners)
    policy = lqr(half)
    for i, (mass, one) in enumerate(zip((front, rear), corners, strict=True)):
        own = lqr(QuarterCar(mass, one.unsprung_mass, one.spring_rate, one.tyre_stiffness, DAMPER))
        for name in ("body_velocity", "wheel_velocity", "stroke", "tyre_deflection"):
            gains = np.asarray(getattr(policy, name))
            assert gains[i, i] == pytest.approx(float(getattr(own, name)), rel=1e-6)
            assert abs(gains[i, 1 - i]) < 1e-6 * np.abs(np.diag(gains)).max()


def test_springs_as_laws_count_in_the_optimal_feedback():
    half = {"spring_rate": 0.5 * QUARTER.spring_rate}
    other = dataclasses.replace(replace(QUARTER, half), extra_spring=Spring(half["spring_rate"]))
    np.testing.assert_allclose(jax.tree.leaves(lqr(other)), jax.tree.leaves(lqr(QUARTER)), rtol=1e-9)


def test_feedback_of_the_vehicle_multiplies_gains_and_signals():
    rng = np.random.default_rng(0)
    gains = rng.standard_normal((4, 2, 2))
    one, other = (signals(*rng.standard_normal(8)) for _ in range(2))
    forces, _ = VehicleFeedback(*map(jnp.asarray, gains))({"front_damper": one, "rear_damper": other}, ())
    names = ("body_velocity", "wheel_velocity", "stroke", "tyre_deflection")
    expected = sum(
        gain @ [getattr(seen, name) for seen in (one, other)] for gain, name in zip(gains, names, strict=True)
    )
    np.testing.assert_allclose([forces["front_damper"], forces["rear_damper"]], expected, rtol=1e-12)


@pytest.mark.slow
def test_derivatives_by_gains_through_the_ride_are_those_of_differences():
    policy = Preview(BandSkyhook(3000.0, 0.4, 6.0), jnp.array([400.0]), 0.1)
    ride = Ride(Controlled(HALF, policy, actuator_lag=4e-3), ROAD, metrics=["rms_pitch_acceleration"], duration=0.5)
    start: dict[str, float | jax.Array] = {
        "actuator_lag": 4e-3,
        "policy.policy.gain": 3000.0,
        "policy.policy.low": 0.4,
        "policy.policy.high": 6.0,
    }

    start["policy.gains"] = jnp.array([400.0])
    along = {name: value * np.cos(i) for i, (name, value) in enumerate(start.items())}  # shows each slope

    @jax.jit
    def derived(point):
        def cost(point):
            return ride(point)["rms_pitch_acceleration"]

        return *jax.value_and_grad(cost)(point), jax.jvp(cost, (point,), (along,))[1]

    _, reverse, forward = derived(start)
    np.testing.assert_allclose(sum(np.sum(reverse[name] * along[name]) for name in start), forward, rtol=1e-8)
    for name, value in start.items():
        step = 1e-4 * value
        up, down = (derived(start | {name: value + sign * step})[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose(reverse[name], (up - down) / (2.0 * np.squeeze(step)), rtol=1e-5)


def test_what_was_delivered_of_the_demand_is_told():
    can = simulate(Controlled(QUARTER, StateFeedback(velocity=1500.0), still=1e-3, period=1e-3), ROAD, duration=0.5)
    cannot = simulate(Controlled(QUARTER, StateFeedback(velocity=-1500.0), still=1e-3, period=1e-3), ROAD, duration=0.5)
    assert can.delivered()["damper"].share == pytest.approx(1.0, abs=0.02)
    assert can.delivered()["damper"].resisting > 0.95  # the demand is a sample old
    share, resisting = cannot.delivered()["damper"]
    assert resisting < 0.05
    demand, force = np.asarray(cannot["damper_demand"]), np.asarray(cannot["damper_force"])
    assert share == pytest.approx(np.sum(demand * force) / np.sum(demand**2), rel=1e-12) and share < 0.0
    assert simulate(QUARTER, ROAD, duration=0.5).delivered() == {}


def test_the_demand_of_equal_dampers_is_told_of_one():
    corner = Corner(45.0, 22e3, 200e3, DAMPER, damper_count=2)
    car = HalfCar(700.0, 1200.0, 1.2, 1.5, Corner(40.0, 18e3, 200e3, DAMPER), corner)
    controlled = Controlled(car, StateFeedback(velocity=3000.0), still=1e-3, period=1e-3)
    run = simulate(controlled, ROAD, duration=0.5)
    delivered = run.delivered()
    assert delivered["front_damper"].share == pytest.approx(1.0, abs=0.02)
    assert delivered["rear_damper"].share == pytest.approx(1.0, abs=0.02)
    velocity = np.asarray(run["rear_damper_velocity"])
    np.testing.assert_allclose(run["rear_damper_demand"][1:], 0.5 * 3000.0 * velocity[:-1], rtol=1e-9, atol=1e-9)
    assert "of one of 2 equal ones" in run.descriptions["rear_damper_demand"]
    assert "equal" not in run.descriptions["front_damper_demand"]


def test_policies_come_back_from_json(tmp_path):
    for policy in (lqr(HALF), Preview(BandSkyhook(1000.0), jnp.array([500.0]), 0.1), ModalSkyhook(), lqr(QUARTER)):
        to_json(policy, tmp_path / "policy.json")
        assert bool(eqx.tree_equal(from_json(tmp_path / "policy.json"), policy))


class Half(AbstractVehiclePolicy):
    """Forgets the rear."""

    def __call__(self, seen, state):
        return {"front_damper": seen["front_damper"].stroke}, state


ONE = jnp.ones(1)
SEATED = Seat((SeatMass(80.0, 6e3, Linear(1500.0)),))
BAR = Axle(Corner(40.0, 18e3, 200e3, DAMPER), 1.5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: BandSkyhook(low=5.0, high=5.0), "`high` must be above the beginning of the band, 5 Hz"),
        (lambda: BandSkyhook()(SEEN, ()), "know its period"),
        (
            lambda: Controlled(HALF, Preview(Skyhook(), ONE, 0.101)),
            r"`delay` must be a whole number of periods.* 0\.1 s",
        ),
        (lambda: Controlled(HALF, Preview(Skyhook(), jnp.ones(22), 0.1)), "`gains` must be 21 numbers or fewer"),
        (lambda: Controlled(QUARTER, Preview(Skyhook(), ONE, 0.1)), "a front damper for each rear one"),
        (
            lambda: Ride(Controlled(HALF, Half()), ROAD, duration=0.5)(),
            "of every damper, but is one without rear_damper",
        ),
        (lambda: Controlled(QUARTER, lqr(HALF)), r"gains of shape \(1, 1\)"),
        (lambda: lqr(QUARTER, tyre=0.0), "`tyre` must be positive"),
        (lambda: lqr(vehicles.presets.full_car_jazar(damper=DAMPER)), "a FullCar. Take `control.ModalSkyhook`"),
        (lambda: lqr(vehicles.presets.quarter_car_000()), "whose dampers take a command"),
        (lambda: lqr(QuarterCar(400.0, 50.0, 20e3, 250e3, DAMPER, seats=(SEATED,))), "without seats"),
    ],
)
def test_what_does_not_suit_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_roll_car_has_an_optimum_too():
    policy = lqr(RollCar(420.0, 300.0, BAR))
    assert isinstance(policy, VehicleFeedback)
    gains = np.asarray(policy.body_velocity)
    np.testing.assert_allclose(gains, gains[::-1, ::-1], rtol=1e-8)  # left as right
    assert control.Controlled(RollCar(420.0, 300.0, BAR), policy) is not None
