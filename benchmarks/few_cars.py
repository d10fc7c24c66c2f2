"""What a sweep of few cars costs: one after the other, as is the default, and side by side (`chunk=`).

    python -m benchmarks.few_cars

Seconds of the processor, in all of its threads and in compilers, of a first sweep and of one with other numbers.
"""

import os

import numpy as np

from jaxdamp import configure


configure(cache=False)

from benchmarks._timing import report  # noqa: E402
from jaxdamp import Ride, dampers, roads, sweep  # noqa: E402
from jaxdamp.vehicles import presets  # noqa: E402


LENGTH = 20.0  # s at 1 kHz
CARS = {
    "quarter, linear": presets.quarter_car_000(),
    "quarter, twin-tube": presets.quarter_car_000(dampers.TwinTube.reference()),
    "half, linear": presets.half_car_002(),
    "full, linear": presets.full_car_jazar(),
}


def seconds() -> float:
    """Of this process and of the compilers that it has started."""
    return sum(os.times()[:4])


def cost(ride: Ride, masses: np.ndarray, chunk: int | None) -> tuple[float, float]:
    """Seconds of a first sweep and of one with other numbers."""
    costs = []
    for factor in (1.0, 1.001):
        start = seconds()
        sweep(ride, {"sprung_mass": factor * masses}, chunk=chunk)
        costs.append(seconds() - start)
    return costs[0], costs[1]


def main() -> None:
    """Print the table."""
    rows = []
    for name, car in CARS.items():
        ride = Ride(car, roads.iso8608("C", 20.0, LENGTH, seed=1), duration=LENGTH)
        for count in (5, ride.sequential_points):
            masses = np.linspace(0.9, 1.1, count) * float(np.asarray(car.sprung_mass))
            for way, chunk in (("one after the other", None), ("side by side", count)):
                rows.append((name, count, way, *(f"{each:.2f}" for each in cost(ride, masses, chunk))))
    report("few_cars", "A sweep of few cars, processor seconds", ["vehicle", "cars", "driven", "first", "again"], rows)


if __name__ == "__main__":
    main()
