"""How long a new process takes until its first result, with an empty and with a warm cache of compiled programs.

    python -m benchmarks.first_result [FOLDER OF DYNO FILES]

Without a folder the dyno file is a virtual one, written before the clock starts.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._timing import report


IMPORT = "import jaxdamp"
RUN = """
import jaxdamp
jaxdamp.configure(cache={cache!r})
car = jaxdamp.vehicles.presets.quarter_car_000(jaxdamp.dampers.Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05))
road = jaxdamp.roads.iso8608("C", speed=20.0, seed=0)
print(jaxdamp.simulate(car, road, duration=10.0).metrics()["rms_sprung_acceleration"])
"""
FIT = """
import jaxdamp
jaxdamp.configure(cache={cache!r})
from jaxdamp import bench, dampers, identify
runs = bench.read({file!r}, sign="rebound-positive")
law = dampers.Besinger.guess(runs[0].velocity, runs[0].force)
print(identify.fit(law, runs).rmse)
"""


def seconds(script: str) -> float:
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return time.perf_counter() - start


def dyno_file(folder: str) -> str:
    """A record of a damper at 3 Hz and 30 mm."""
    from jaxdamp import dampers

    time_, law = np.arange(0.0, 2.0, 5e-4), dampers.Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
    phase = 2.0 * np.pi * 3.0 * time_
    velocity = 0.03 * 2.0 * np.pi * 3.0 * np.cos(phase)
    columns = [time_, 30.0 * np.sin(phase), velocity, np.array([float(law.force_velocity(v)) for v in velocity])]
    path = str(Path(folder) / "dyno.csv")
    head = "time [s],stroke [mm],velocity [m/s],force [N]"
    np.savetxt(path, np.stack(columns, axis=1), delimiter=",", header=head, comments="")
    return path


def main() -> None:
    rows: list[list[Any]] = [["import jaxdamp", seconds(IMPORT), min(seconds(IMPORT) for _ in range(3))]]
    with tempfile.TemporaryDirectory() as folder:
        file = dyno_file(folder)
        for name, script in (("one simulated car", RUN), ("read and fit one dyno file", FIT)):
            text = script.format(cache=str(Path(folder) / "cache"), file=file)
            rows.append([name, seconds(text), min(seconds(text) for _ in range(3))])
    report("first_result", "From the start of Python to the first result, s", ["what", "first", "then"], rows)


if __name__ == "__main__":
    main()
