"""What blocks in a store cost: beside one sweep in memory, by Dask workers, and the memory of the client.

    python -m benchmarks.cluster
    python -m benchmarks.cluster fits --dampers 20000

Quarter cars with a Besinger damper, 10 s at 1 kHz: blocks of 32768 cars, processor time of all processes. Memory:
the largest resident size of a process that sweeps a product over 1e5 to 1e8 points, which are drawn block by block.
Fits: so many virtual dampers, made and fitted in blocks by this process, by two workers, and by two of which one is
killed after a tenth; the numbers must be equal to the bit. Where other work shares the machine, compare the processor
time a damper: a worker that replaces a killed one starts and compiles within it.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil
from distributed import Client, LocalCluster

import jaxdamp
from benchmarks._timing import report
from jaxdamp import Ride, bench, identify, roads, sweeps, vehicles
from jaxdamp.blocks.cutting import LARGEST
from jaxdamp.dampers import Besinger, Bilinear


BLOCKS = 4, 12  # of two sweeps, whose difference compiles nothing
RANGES = {"compression_rate": (1e3, 4e3), "rebound_rate": (2e3, 9e3)}
POINTS = [10**5, 10**6, 10**7, 10**8]


def ride() -> Ride:
    law = Besinger(1600.0, 4200.0, 900.0, limit_velocity=0.13, transition_velocity=0.35)
    road = roads.iso8608("C", speed=20.0, seed=1)
    return Ride(vehicles.presets.quarter_car_000(law), road, metrics=["rms_sprung_acceleration"], duration=10.0)


def product(point):
    return {"y": point["a"] * point["b"]}


def processor_time(workers: list[int]) -> float:
    """Seconds of this process and of others that still run."""
    own = time.process_time()
    return own + sum(sum(psutil.Process(pid).cpu_times()[:2]) for pid in workers)


def with_children() -> float:
    """Processor time [s] of this process and of all below it that run."""
    return processor_time([child.pid for child in psutil.Process().children(recursive=True)])


def blocks(folder: Path) -> list[list[object]]:
    """Processor time of so many cars by who computes them, once each has compiled."""
    car, rows = ride(), []
    cars = {n: sweeps.random(RANGES, n * LARGEST, seed=n) for n in BLOCKS}

    def measured(name: str, workers: list[int], **options) -> None:
        seconds = {}
        for turn, n in enumerate((BLOCKS[0], *BLOCKS)):  # the first turn compiles
            points = cars[n]
            stored = {"file": folder / f"{name}-{turn}.zarr"} if options or name == "store" else {}
            before, begin = processor_time(workers), time.perf_counter()
            jaxdamp.sweep(car, points, **stored, **options)
            seconds[n] = processor_time(workers) - before, time.perf_counter() - begin
        few, many = BLOCKS
        each = [(seconds[many][i] - seconds[few][i]) / (many - few) for i in (0, 1)]
        rows.append([name, *each, 100.0 * (each[0] / rows[0][1] - 1.0) if rows else 0.0])

    measured("memory", [])
    measured("store", [])
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local, Client(local) as client:
        pids: dict[str, int] = client.run(os.getpid)  # pyright: ignore[reportAssignmentType]
        workers = list(pids.values())
        measured("dask, 2 workers", workers, cluster=client)
    return rows


def memory(count: int, folder: Path) -> float:
    """Largest resident size [MB] of a process that fills a store."""
    script = (
        "import resource, sys; import jaxdamp; from jaxdamp import sweeps; from benchmarks.cluster import product\n"
        f"points = sweeps.random({{'a': (0.0, 1.0), 'b': (0.0, 1.0)}}, {count})\n"
        f"jaxdamp.sweep(product, points, file={str(folder / f'{count}.zarr')!r})\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return float(ended.stdout.split()[-1])


def made(i: int) -> bench.BenchRun:
    """The record of damper i of a line, in NumPy: what is measured is its fit."""
    time = np.arange(800) / 200.0
    stroke, velocity = 0.02 * np.sin(2.0 * np.pi * time), 0.04 * np.pi * np.cos(2.0 * np.pi * time)
    force = np.where(velocity > 0.0, 2000.0 + i % 100, 1200.0) * velocity
    noise = np.random.default_rng(i).normal(0.0, 4.0, time.size)
    return bench.BenchRun(time=time, stroke=stroke, velocity=velocity, force=force + noise, name=f"damper {i}")


def fits(count: int, folder: Path) -> list[list[object]]:
    """Wall and processor time of the fits, by who computes them, and the memory of this process."""
    jaxdamp.configure(cache=False)
    rows, results = [], []

    def measured(name: str, workers: list[int], **options) -> None:
        few, start = bench.DamperRecords(made, range(512)), Bilinear(1500.0, 1500.0)  # blocks for every worker
        identify.fit_many(start, few, file=folder / f"{name} compiles.zarr", **options)
        records = bench.DamperRecords(made, range(count))

        lost = []  # processor time of who was killed

        def told(done: int, total: int) -> None:
            if workers and done >= total / 10:
                lost.append(sum(psutil.Process(workers[0]).cpu_times()[:2]))
                os.kill(workers.pop(), signal.SIGKILL)

        begin = time.perf_counter(), time.process_time(), with_children()
        results.append(identify.fit_many(start, records, file=folder / f"{name}.zarr", progress=told, **options))
        wall, own, everyone = time.perf_counter() - begin[0], time.process_time() - begin[1], with_children() - begin[2]
        memory = psutil.Process().memory_info().rss / 1e6
        rows.append([name, wall, own, 1e3 * (everyone + sum(lost)) / count, memory, len(workers)])
        print(*rows[-1], flush=True)

    measured("one process", [])
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local, Client(local) as client:
        pids: dict[str, int] = client.run(os.getpid)  # pyright: ignore[reportAssignmentType]
        measured("two workers", [], cluster=client)
        measured("two workers, one killed", list(pids.values())[:1], cluster=client)
    for result in results:
        assert np.array_equal(result.values, results[0].values), "other numbers"
        assert np.array_equal(result.standard_errors, results[0].standard_errors), "other standard errors"
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", choices=["blocks", "fits"], default="blocks")
    parser.add_argument("--dampers", type=int, default=20_000)
    asked = parser.parse_args()
    if asked.what == "fits":
        with tempfile.TemporaryDirectory() as name:
            head = ["fitted by", "wall s", "processor s of the client", "processor ms a damper, all processes"]
            head += ["resident size of the client MB", "not killed"]
            report("cluster_fits", f"{asked.dampers} dampers", head, fits(asked.dampers, Path(name)))
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        table = ["computed by", "processor s a block", "wall s a block", "more processor time %"]
        report("cluster_blocks", "Blocks of a sweep", table, blocks(folder))
        rows = [[count, memory(count, folder)] for count in POINTS]
        report("cluster_memory", "Memory of a sweep into a store", ["points", "largest resident size MB"], rows)


if __name__ == "__main__":
    main()
