"""Cars under controllers of all kinds, and what a simulation says of them."""

import functools
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import simulate
from jaxdamp.control import (
    AbstractPolicy,
    AccelerationDriven,
    BandSkyhook,
    Controlled,
    Differentiated,
    Groundhook,
    HybridHook,
    Integrated,
    ModalSkyhook,
    PowerDriven,
    Preview,
    RateLimit,
    Sensors,
    SignalSensor,
    Skyhook,
    StateFeedback,
    Subtracted,
    VehicleFeedback,
)
from jaxdamp.dampers import AbstractDamper, BoucWen, Lag, Linear, LuGre, MotionRatio, Scheduled, SeriesSpring
from jaxdamp.roads import from_profile
from jaxdamp.vehicles import Corner, HalfCar, QuarterCar, presets


STEP, PERIOD = 1e-3, 5e-3  # s
LAGS: dict[str, Any] = {"actuator_lag": 4e-3, "sensor_lag": 2e-3, "delay": 3e-3}
TIME = np.arange(401) * STEP


class Network(AbstractPolicy):
    """A network with a memory of the last body velocity."""

    layers: eqx.nn.MLP

    def initial_state(self):
        return jnp.zeros(())

    def __call__(self, seen, state):
        inputs = jnp.stack([seen.body_velocity, seen.body_velocity - state, seen.velocity])
        return 1e4 * self.layers(inputs), seen.body_velocity


class Late(AbstractPolicy):
    """Groundhook by the wheel velocity of the sample before."""

    def initial_state(self):
        return jnp.zeros(())

    def __call__(self, seen, state):
        return -2000.0 * state, seen.wheel_velocity


def scheduled(law, blend="parameters"):
    return Scheduled((law(1.0), law(6.0)), levels=[0.0, 1.0], command=0.25, blend=blend)


PLAIN = scheduled(lambda f: Linear(600.0 * f))
SPRUNG = scheduled(lambda f: Linear(600.0) + SeriesSpring(Linear(500.0 * f), 2e5), "force")
HYSTERETIC = scheduled(lambda f: BoucWen(600.0, 0.0, 150.0 * f, 1e-3))


def quarter(damper: AbstractDamper = PLAIN):
    return QuarterCar(400.0, 50.0, 20e3, 250e3, damper)


def half(front=PLAIN, rear=PLAIN):
    return HalfCar(700.0, 1200.0, 1.2, 1.5, Corner(40.0, 18e3, 200e3, front), Corner(45.0, 22e3, 200e3, rear))


def lugre(f):
    return LuGre(1e5 * f, 300.0, 500.0, 100.0 * f, 120.0 * f, 0.02)


SENSORS = Sensors(
    Integrated(low=0.3),
    wheel_velocity=Subtracted(),
    body_acceleration=SignalSensor(bias=0.2, resolution=0.01, lag=1e-3),
    velocity=Differentiated(),
)
GAINS = jnp.array([[1.0, 0.1], [0.2, 1.0]])
CARS = {
    "sensors": lambda: Controlled(quarter(), HybridHook(), sensors=SENSORS, rate_limit=RateLimit(50.0, 100.0), **LAGS),
    "sensors_bouc_wen": lambda: Controlled(
        quarter(HYSTERETIC), HybridHook(), sensors=SENSORS, rate_limit=RateLimit(50.0, 100.0), **LAGS
    ),
    "modal": lambda: Controlled(half(), ModalSkyhook(3000.0, 2000.0, 500.0), **LAGS),
    "band": lambda: Controlled(half(), BandSkyhook(), **LAGS),
    "preview": lambda: Controlled(half(), Preview(Skyhook(3000.0), jnp.array([500.0, 300.0]), 0.1), **LAGS),
    "all": lambda: Controlled(half(), VehicleFeedback(*(g * GAINS for g in (3e3, -500.0, 1e3, 2e3))), **LAGS),
    "skyhook": lambda: Controlled(quarter(), Skyhook(3000.0, 0.01), **LAGS),
    "groundhook": lambda: Controlled(quarter(), Groundhook(2000.0)),
    "hybrid": lambda: Controlled(quarter(), HybridHook(3000.0, 0.7), **LAGS),
    "acceleration": lambda: Controlled(quarter(), AccelerationDriven(1e3), **LAGS),
    "power": lambda: Controlled(quarter(), PowerDriven(20e3), delay=12e-3),
    "feedback": lambda: Controlled(
        quarter(), StateFeedback(900.0, -500.0, 20.0, 3e3, 400.0), actuator_lag=4e-3, sensor_lag=2e-3, delay=12e-3
    ),
    "network": lambda: Controlled(quarter(), Network(eqx.nn.MLP(3, "scalar", 8, 1, jnp.tanh, key=jax.random.key(0)))),
    "bouc_wen": lambda: Controlled(quarter(HYSTERETIC), Skyhook(3000.0, 0.01), **LAGS),
    "lugre": lambda: Controlled(quarter(scheduled(lugre, "force")), Skyhook(2e4), **LAGS),
    "series spring, wrapped": lambda: Controlled(
        quarter(MotionRatio(SPRUNG, 0.7) + Lag(Linear(300.0), 0.01)), Skyhook(2e4)
    ),
    "front": lambda: Controlled(half(), {"front_damper": Skyhook(3000.0)}, **LAGS),
    "two": lambda: Controlled(
        half(PLAIN, HYSTERETIC), {"front_damper": HybridHook(), "rear_damper": Skyhook()}, **LAGS
    ),
    "full": lambda: Controlled(presets.full_car_jazar(PLAIN), Skyhook(3000.0), **LAGS),
}


@functools.cache
def car(name):
    return CARS[name]()


def heights(count, time=TIME):
    """A smooth bump for each wheel, one after the other."""
    angle = 2.0 * np.pi * np.clip((time[:, None] - 0.05 - 0.03 * np.arange(count)) / 0.2, 0.0, 1.0)
    return 0.02 * (1.0 - np.cos(angle)) ** 2


@functools.cache
def driven(name):
    return simulate(car(name), from_profile(TIME, heights(len(car(name).wheel_names))), dt=STEP, substeps=1)


def signals(run, damper="damper"):
    """What the sensors of the damper of a quarter car measured, by names."""
    body = np.asarray(run.motion)[:, 2]
    velocity = np.asarray(run["damper_velocity"])
    measured = {"body_velocity": body, "wheel_velocity": body - velocity, "velocity": velocity}
    measured |= {"body_acceleration": run["sprung_acceleration"], "stroke": run["stroke"]}
    return {f"{damper}_{key}": np.asarray(values, float) for key, values in measured.items()}


def actuated(vehicle, command):
    """The commands that the damper has at the instants after these, by those that were decided."""
    every, late, decay = round(PERIOD / STEP), round(vehicle.delay / STEP), 0.0
    if float(vehicle.actuator_lag) > 0.0:
        decay = math.exp(-STEP / float(vehicle.actuator_lag))
    target = now = 0.25
    has = []
    for i in range(len(command)):
        if i >= late and (i - late) % every == 0:
            target = command[i - late]
        now = target + decay * (now - target)
        has.append(now)
    return np.array(has)
