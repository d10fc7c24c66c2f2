"""Semi-active policies on one corner: what they gain, what they cost, and what any could gain at best.

`python -m benchmarks.control` prints two tables. The first has the RMS acceleration of the body, plain and weighted by
ISO 2631-1, and that of the tyre load, over random roads of class C at 20 m/s, for a fast actuator (50 Hz) and for one
with a delay of 10 ms and a lag of 10 ms, with the best passive damper and with a bound: the smallest acceleration that
was found for a free history of demands on the same roads (a local optimum of many, so the true bound is lower still).
The second has times of runs with and without a controller. The corner is that of Savaresi and Spelta (2007): 400 and
50 kg, 20 and 250 kN/m, 300 to 3900 N s/m.
"""

import argparse
import time
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

import jaxdamp
from jaxdamp import Ride, roads
from jaxdamp._types import Scalar
from jaxdamp.control import (
    AbstractPolicy,
    AccelerationDriven,
    Controlled,
    Groundhook,
    Hybrid,
    PowerDriven,
    Signals,
    Skyhook,
)
from jaxdamp.dampers import Linear, Scheduled
from jaxdamp.vehicles import QuarterCar


SOFT, HARD = 300.0, 3900.0  # N s/m
PERIOD = 5e-3  # s
METRICS = ["rms_sprung_acceleration", "weighted_rms_sprung_acceleration", "rms_dynamic_tyre_load"]
ON_OFF = 1e9  # gain
FAST, SLOW = {"actuator_lag": 1.0 / (100.0 * np.pi)}, {"actuator_lag": 10e-3, "delay": 10e-3}


def policies() -> dict[str, AbstractPolicy]:
    """The policies of the table."""
    return {
        "skyhook, on-off": Skyhook(ON_OFF),
        "skyhook, linear": Skyhook(3000.0),
        "groundhook, on-off": Groundhook(ON_OFF),
        "hybrid, linear": Hybrid(3000.0, 0.5),
        "acceleration-driven": AccelerationDriven(),
        "mixed skyhook and acceleration-driven": Skyhook(ON_OFF, 1.0 / (2.0 * np.pi * 1.9)),
        "power-driven": PowerDriven(20e3),
    }


class Prescribed(AbstractPolicy):
    """Demands that are given sample by sample [N]."""

    forces: Float[Array, " samples"]

    def initial_state(self) -> PyTree:
        """The number of the first sample."""
        return jnp.zeros((), int)

    def __call__(self, seen: Signals, state: PyTree) -> tuple[Scalar, PyTree]:
        """The next demand."""
        return self.forces[state], state + 1


def corner(command: float = 0.2) -> QuarterCar:
    """The car, its damper from soft (0) to hard (1)."""
    damper = Scheduled((Linear(SOFT), Linear(HARD)), levels=[0.0, 1.0], command=command)
    return QuarterCar(400.0, 50.0, 20e3, 250e3, damper)


def bound(road: roads.AbstractRoad, duration: float, steps: int) -> dict[str, Scalar]:
    """The metrics with the least RMS acceleration of the body that was found over histories of demands (Adam)."""
    count = round(duration / PERIOD) + 1
    vehicle = Controlled(corner(), Prescribed(jnp.zeros(count)), period=PERIOD, **FAST)
    ride, name = Ride(vehicle, road, metrics=METRICS, duration=duration), METRICS[0]

    def of(forces: Array) -> dict[str, Scalar]:
        return eqx.tree_at(lambda ride: ride.vehicle.policy.forces, ride, forces)()

    slope = jax.jit(jax.grad(lambda forces: of(forces)[name]))
    results = []
    for start in range(2):
        forces = 300.0 * start * jax.random.normal(jax.random.key(start), (count,))
        mean, square = jnp.zeros(count), jnp.zeros(count)
        for i in range(1, steps + 1):
            g = slope(forces)
            mean, square = 0.9 * mean + 0.1 * g, 0.999 * square + 0.001 * g * g
            rate = 30.0 * (1.0 + np.cos(np.pi * i / steps))  # N
            forces -= rate * mean / (1.0 - 0.9**i) / (jnp.sqrt(square / (1.0 - 0.999**i)) + 1e-12)
        results.append(of(forces))
    return min(results, key=lambda values: float(values[name]))


def compare(duration: float, count: int, steps: int) -> None:
    """Print the table of the policies."""
    tracks = [roads.iso8608("C", speed=20.0, seed=seed, duration=duration) for seed in range(count)]

    def mean(vehicle: Controlled | QuarterCar) -> list[float]:
        rides = [Ride(vehicle, road, metrics=METRICS, duration=duration)() for road in tracks]
        return [float(np.mean([ride[name] for ride in rides])) for name in METRICS]

    rows: dict[str, list[float]] = {}
    passive = {
        rate: mean(corner((rate - SOFT) / (HARD - SOFT))) for rate in (300.0, 600.0, 900.0, 1200.0, 1500.0, 3900.0)
    }
    rows |= {f"passive, {rate:g} N s/m": values for rate, values in passive.items()}
    for words, actuator in (("", FAST), (", 10 ms delay and 10 ms lag", SLOW)):
        rows |= {
            f"{name}{words}": mean(Controlled(corner(), policy, **actuator)) for name, policy in policies().items()
        }
    first = {
        "first road: passive, 1020 N s/m": Ride(corner(0.2), tracks[0], metrics=METRICS, duration=duration)(),
        "first road: the best history of demands": bound(tracks[0], duration, steps),
    }
    rows |= {name: [float(values[metric]) for metric in METRICS] for name, values in first.items()}
    print(f"class C, 20 m/s, {count} roads of {duration:g} s, sampled every 5 ms")
    print(f"{'':55} body [m/s2]  weighted [m/s2]  tyre load [N]")
    for name, (body, weighted, load) in rows.items():
        print(f"{name:55} {body:11.3f} {weighted:16.3f} {load:14.0f}")


def seconds(call: Callable[[], object], repeats: int = 5) -> float:
    """The least time of several calls [s], after a first."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        jax.block_until_ready(call())
        times.append(time.perf_counter() - start)
    return min(times)


def speed() -> None:
    """Print times of one car and of many, passive and controlled."""
    road = roads.iso8608("C", speed=20.0, seed=1, duration=10.0)
    controlled = Controlled(corner(), Skyhook(3000.0), **FAST)
    print(f"{'10 s at 1 ms, 2 metrics':30} one car [ms]  4096 cars [s]")
    for name, vehicle, path in (
        ("passive", corner(), "damper.laws.0.rate"),
        ("skyhook", controlled, "car.damper.laws.0.rate"),
    ):
        ride = Ride(vehicle, road, metrics=METRICS[::2], duration=10.0)
        point = {path: jnp.asarray(300.0)}
        rates = jnp.linspace(200.0, 400.0, 4096)
        one = seconds(lambda ride=ride, point=point: ride(point))
        many = jax.jit(jax.vmap(lambda rate, ride=ride, path=path: ride.side_by_side()({path: rate})))
        print(f"{name:30} {1e3 * one:12.2f} {seconds(lambda many=many: many(rates), 3):14.2f}")


def main() -> None:
    """Both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=20.0, help="of each road [s]")
    parser.add_argument("--roads", type=int, default=4)
    parser.add_argument("--steps", type=int, default=600, help="gradients for the bound")
    options = parser.parse_args()
    jaxdamp.configure()
    compare(options.duration, options.roads, options.steps)
    speed()


if __name__ == "__main__":
    main()
