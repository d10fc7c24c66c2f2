"""Sensors with their faults, filters of readings, and the rate limit of the actuator."""

from typing import cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import signal
from scipy.integrate import solve_ivp

import jaxdamp
from jaxdamp import Ride, roads, simulate, simulation
from jaxdamp.control import (
    Controlled,
    Differentiated,
    Integrated,
    RateLimit,
    Sensors,
    Signals,
    SignalSensor,
    Skyhook,
    StateFeedback,
    Subtracted,
)
from jaxdamp.control.sensors import noise_of, readers
from jaxdamp.dampers import Linear, Scheduled
from jaxdamp.vehicles import Corner, HalfCar, QuarterCar


METRICS = ["rms_sprung_acceleration", "rms_dynamic_tyre_load"]
DAMPER = Scheduled((Linear(300.0), Linear(3900.0)), levels=[0.0, 1.0], command=0.25)
QUARTER = QuarterCar(400.0, 50.0, 20e3, 250e3, DAMPER)
HALF = HalfCar(700.0, 1200.0, 1.2, 1.5, Corner(40.0, 18e3, 200e3, DAMPER), Corner(45.0, 22e3, 200e3, DAMPER))
ROAD = roads.iso8608("C", speed=20.0, seed=1, duration=4.0)
NOISY = Sensors(
    Integrated(0.3),
    Subtracted(),
    SignalSensor(lag=1e-3, noise=0.1, bias=0.2),
    SignalSensor(noise=5e-4),
    Differentiated(0.01),
    seed=3,
)
DT, PERIOD, COUNT = 1e-3, 5e-3, 2001


def test_noise_is_white_independent_and_of_the_stated_deviation():
    own = Sensors(body_acceleration=SignalSensor(noise=1.0), stroke=SignalSensor(noise=1.0))
    samples = jnp.arange(20000.0)
    drawn = np.asarray(noise_of([own, None, own], samples))
    assert drawn.shape == (20000, 4)
    np.testing.assert_allclose(drawn.std(axis=0), 1.0, atol=0.025)  # five deviations of the estimate
    np.testing.assert_allclose(drawn.mean(axis=0), 0.0, atol=0.036)
    for lag in (1, 2, 7, 100):
        together = np.einsum("ni,nj->ij", drawn[lag:], drawn[:-lag]) / 20000
        np.testing.assert_allclose(together, 0.0, atol=0.036)
    np.testing.assert_allclose(drawn.T @ drawn / 20000 - np.eye(4) * np.mean(drawn**2, axis=0), 0.0, atol=0.036)
    np.testing.assert_array_equal(drawn[500:600], noise_of([own, None, own], samples[500:600]))
    other = noise_of([Sensors(stroke=SignalSensor(), seed=1)], samples)
    assert other is not None and abs(np.mean(np.asarray(other)[:, 0] * drawn[:, 1])) < 0.036
    assert noise_of([None, Sensors()], samples) is None


@pytest.fixture(scope="module")
def seen():
    """Signals over time: sines with an offset, as if the vehicle stood before."""
    t = DT * np.arange(COUNT)
    w = 2.0 * np.pi * np.array([1.3, 11.0, 1.3, 2.1, 2.1])
    measured = np.sin(np.outer(w, t)) * np.array([[0.2], [0.5], [2.0], [0.03], [0.4]]) + 0.01
    return Signals(*jnp.asarray(measured), *jnp.zeros((3, COUNT)))


def read(sensors, seen):
    """The readings at the samples."""
    (own,) = readers([sensors], jnp.asarray(2e-3), jnp.asarray(DT), PERIOD)
    first = jax.tree.map(lambda y: y[0], seen)
    every = round(PERIOD / DT)
    noise = noise_of([sensors], jnp.floor(jnp.arange(float(COUNT)) / every))

    @jax.jit
    def run(signals, noise, flags):
        def step(carry, row):
            (now, noise, flag), (held, memory) = row, carry
            held = own.filtered(held, now)
            found, after = own(held, memory, noise)
            return (held, jax.tree.map(lambda new, old: jnp.where(flag, new, old), after, memory)), found

        return jax.lax.scan(step, (first, own.begin(first)), (signals, noise, flags))[1]

    found = run(seen, noise, jnp.arange(COUNT) % every == 0)
    return Signals(*(jnp.asarray(y[::every]) for y in found)), np.asarray(noise)[::every]


def lagged(values, lag):
    """The exact answer of a lag to a signal that is held over each step."""
    out, share = [values[0]], 1.0 - np.exp(-DT / lag)
    for value in values[1:]:
        out.append(out[-1] + share * (value - out[-1]))
    return np.array(out)[:: round(PERIOD / DT)]


def test_a_sensor_lags_adds_and_rounds(seen):
    sensors = Sensors(stroke=SignalSensor(5e-3, 2e-3, 1e-3, 5e-4), body_acceleration=SignalSensor(noise=0.3), seed=4)
    found, noise = read(sensors, seen)
    expected = 5e-4 * np.round((lagged(seen.stroke, 5e-3) + 1e-3 + 2e-3 * noise[:, 1]) / 5e-4)
    np.testing.assert_allclose(found.stroke, expected, atol=1e-15)
    np.testing.assert_allclose(found.body_acceleration, seen.body_acceleration[::5] + 0.3 * noise[:, 0], rtol=1e-13)
    np.testing.assert_allclose(found.velocity, lagged(seen.velocity, 2e-3), rtol=1e-11)  # without a sensor of its own


def test_filters_are_those_of_scipy(seen):
    sensors = Sensors(
        Integrated(0.4), Subtracted(), SignalSensor(bias=0.5, noise=0.05), SignalSensor(), Differentiated(0.02)
    )
    found, noise = read(sensors, seen)
    time, w = PERIOD * np.arange(found.stroke.size), 2.0 * np.pi * 0.4
    acceleration = seen.body_acceleration[::5] + 0.05 * noise[:, 0]
    start = seen.body_acceleration[0]  # at which it stood before
    band = ([1.0, 0.0], [1.0, np.sqrt(2.0) * w, w**2])
    rise = np.concatenate([[0.0], np.diff(acceleration, prepend=start)])  # the first reading comes a period after rest
    before = np.concatenate([[-PERIOD], time])
    expected = signal.lsim(band, np.cumsum(rise), before + PERIOD)[1][1:]
    np.testing.assert_allclose(found.body_velocity, expected, atol=1e-12)
    rate = signal.lsim(([1.0, 0.0], [0.02, 1.0]), seen.stroke[::5] - seen.stroke[0], time)[1]
    np.testing.assert_allclose(found.velocity, rate, atol=1e-12)
    np.testing.assert_allclose(found.wheel_velocity, found.body_velocity - found.velocity, atol=1e-15)
    plain, _ = read(Sensors(velocity=Differentiated(0.0), stroke=SignalSensor()), seen)
    np.testing.assert_allclose(plain.velocity[1:], np.diff(seen.stroke[::5]) / PERIOD, atol=1e-13)


def test_rounding_passes_derivatives_straight_through():
    sensor = SignalSensor(bias=0.3, resolution=0.25)
    value, slope = jax.value_and_grad(lambda x: sensor.read(x, 0.0) ** 2)(1.0)
    assert float(value) == 1.25**2 and float(slope) == 2.5


@pytest.mark.parametrize("lag", [0.0, 4e-4, 6e-3])
def test_a_limited_command_is_that_of_its_differential_equation(lag):
    limit, dt = RateLimit(rising=40.0, falling=90.0), 1e-3
    away = np.concatenate([-np.geomspace(1e-4, 1.0, 23), [0.0], np.geomspace(1e-4, 1.0, 23)])
    arguments = jnp.asarray(away), jnp.asarray(dt), jnp.asarray(lag)
    after, (begin, rise) = np.asarray(limit.followed(*arguments)), limit.resumed(*arguments)

    def run(start, to):
        return solve_ivp(
            lambda t, e: np.clip(-e / lag, -90.0, 40.0), (0.0, to), start, rtol=1e-10, atol=1e-12, max_step=2e-5
        ).y[:, -1]

    if lag:
        np.testing.assert_allclose(after, run(away, dt), atol=2e-8)
    else:
        np.testing.assert_allclose(after, np.where(away > 0, np.maximum(away - 0.09, 0), np.minimum(away + 0.04, 0)))
    if lag > dt:
        np.testing.assert_array_equal(begin, away)
        np.testing.assert_allclose(run(away + np.asarray(rise), dt), away, atol=2e-8)
    slopes = jax.vmap(jax.grad(limit.followed), (0, None, None))(*arguments)
    differences = (
        limit.followed(arguments[0] + 1e-7, *arguments[1:]) - limit.followed(arguments[0] - 1e-7, *arguments[1:])
    ) / 2e-7
    np.testing.assert_allclose(slopes, differences, atol=1e-4 if lag else 0.51)  # at kinks without a lag


@pytest.fixture(scope="module")
def car():
    return Controlled(QUARTER, Skyhook(3000.0, 0.01), 4e-3, delay=3e-3, sensors=NOISY, rate_limit=RateLimit(20.0, 60.0))


@pytest.fixture(scope="module")
def ride(car):
    return Ride(car, ROAD, metrics=METRICS, duration=1.0)


@pytest.mark.slow
def test_simulation_ride_sweep_and_printed_loop_have_the_same_noise(car, ride):
    response = simulate(car, ROAD, duration=1.0)
    steps = np.diff(response["damper_command"])
    assert steps.max() == pytest.approx(20.0 * DT, rel=1e-9) and steps.min() == pytest.approx(-60.0 * DT, rel=1e-9)
    seeds, gains = np.array([3.0, 4.0, 5.0]), np.array([3000.0, 1000.0])
    swept = jaxdamp.sweep(ride, {"sensors.seed": seeds}, chunk=3)
    printed = Ride(car, ROAD, metrics=METRICS, duration=1.0, engine=simulation.Exponential(printed=True))
    in_c = jax.vmap(lambda gain: printed({"policy.gain": gain}))(gains)
    one = ride()
    for name, value in response.metrics(METRICS).items():
        np.testing.assert_allclose(one[name], value, rtol=1e-11)
        np.testing.assert_allclose(swept[name][0], value, rtol=1e-11)
        np.testing.assert_allclose(in_c[name][0], value, rtol=1e-11)
        assert 1e-4 < np.ptp(np.asarray(swept[name])) / float(value) < 0.2


@pytest.mark.slow
def test_a_run_goes_on_with_the_noise_of_the_whole(car):
    whole = simulate(car, ROAD, duration=0.4)
    first, state = simulate(car, ROAD, duration=0.203, return_state=True)
    second = simulate(car, ROAD, duration=0.197, state=state)
    np.testing.assert_allclose(first["damper_demand"], whole["damper_demand"][:204], rtol=1e-9)
    np.testing.assert_allclose(second["damper_demand"], whole["damper_demand"][203:], rtol=1e-9)


@pytest.mark.slow
def test_derivatives_are_those_of_differences(ride):
    start = {
        "policy.gain": 3000.0,
        "sensors.body_acceleration.noise": 0.1,
        "sensors.body_velocity.low": 0.3,
        "sensors.velocity.lag": 0.01,
        "rate_limit.rising": 20.0,
        "actuator_lag": 4e-3,
    }

    def cost(point):
        return ride(point)["rms_sprung_acceleration"]

    along = {name: value * np.cos(i) for i, (name, value) in enumerate(start.items())}  # shows each slope
    reverse, forward = jax.jit(lambda point: (jax.grad(cost)(point), jax.jvp(cost, (point,), (along,))[1]))(start)
    np.testing.assert_allclose(sum(reverse[name] * along[name] for name in start), forward, rtol=1e-8)
    for name, value in start.items():
        step = 1e-4 * value
        slope = (cost(start | {name: value + step}) - cost(start | {name: value - step})) / (2.0 * step)
        np.testing.assert_allclose(reverse[name], slope, rtol=2e-4)


@pytest.mark.slow
def test_a_run_with_noise_is_of_third_order_as_the_noise_belongs_to_the_samples():
    own = Sensors(body_acceleration=SignalSensor(noise=0.5), body_velocity=SignalSensor(noise=0.01))
    car = Controlled(QUARTER, Skyhook(3000.0, 0.01), 6e-3, sensors=own)
    time = DT * np.arange(401)
    bump = roads.from_profile(time, 0.02 * (1.0 - np.cos(2.0 * np.pi * np.clip(time / 0.2, 0.0, 1.0))))
    runs = [np.asarray(simulate(car, bump, duration=0.4, dt=DT / n)["sprung_velocity"])[::n] for n in (1, 2, 8)]
    errors = [np.abs(run - runs[-1]).max() for run in runs[:2]]
    assert errors[1] < 1e-5 * np.abs(runs[-1]).max() and errors[0] / errors[1] > 6.5


def test_dampers_have_sensors_of_their_own():
    sensors = {"front_damper": Sensors(stroke=SignalSensor(bias=0.25))}
    run = simulate(Controlled(HALF, StateFeedback(stroke=1.0), sensors=sensors), ROAD, duration=0.1)
    for name, bias in {"front": 0.25, "rear": 0.0}.items():
        stroke = np.asarray(run[f"{name}_stroke"])[:-1:5]
        np.testing.assert_allclose(np.asarray(run[f"{name}_damper_demand"])[1::5], stroke + bias, atol=1e-12)


@pytest.mark.slow
def test_a_half_car_alone_and_in_a_sweep_has_the_same_noise():
    ride = Ride(Controlled(HALF, Skyhook(), 4e-3, sensors=NOISY, rate_limit=RateLimit(20.0, 60.0)), ROAD, duration=1.0)
    one, swept = ride(), jaxdamp.sweep(ride, {"policy.gain": np.array([3000.0, 2000.0])}, chunk=2)
    assert ride.layout is not ride.side_by_side().layout
    for name, value in one.items():
        np.testing.assert_allclose(swept[name][0], value, rtol=1e-8, atol=1e-12)


def test_single_precision_has_the_same_noise():
    places = jnp.arange(1000.0)
    double = noise_of([Sensors(body_acceleration=SignalSensor(), stroke=SignalSensor(), seed=3)], places)
    with jax.enable_x64(False):
        own = Sensors(body_acceleration=SignalSensor(noise=0.1), stroke=SignalSensor(), seed=3)
        single = noise_of([own], jnp.arange(1000.0))
    assert single is not None and double is not None and single.dtype == jnp.float32
    np.testing.assert_allclose(single, double, atol=1e-5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SignalSensor(noise=-1.0), r"`SignalSensor.noise` must be"),
        (lambda: Integrated(0.0), r"`Integrated.low` must be"),
        (lambda: Sensors(body_velocity=cast("Integrated", Differentiated())), "`Sensors.body_velocity` must be"),
        (lambda: RateLimit(0.0, 1.0), "`RateLimit.rising` must be"),
        (lambda: Controlled(QUARTER, Skyhook(), sensors={"rear": NOISY}), "`sensors` must be one of 'damper'"),
    ],
)
def test_what_no_sensor_can_be_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
