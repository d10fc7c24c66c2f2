"""How long a new process takes until its first result, with an empty and with a warm cache of compiled programs.

    python -m benchmarks.first_result [DYNO FILES]

The files, all of one damper and counted positive in rebound, are also fitted at the command line: the first one by the
laws that suit it, also with a delay of the machine, all of them by every law; then `report` on all of them, `demo`, and
a command that fails. Without files there is one, of a virtual damper, written before the clock starts.
Wall and processor time stand in seconds and in bases, of which one is a new process that imports jax and compiles
x * x; beside them the number of XLA programs.
"""

import os
import resource
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


# Modules are compiled to bytecode once, as an installation does.
SURROUNDINGS = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
BASE = "import jax; jax.jit(lambda x: x * x)(1.0)"
COMMAND = """
import sys
from jaxdamp.cli import main
sys.argv[:] = ["jaxdamp", *{words!r}]
main()
"""
COUNTED = """
import atexit, sys
import jax.monitoring
programs = []
jax.monitoring.register_event_duration_secs_listener(
    lambda name, *_, **__: programs.append(name) if name.endswith("backend_compile_duration") else None
)
atexit.register(lambda: print("programs:", len(programs), file=sys.stderr))
"""  # without it, a command that fails loads no JAX


def cost(script: str, cache: str, code: int = 0) -> tuple[float, float, str]:
    """Wall and processor seconds of a new process, and what it says of its XLA programs."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    surroundings = SURROUNDINGS | {"XDG_CACHE_HOME": cache}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=surroundings)
    if done.returncode != code:
        raise RuntimeError(done.stderr)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    counted = [int(part.split()[0]) for part in done.stderr.split("programs: ")[1:]]  # of each of its processes
    return wall, used, str(sum(counted)) if counted else ""


def seconds(script: str) -> float:
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=SURROUNDINGS)
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
    report_fits([str(Path(name).resolve()) for name in sys.argv[1:]])


def report_fits(files: list[str]) -> None:
    """The fits of the command line with nothing cached, and again with what the first ones left."""
    with tempfile.TemporaryDirectory() as folder:
        files = files or [dyno_file(folder)]
        base = [min(each) for each in zip(*(cost(BASE, folder)[:2] for _ in range(3)), strict=True)]
        rows: list[list[Any]] = [["base", *base, 1.0, 1.0, ""]]
        missing = str(Path(folder) / "none.csv")
        some, sign = files[:1], ["--sign", "rebound-positive"]
        asked = {
            "fit, one file, laws that suit it": ["fit", *some, *sign],
            "fit, one file, with a delay of the machine": ["fit", *some, *sign, "--rig", "offset,delay"],
            f"fit, {len(files)} files, all laws": ["fit", *files, *sign, "--law", "all"],
            f"report, {len(files)} files": ["report", *files, *sign],
            "demo": ["demo"],
            "fit, a file that is not there": ["fit", missing],
        }
        for name, words in asked.items():
            for again in ("", ", again"):
                out = ["--out", str(Path(folder) / f"{len(rows)}")]
                script, fails = COMMAND.format(words=[*words, *out]), words[-1] == missing
                cache = str(Path(folder) / f"cache {name}")
                wall, used, programs = cost(script, cache, 2) if fails else cost(COUNTED + script, cache)
                rows.append([f"jaxdamp {name}{again}", wall, used, wall / base[0], used / base[1], programs])
    head = ["what", "wall, s", "processor, s", "bases, wall", "bases, processor", "XLA programs"]
    report("first_fits", "Commands", head, rows)


if __name__ == "__main__":
    main()
