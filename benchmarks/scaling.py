"""How the rate grows with the number of cars and with devices, with and without `jaxdamp.configure`.

    python -m benchmarks.scaling

The time of the compiled program alone, cars side by side as `sweep` lays them out. Runs itself once more for the
column without `configure`, which must come before JAX starts.
"""

import json
import subprocess
import sys
from typing import Any

import jax
import numpy as np

from jaxdamp import configure


PLAIN = "--plain" in sys.argv
DONE = configure(cache=False) if not PLAIN else configure(cpu_devices=1, fused_loops=False, cache=False)

from benchmarks import ours  # noqa: E402
from benchmarks._timing import first_and_warm, report  # noqa: E402
from benchmarks.peers import problem  # noqa: E402
from jaxdamp.sweeps.axes import as_points, points  # noqa: E402
from jaxdamp.sweeps.function import trace  # noqa: E402
from jaxdamp.sweeps.program import prepare  # noqa: E402


CARS = [4**k for k in range(9)]


def rates(devices: int) -> dict[int, list[float]]:
    """Million car-steps a second and seconds of compiling, by number of cars."""
    found = {}
    road = problem.heights("besinger")
    ride = ours.ride("besinger", road).side_by_side()
    for cars in CARS:
        cloud = as_points(points(ours.point("besinger", problem.draw("besinger", cars))))
        traced = trace(ride, cloud.names, False)
        program = prepare(traced, cars, None, devices, ride.lanes)
        columns = cloud.columns(np.arange(min(cars, program.capacity(program.layout.rounds))))
        size = len(next(iter(columns.values())))
        _, warm = first_and_warm(lambda p=program, c=columns: p.start(c), 3)
        found[cars] = [size * (road.shape[0] - 1) / warm / 1e6, program.layout.chunk]
    return found


def main() -> None:
    if PLAIN:
        print(json.dumps(rates(1)))
        return
    told = subprocess.run([sys.executable, "-m", "benchmarks.scaling", "--plain"], capture_output=True, text=True)
    plain = json.loads(told.stdout.splitlines()[-1])
    by_devices = {n: rates(n) for n in range(1, jax.local_device_count() + 1)}
    rows: list[list[Any]] = []
    for cars in CARS:
        fused = [by_devices[n][cars] for n in by_devices]
        rows.append([cars, plain[str(cars)][0], *[rate for rate, _ in fused], int(fused[-1][1])])
    head = ["cars", "without configure, 1 device", *[f"{n} device(s)" for n in by_devices], "side by side"]
    report("scaling", "Quarter cars with Besinger dampers, 10 s at 1 kHz, million car-steps a second", head, rows)


if __name__ == "__main__":
    main()
