"""The corner, roads, policies and bounds of `benchmarks.control`."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import scipy.optimize
from jaxtyping import Array, Float, PyTree
from scipy.signal import cont2discrete, dlsim

from jaxdamp import Ride, roads, simulate, tune
from jaxdamp._types import Scalar
from jaxdamp.control import (
    AbstractPolicy,
    AccelerationDriven,
    BandSkyhook,
    Controlled,
    Groundhook,
    HybridHook,
    PowerDriven,
    Signals,
    Skyhook,
    StateFeedback,
    lqr,
)
from jaxdamp.dampers import Linear, Scheduled
from jaxdamp.vehicles import AbstractVehicle, QuarterCar


SOFT, HARD = 300.0, 3900.0  # N s/m
PERIOD, STEP = 5e-3, 1e-3  # s
ON_OFF = 1e9  # gain
FAST: dict[str, Any] = {"actuator_lag": 1.0 / (100.0 * np.pi)}
SLOW: dict[str, Any] = {"actuator_lag": 10e-3, "delay": 10e-3}
BODY, TYRE = "rms_sprung_acceleration", "rms_dynamic_tyre_load"
EDGES = {"0 to 5 Hz": (0.0, 5.0), "5 to 20 Hz": (5.0, 20.0), "all": (0.0, np.inf)}


def corner(command: float = 0.2) -> QuarterCar:
    """The car of Savaresi and Spelta (2007), its damper from soft (0) to hard (1)."""
    damper = Scheduled((Linear(SOFT), Linear(HARD)), levels=[0.0, 1.0], command=command)
    return QuarterCar(400.0, 50.0, 20e3, 250e3, damper)


def passive(rate: float) -> QuarterCar:
    """The car with a damper of this rate [N s/m]."""
    return corner((rate - SOFT) / (HARD - SOFT))


def surfaces(duration: float, count: int) -> dict[str, list[roads.AbstractRoad]]:
    """Three classes of random roads, each at the speed at which it is driven, and a bump of 50 mm and 5 m at 10 m/s."""
    classes = {"class B, 30 m/s": ("B", 30.0), "class C, 20 m/s": ("C", 20.0), "class D, 10 m/s": ("D", 10.0)}
    drawn: dict[str, list[roads.AbstractRoad]] = {
        name: [roads.iso8608(letter, speed=speed, seed=seed, duration=duration) for seed in range(count)]
        for name, (letter, speed) in classes.items()
    }
    drawn["bump"] = [roads.cosine_bump(0.05, start=0.5, length=5.0, speed=10.0)]
    return drawn


def training(duration: float, count: int = 3) -> list[roads.AbstractRoad]:
    """Roads of class C that are not among those of the table."""
    return [roads.iso8608("C", speed=20.0, seed=100 + i, duration=duration) for i in range(count)]


def policies() -> dict[str, AbstractPolicy | StateFeedback]:
    """The policies of the literature."""
    clipped = lqr(corner())
    assert isinstance(clipped, StateFeedback)
    return {
        "skyhook, on-off": Skyhook(ON_OFF),
        "skyhook, linear": Skyhook(3000.0),
        "skyhook, 0.3 to 8 Hz": BandSkyhook(3000.0),
        "groundhook, on-off": Groundhook(ON_OFF),
        "hybrid, linear": HybridHook(3000.0, 0.5),
        "acceleration-driven": AccelerationDriven(),
        "mixed skyhook and ADD": Skyhook(ON_OFF, 1.0 / (2.0 * np.pi * 1.9)),
        "power-driven": PowerDriven(20e3),
        "clipped LQR": clipped,
    }


class Record(NamedTuple):
    """What a run is judged by.

    Attributes:
        body: acceleration of the body [m/s²].
        tyre: load of the tyre beside that at rest [N].
    """

    body: np.ndarray
    tyre: np.ndarray


def driven(vehicle: AbstractVehicle, road: roads.AbstractRoad, duration: float) -> Record:
    """A run."""
    run = simulate(vehicle, road, duration=duration, dt=STEP)
    return Record(*(np.asarray(run[name]) for name in ("sprung_acceleration", "dynamic_tyre_load")))


def in_bands(signal: np.ndarray) -> dict[str, float]:
    """The RMS of a signal in each band, by Parseval's theorem."""
    power = np.abs(np.fft.rfft(signal)) ** 2 * 2.0 / signal.size**2
    power[0] /= 2.0
    frequency = np.fft.rfftfreq(signal.size, STEP)
    return {
        name: float(np.sqrt(power[(frequency >= low) & (frequency < high)].sum()))
        for name, (low, high) in EDGES.items()
    }


def active(road: roads.AbstractRoad, duration: float) -> Record:
    """The fully active car: the forces of the LQR without limits, sampling or lag, by SciPy."""
    policy = policies()["clipped LQR"]
    gains = [getattr(policy, name) for name in ("body_velocity", "wheel_velocity", "stroke", "tyre_deflection")]
    force = np.array([float(gain) for gain in gains])  # F of (ż_b, ż_w, x, d)
    pull = force + np.array([0.0, 0.0, 20e3, 0.0])
    rates = [
        -pull / 400.0,
        (pull - np.array([0.0, 0.0, 0.0, 250e3])) / 50.0,
        [1.0, -1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
    ]
    outputs = np.array([rates[0], [0.0, 0.0, 0.0, 250e3]])
    system = (np.array(rates), np.array([[0.0], [0.0], [0.0], [-1.0]]), outputs, np.zeros((2, 1)))
    time = np.arange(round(duration / STEP) + 1) * STEP
    heights = np.ravel(np.asarray(road.height(jnp.asarray(time))))
    rate = np.append(np.diff(heights), 0.0) / STEP  # straight between two instants
    found = dlsim(cont2discrete(system, STEP), rate)[1]
    return Record(*found.T)


class Prescribed(AbstractPolicy):
    """A history of shares of the range from soft to hard, as a demand that the damper can give."""

    shares: Float[Array, " samples"]

    def initial_state(self) -> PyTree:
        """The number of the first sample."""
        return jnp.zeros((), int)

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The force at the next share [N]."""
        return (SOFT + (HARD - SOFT) * self.shares[state]) * seen.velocity, state + 1


@eqx.filter_jit
@eqx.filter_value_and_grad
def _value(shares: Array, ride: Ride, name: str) -> Scalar:
    return eqx.tree_at(lambda ride: ride.vehicle.policy.shares, ride, shares)()[name]


def best_history(
    road: roads.AbstractRoad,
    duration: float,
    name: str = BODY,
    *,
    starts: Sequence[float] = (0.1,),
    steps: int = 150,
    period: float = PERIOD,
) -> tuple[np.ndarray, list[float]]:
    """The history of commands with the least metric that was found, and the metric from each start.

    By L-BFGS-B from constant shares and from the commands of linear skyhook, with exact gradients through the ride, the
    road known from end to end. An achievable value: the true bound is not above it.

    Arguments:
        road: road.
        duration: of the ride [s].
        name: metric.
        starts: constant shares to start from.
        steps: most steps of the search.
        period: between two commands [s].
    """
    count = round(duration / period) + 1

    def vehicle(policy: AbstractPolicy) -> Controlled:
        return Controlled(corner(), policy, **FAST, still=1e-3, period=period)

    ride = Ride(vehicle(Prescribed(jnp.zeros(count))), road, metrics=[BODY, TYRE], duration=duration, dt=STEP)

    def value(shares: np.ndarray) -> tuple[float, np.ndarray]:
        found, slope = _value(jnp.asarray(shares), ride, name)
        return 1e3 * float(found), 1e3 * np.asarray(slope)

    skyhook = simulate(vehicle(Skyhook(3000.0)), road, duration=duration, dt=STEP)["damper_command"]
    every = round(period / STEP)
    begins = [np.asarray(skyhook)[1::every][:count], *(np.full(count, share) for share in starts)]
    begins = [np.resize(begin, count) for begin in begins]
    bounds = [(-2.0, 3.0)] * count  # the limits are rounded: beyond them the command still moves
    options = {"maxiter": steps, "maxfun": 2 * steps, "ftol": 1e-9}
    ends = [
        scipy.optimize.minimize(value, begin, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
        for begin in begins
    ]
    best = min(ends, key=lambda end: end.fun)
    return best.x, [1e-3 * float(end.fun) for end in ends]


def prescribed(shares: np.ndarray, period: float = PERIOD) -> Controlled:
    """The car with this history of commands."""
    return Controlled(corner(), Prescribed(jnp.asarray(shares)), **FAST, still=1e-3, period=period)


class Network(AbstractPolicy):
    """A small network of the signals of a damper, its inputs and its force of the size one."""

    layers: eqx.nn.MLP

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The demanded force [N]."""
        parts = (seen.body_velocity / 0.2, seen.wheel_velocity, seen.body_acceleration / 2.0)
        return 1e3 * self.layers(jnp.stack([*parts, seen.stroke / 0.02, seen.velocity])), state


def learnt(tracks: Sequence[roads.AbstractRoad], duration: float, steps: int, **actuator: Any) -> Network:
    """A network trained through the ride for the acceleration of the body on some roads, by Adam."""
    network = Network(eqx.nn.MLP(5, "scalar", 16, 1, jnp.tanh, key=jax.random.key(0)))
    rides = [
        Ride(Controlled(corner(), network, **actuator), road, metrics=[BODY], duration=duration) for road in tracks
    ]

    @eqx.filter_jit
    @eqx.filter_value_and_grad
    def cost(network: Network, ride: Ride) -> Scalar:
        return eqx.tree_at(lambda ride: ride.vehicle.policy, ride, network)()[BODY]

    trained = eqx.filter(network, eqx.is_inexact_array)
    rule = optax.adam(optax.cosine_decay_schedule(0.02, steps))
    memory = rule.init(trained)
    for i in range(steps):
        _, slope = cost(network, rides[i % len(rides)])
        change, memory = rule.update(eqx.filter(slope, eqx.is_inexact_array), memory)
        network = eqx.apply_updates(network, change)
    return network


def tuned(tracks: Sequence[roads.AbstractRoad], duration: float, **actuator: Any) -> AbstractPolicy:
    """Skyhook, its gain and lead tuned by `tune.minimise` on some roads for the acceleration of the body."""
    start = Controlled(corner(), Skyhook(3000.0, 5e-3), **actuator)
    bounds = {"policy.gain": (500.0, 20e3), "policy.lead": (0.0, 0.1)}
    options = {"duration": duration, "fresh_roads": 0, "max_steps": 15, "progress": _quiet}
    policy = tune.minimise(BODY, start, tune.Scenarios(tracks), over=bounds, **options).vehicle.policy
    assert isinstance(policy, AbstractPolicy)
    return policy


def _quiet(step: int, value: float) -> None:
    """Nothing."""
