"""Runs under control against an event-by-event simulation by SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxdamp
from jaxdamp import roads
from jaxdamp.control import Controlled, HybridHook, PowerDriven, RateLimit, Skyhook
from jaxdamp.dampers import Linear, Scheduled
from jaxdamp.vehicles import Corner, HalfCar, QuarterCar


SOFT, HARD, STILL, ROUNDED = 300.0, 3900.0, 0.1, 0.1
DAMPER = Scheduled((Linear(SOFT), Linear(HARD)), levels=[0.0, 1.0], command=0.25)
QUARTER = QuarterCar(400.0, 50.0, 20e3, 250e3, DAMPER)
HALF = HalfCar(700.0, 1200.0, 1.2, 1.5, Corner(40.0, 18e3, 200e3, DAMPER), Corner(45.0, 22e3, 200e3, DAMPER))
PERIOD, DURATION = 5e-3, 0.4


def skyhook(y):
    return 3000.0 * (y[0] + 0.01 * y[2])


def hybrid(y):
    return 4000.0 * (0.7 * y[0] - 0.3 * y[1])


def power_driven(y):
    return -20e3 * y[3]


POLICIES = {
    "skyhook": (Skyhook(3000.0, 0.01), skyhook),
    "hybrid": (HybridHook(4000.0, 0.7), hybrid),
    "power driven": (PowerDriven(20e3), power_driven),
}


def command_of(demand, v):
    """The damping between soft and hard nearest to demand/v, as a share; rounded as `Controlled` says."""
    rise = (HARD - SOFT) * v
    share = (demand - SOFT * v) * rise / (rise**2 + ((HARD - SOFT) * STILL) ** 2)
    return 0.5 * (1.0 + np.hypot(share, ROUNDED) - np.hypot(share - 1.0, ROUNDED))


class Car:
    """Masses and geometry of the quarter or the half car, from its numbers alone."""

    def __init__(self, car):
        if isinstance(car, QuarterCar):
            corners, arms = [car], [0.0]
            self.inertia = np.diag([1.0 / 400.0, 1.0 / 50.0])
        else:
            corners, arms = [car.front, car.rear], [1.2, -1.5]
            self.inertia = np.diag([1.0 / 700.0, 1.0 / 1200.0, 1.0 / 40.0, 1.0 / 45.0])
        count, self.wheels = len(self.inertia), len(corners)
        turns = [[1.0, arm][: count - self.wheels] for arm in arms]
        self.body = np.hstack([np.array(turns), np.zeros((self.wheels, self.wheels))])
        self.wheel = np.hstack([np.zeros((self.wheels, count - self.wheels)), np.eye(self.wheels)])
        self.springs = np.array([float(corner.spring_rate) for corner in corners])
        self.tyres = np.array([float(corner.tyre_stiffness) for corner in corners])

    def acceleration(self, q, rate, ground, damping):
        deflection, velocity = ((self.body - self.wheel) @ one for one in (q, rate))
        strut = self.springs * deflection + damping * velocity
        tyre = self.tyres * (self.wheel @ q - ground)
        return self.inertia @ (-(self.body - self.wheel).T @ strut - self.wheel.T @ tyre)

    def signals(self, q, rate, ground, damping):
        body = self.body @ rate
        wheel, acceleration = self.wheel @ rate, self.body @ self.acceleration(q, rate, ground, damping)
        return np.stack([body, wheel, acceleration, (self.body - self.wheel) @ q, body - wheel])


def by_events(car, policy, heights, dt, delay, lag, sensor_lag, fine, limits=None):
    """Velocities at instants dt apart, of which `fine` and more lie in a period, by DOP853 between the events."""
    own, wheels = Car(car), Car(car).wheels
    n = len(own.inertia)
    y, command, target = np.zeros(2 * n), np.full(wheels, 0.25), np.full(wheels, 0.25)
    waiting, seen, rates = [], None, [y[n:].copy()]
    damping = lambda u: SOFT + (HARD - SOFT) * u  # noqa: E731
    for i in range(len(heights) - 1):
        signals = own.signals(y[:n], y[n:], heights[i], damping(command))
        follow = 1.0 if sensor_lag == 0.0 else 1.0 - np.exp(-dt / sensor_lag)
        seen = signals if seen is None else seen + follow * (signals - seen)
        if i % fine == 0:
            waiting.append((i + round(delay / dt), command_of(policy(seen), seen[4])))
        if waiting and waiting[0][0] == i:
            target = waiting.pop(0)[1]
        if lag == 0.0:
            command = target
        start, slope = heights[i], (heights[i + 1] - heights[i]) / dt

        def rate(t, y, command=command, target=target, start=start, slope=slope):
            u = target + (command - target) * (np.exp(-t / lag) if lag else 1.0)
            ends = () if limits is None else np.clip((target - y[2 * n :]) / lag, *limits)
            u = u if limits is None else y[2 * n :]
            return np.concatenate(
                [y[n : 2 * n], own.acceleration(y[:n], y[n : 2 * n], start + slope * t, damping(u)), ends]
            )

        y = y if limits is None else np.concatenate([y, command])
        y = solve_ivp(rate, (0.0, dt), y, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        command = target + (command - target) * (np.exp(-dt / lag) if lag else 1.0)
        if limits is not None:
            y, command = y[: 2 * n], y[2 * n :]
        rates.append(y[n:].copy())
    return np.array(rates)


def largest_errors(car, name, steps, delay, lag, sensor_lag=0.0, limits=None):
    """Of the velocities at each step, over the largest velocity, the road straight between instants 1 ms apart."""
    policy, own = POLICIES[name]
    road = roads.cosine_bump(0.06, start=0.2, length=1.6, speed=8.0)
    errors = []
    for dt in steps:
        limit = None if limits is None else RateLimit(limits[1], -limits[0])
        vehicle = Controlled(car, policy, lag, sensor_lag, period=PERIOD, delay=delay, rate_limit=limit)
        response = jaxdamp.simulate(vehicle, road, duration=DURATION, dt=dt)
        heights = np.asarray(response.road)
        expected = by_events(car, own, heights, dt, delay, lag, sensor_lag, round(PERIOD / dt), limits)
        rates = np.asarray(response.motion)[:, expected.shape[1] :]
        errors.append(np.abs(rates - expected).max() / np.abs(expected).max())
    return errors


@pytest.mark.parametrize(
    ("car", "name", "delay", "lag", "sensor_lag"),
    [
        (QUARTER, "skyhook", 0.0, 0.0, 0.0),
        pytest.param(QUARTER, "hybrid", 8e-3, 0.0, 5e-3, marks=pytest.mark.slow),
        pytest.param(HALF, "power driven", 3e-3, 4e-3, 0.0, marks=pytest.mark.slow),
    ],
)
def test_a_controlled_car_is_that_of_an_event_by_event_simulation(car, name, delay, lag, sensor_lag):
    coarse, fine = largest_errors(car, name, [1e-3, 0.5e-3], delay, lag, sensor_lag)
    assert fine < 1e-5
    assert coarse / fine > 6.5  # third order: 8


@pytest.mark.slow
def test_a_limited_rate_is_that_of_an_event_by_event_simulation():
    coarse, fine = largest_errors(QUARTER, "skyhook", [1e-3, 0.5e-3], 3e-3, 4e-3, limits=(-30.0, 15.0))
    assert fine < 1e-5
    assert coarse / fine > 6.5
    unlimited, never = (
        largest_errors(QUARTER, "skyhook", [1e-3], 3e-3, 4e-3, limits=one)[0] for one in (None, (-1e4, 1e4))
    )
    assert never == pytest.approx(unlimited, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", POLICIES)
@pytest.mark.parametrize("car", [QUARTER, HALF], ids=["quarter", "half"])
@pytest.mark.parametrize(("delay", "lag", "sensor_lag"), [(0.0, 0.0, 0.0), (8e-3, 0.0, 0.0), (3e-3, 4e-3, 5e-3)])
def test_every_policy_hold_delay_and_lag_is_of_third_order(car, name, delay, lag, sensor_lag):
    coarse, fine = largest_errors(car, name, [1e-3, 0.25e-3], delay, lag, sensor_lag)
    assert fine < 3e-6
    assert coarse / fine > 50.0  # third order: 64
