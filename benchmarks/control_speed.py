"""What a controller costs: one car and many under linear skyhook, beside passive ones and hand-written C.

`python -m benchmarks.control --speed`. The C has the same policy, actuator and step (`peers/kernels/skyhook.h`) and
gives the same numbers. Both times are of one core; a sweep is timed after its first part, which compiles.
"""

import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers import c, problem
from jaxdamp import Ride, roads, sweep
from jaxdamp.control import Controlled, Skyhook
from jaxdamp.dampers import Linear, Scheduled
from jaxdamp.simulation import Exponential
from jaxdamp.sweeps import points
from jaxdamp.vehicles.presets import quarter_car_000


DURATION, DT, LAG = 10.0, 1e-3, 1.0 / (100.0 * np.pi)  # s
BODY = "rms_sprung_acceleration"
RANGES = ((600.0, 1500.0), (5e3, 9e3), (4e3, 12e3))  # soft and hard rate, gain [N s/m]
PATHS = ("car.damper.laws.0.rate", "car.damper.laws.1.rate", "policy.gain")


def drawn(cars: int) -> np.ndarray:
    """Rates and gains of so many cars."""
    low, high = np.array(RANGES).T
    return np.random.default_rng(0).uniform(low, high, (cars, 3))


def ride(heights: np.ndarray, *, printed: bool = False, controlled: bool = True) -> Ride:
    """The car of the kernel in C, with or without the controller."""
    damper = Scheduled((Linear(1e3), Linear(6e3)), levels=[0.0, 1.0], command=0.0)
    car = quarter_car_000(damper)
    vehicle = Controlled(car, Skyhook(6e3), actuator_lag=LAG) if controlled else car
    road, length = roads.from_profile(np.arange(heights.shape[0]) * DT, heights), (heights.shape[0] - 1) * DT
    return Ride(vehicle, road, metrics=[BODY], duration=length, engine=Exponential(dt=DT, printed=printed))


def swept(one: Ride, paths: tuple[str, ...], cars: int) -> tuple[float, np.ndarray]:
    """Million car-steps a second, and the results."""
    marks: list[tuple[float, int]] = []
    table = dict(zip(paths, drawn(cars).T, strict=False))
    data = sweep(one, points(table), devices=1, progress=lambda done, _: marks.append((time.process_time(), done)))
    (begin, first), (end, last) = marks[0], marks[-1]
    return (last - first) / (end - begin) * DURATION / DT / 1e6, data[BODY].values


def seconds(call: Callable[[], object], repeats: int = 5) -> float:
    """The least processor time of several calls [s], after a first."""
    jax.block_until_ready(call())
    times = []
    for _ in range(repeats):
        start = time.process_time()
        jax.block_until_ready(call())
        times.append(time.process_time() - start)
    return min(times)


def main(cars: int = 100_000) -> None:
    """Print both tables, times of the processor."""
    heights = problem.heights("besinger", DURATION, DT)
    both = {"passive": ride(heights, controlled=False), "linear skyhook": ride(heights)}
    paths = {"passive": ("damper.laws.0.rate", "damper.laws.1.rate"), "linear skyhook": PATHS}
    times = {}
    for name, one in both.items():
        point = {path: jnp.asarray(value) for path, value in zip(paths[name], (1e3, 6e3, 6e3), strict=False)}
        times[name] = seconds(lambda one=one, point=point: one(point), 20)
        print(f"one car, 10 s at 1 ms, {name}: {1e3 * times[name]:.2f} ms")
    print(f"ratio {times['linear skyhook'] / times['passive']:.2f}")
    rates = {f"{name}, sweep": swept(one, paths[name], cars) for name, one in both.items()}
    rates["linear skyhook, sweep printed as C"] = swept(ride(heights, printed=True), PATHS, cars)
    if c.available():
        table, found = drawn(cars), np.empty(0)

        def in_c() -> None:
            nonlocal found
            found = c.skyhook(table, heights, DT, lag=LAG)

        rates["linear skyhook, hand-written C"] = cars * DURATION / DT / 1e6 / seconds(in_c, 2), found
        print(f"largest difference from C {np.max(np.abs(rates['linear skyhook, sweep'][1] / found - 1.0)):.1e}")
    print(f"{cars} cars, 10 s at 1 ms, million car-steps a second of one core")
    for name, (rate, _) in rates.items():
        print(f"{name:40} {rate:8.0f}")
