"""How long one car takes for 10 s of road at 1 kHz, and an hour of it, and how accurate it is.

    python -m benchmarks.one_car            with loops compiled as one function (`jaxdamp.configure`)
    python -m benchmarks.one_car --plain    with the default settings of JAX

"metrics" is `Ride` with one metric, compiled with its parameters as arguments; "all channels" is the engine behind
`simulate`, which stores the whole run.
"""

import sys
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import configure


PLAIN = "--plain" in sys.argv
configure(fused_loops=not PLAIN, cache=False)

from benchmarks._timing import first_and_warm, report  # noqa: E402
from benchmarks.peers import problem  # noqa: E402
from jaxdamp import Ride, dampers, roads, simulate, vehicles  # noqa: E402
from jaxdamp.parameters import get, parameters  # noqa: E402
from jaxdamp.simulation import Exponential  # noqa: E402
from jaxdamp.simulation.observer import recorded  # noqa: E402
from jaxdamp.vehicles import presets  # noqa: E402


BESINGER = dampers.Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
CARS = {
    "quarter, linear": presets.quarter_car_000(dampers.Linear(2500.0)),
    "quarter, Besinger": presets.quarter_car_000(BESINGER),
    "quarter, Besinger + lag": presets.quarter_car_000(dampers.Lag(BESINGER, 0.003)),
    "quarter, Besinger + series spring": presets.quarter_car_000(dampers.SeriesSpring(BESINGER, 1.5e6, 1.2e8)),
    "quarter, Bouc-Wen": presets.quarter_car_000(dampers.BoucWen(1500.0, 2e3, 300.0, 1e-3)),
    "half, two Besinger": problem.vehicle(problem.law("half_car", problem.draw("half_car", 1)[0]), "half_car"),
    "full, four linear": presets.full_car_jazar(),
}
METRIC, DT, FINE = "rms_sprung_acceleration", 1e-3, 8


def timed(ride: Ride) -> tuple[float, float]:
    """First and best seconds of a run as a function of one parameter."""
    path = next(p.path for p in parameters(ride.vehicle) if "damper" in p.path)
    drive = jax.jit(lambda value: ride({path: value})[METRIC])
    value = get(ride.vehicle, path)
    return first_and_warm(lambda: drive(value))


def on_road(car: vehicles.AbstractVehicle, heights: np.ndarray, dt: float) -> Ride:
    profile = roads.from_profile(np.arange(heights.shape[0]) * dt, heights)
    return Ride(car, profile, metrics=[METRIC], duration=(heights.shape[0] - 1) * dt, dt=dt)


def main() -> None:
    road = roads.iso8608("C", speed=20.0, seed=0)
    rows: list[list[Any]] = []
    for name, car in CARS.items():
        delayed = road if name.startswith("quarter") else roads.delayed(road, positions=car.axle_positions, speed=20.0)
        heights = simulate(car, delayed, duration=10.0).road
        coarse = np.asarray(heights)
        first, warm = timed(on_road(car, coarse, DT))
        _, saved = first_and_warm(
            lambda car=car, heights=heights: recorded(
                Exponential(), car.system(), heights, jnp.asarray(DT), None, 1, None
            )[0]
        )
        exact = simulate(
            car,
            roads.from_profile(np.arange(10_000 * FINE + 1) * DT / FINE, problem.refined(coarse, FINE)),
            duration=10.0,
            dt=DT / FINE,
        )["sprung_acceleration"][::FINE]
        found = on_road(car, coarse, DT)()[METRIC]
        error = abs(float(found / jnp.sqrt(jnp.mean(exact**2))) - 1.0)
        rows.append([name, 1e3 * warm, 1e3 * saved, first, error])
    how = "as JAX comes" if PLAIN else "loops compiled as one function"
    head = ["car and law", "metrics, ms", "all channels, ms", "first call, s", "error of the RMS"]
    report("one_car_plain" if PLAIN else "one_car", f"One car, 10 s at 1 kHz; {how}", head, rows)

    hour = np.tile(np.asarray(road.height(jnp.arange(10_000.0) * DT)), (361, 1))[:3_600_001]
    rows = []
    for name, car in list(CARS.items())[:2]:
        first, warm = timed(on_road(car, hour, DT))
        rows.append([name, warm, first])
    report("hour_plain" if PLAIN else "hour", f"One hour of road at 1 kHz; {how}", ["car", "s", "first call, s"], rows)


if __name__ == "__main__":
    main()
