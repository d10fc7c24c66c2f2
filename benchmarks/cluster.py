"""What blocks in a store cost: beside one sweep in memory, by other processes, and the memory of the client.

    python -m benchmarks.cluster
    python -m benchmarks.cluster memory --points 1e8
    python -m benchmarks.cluster fits --dampers 20000

Blocks: quarter cars with a Besinger damper, 10 s at 1 kHz, 32768 in a block; processor time of all processes, for which
5 % more than in memory is asked. Memory: the largest resident size of a client, its scheduler included, whose two
workers sweep a product over 1e5 and more points, which are drawn block by block; it must not grow with them. Fits: so
many virtual dampers, made and fitted in blocks by this process, by two processes of a pool, by two Dask workers, and by
two of which one is killed after a tenth; the numbers must be equal to the bit, and the time of two 1.1 times half that
of one is asked. The pool shows what two processes cost without Dask: they share memory and cache. Where other work
shares the machine, compare the processor time a damper: a worker that replaces a killed one starts and compiles within
it, and the loops of client and workers take 3 % of a core each as long as they wait, too.

Dask is measured as it comes, and with the settings of docs/cluster.md ("quiet").
"""

import argparse
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

import dask.config
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
QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 2**27,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 2**25,
}
FEWEST = 10**5  # points of the smallest sweep whose memory is measured


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


@contextmanager
def two_workers(settings: dict[str, object]) -> Iterator[tuple[Client, list[int]]]:
    """A client with two workers, and their processes."""
    with (
        dask.config.set(settings),
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local,
        Client(local) as client,
    ):
        pids: dict[str, int] = client.run(os.getpid)  # pyright: ignore[reportAssignmentType]
        yield client, list(pids.values())


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
    for name, settings in (("dask, 2 workers", {}), ("the same, quiet", QUIET)):
        with two_workers(settings) as (client, workers):
            measured(name, workers, cluster=client)
    return rows


def sweep_as_client(count: int, file: str) -> None:
    """Have two workers fill a store, and print the largest resident size [MB] of this process."""
    points = sweeps.random({"a": (0.0, 1.0), "b": (0.0, 1.0)}, count)
    with two_workers({}) as (client, _):
        jaxdamp.sweep(product, points, file=file, cluster=client)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)


def memory(largest: int) -> list[list[object]]:
    """Largest resident size of a client, by the number of points."""
    rows, count = [], FEWEST
    while count <= largest:
        with tempfile.TemporaryDirectory() as name:
            script = f"from benchmarks.cluster import sweep_as_client; sweep_as_client({count}, '{name}/s.zarr')"
            begin = time.perf_counter()
            ended = subprocess.run([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, check=True)
            rows.append([count, float(ended.stdout.split()[-1]), time.perf_counter() - begin])
            print(*rows[-1], flush=True)
        count *= 10
    return rows


def made(i: int) -> bench.BenchRun:
    """The record of damper i of a line, in NumPy: what is measured is its fit."""
    time = np.arange(800) / 200.0
    stroke, velocity = 0.02 * np.sin(2.0 * np.pi * time), 0.04 * np.pi * np.cos(2.0 * np.pi * time)
    force = np.where(velocity > 0.0, 2000.0 + i % 100, 1200.0) * velocity
    noise = np.random.default_rng(i).normal(0.0, 4.0, time.size)
    return bench.BenchRun(time=time, stroke=stroke, velocity=velocity, force=force + noise, name=f"damper {i}")


def fits(count: int, folder: Path) -> list[list[object]]:
    """Wall and processor time of the fits, by who computes them, and the memory of this process."""
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
        memory, share = psutil.Process().memory_info().rss / 1e6, 2.0 * wall / rows[0][1] if rows else 1.0
        rows.append([name, wall, share, own, 1e3 * (everyone + sum(lost)) / count, memory])
        print(*rows[-1], flush=True)

    measured("one process", [])
    with ProcessPoolExecutor(2, get_context("spawn"), jaxdamp.configure) as pool:
        measured("two of a pool", [], cluster=pool)
    with two_workers({}) as (client, _):
        measured("two workers", [], cluster=client)
    with two_workers(QUIET) as (client, workers):
        measured("two workers, quiet", [], cluster=client)
        measured("the same, one killed", workers[:1], cluster=client)
    for result in results:
        assert np.array_equal(result.values, results[0].values), "other numbers"
        assert np.array_equal(result.standard_errors, results[0].standard_errors), "other standard errors"
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", default=["blocks", "memory", "fits"])
    parser.add_argument("--dampers", type=int, default=20_000)
    parser.add_argument("--points", type=float, default=1e8, help="of the largest sweep whose memory is measured")
    asked = parser.parse_args()
    jaxdamp.configure(cache=False)
    if "blocks" in asked.what:
        head = ["computed by", "processor s a block", "wall s a block", "more processor time %"]
        with tempfile.TemporaryDirectory() as name:
            report("cluster_blocks", "Blocks of a sweep", head, blocks(Path(name)))
    if "memory" in asked.what:
        head = ["points", "largest resident size of the client MB", "wall s"]
        report("cluster_memory", "Memory of a sweep by two workers into a store", head, memory(int(asked.points)))
    if "fits" in asked.what:
        head = ["fitted by", "wall s", "wall / (one process / 2)", "processor s of the client"]
        head += ["processor ms a damper, all processes", "resident size of the client MB"]
        with tempfile.TemporaryDirectory() as name:
            report("cluster_fits", f"{asked.dampers} dampers", head, fits(asked.dampers, Path(name)))


if __name__ == "__main__":
    main()
