"""Sweeps on a Dask cluster of this machine, in a process of its own: `python on_cluster.py folder kill`.

`kill` is "worker", "client" or "nobody": who ends without warning after some blocks; "point": one of the points ends
whoever computes it; or "fits": a worker ends while dampers are fitted.
"""

import os
import signal
import sys
from pathlib import Path

import jax
import numpy as np
from dask import config
from distributed import Client, LocalCluster

import jaxdamp
from jaxdamp import identify
from jaxdamp.bench import BenchRun, DamperRecords
from jaxdamp.dampers import Bilinear
from jaxdamp.sweeps import points, random


POINTS = random({"a": (0.0, 3.0), "b": (-1.0, 1.0)}, 131_072, seed=2)
BLOCK = 8192


FATAL = 1234


def at(indices):
    return {"a": 1.0 * indices}


def ending(point):
    """Twice `a`; at one point it ends the process."""

    def passed(a):
        value = np.asarray(a)  # JAX must not be called from its own callbacks
        return value if value != FATAL else os._exit(1)

    a = jax.pure_callback(passed, jax.ShapeDtypeStruct((), point["a"].dtype), point["a"], vmap_method="sequential")
    return {"y": 2.0 * a}


def made(i):
    """Records of a damper of a line."""
    angle = 2.0 * np.pi * TIME
    velocity = 0.04 * np.pi * np.cos(angle)
    force = np.where(velocity > 0.0, 2000.0 + i % 100, 1200.0) * velocity
    noise = np.random.default_rng(i).normal(0.0, 4.0, TIME.shape)
    return BenchRun("1 Hz", TIME, 0.02 * np.sin(angle), velocity, force + noise)


TIME = np.arange(300) / 100.0
DAMPERS = DamperRecords(made, range(192))  # three blocks: while two workers compute, one is killed


def start():
    return Bilinear(1500.0, 1500.0)


def main(folder: Path, kill: str) -> None:
    from cases import decay

    jax.config.update("jax_enable_x64", True)
    config.set({"distributed.scheduler.active-memory-manager.start": False})
    config.set({"distributed.deploy.lost-worker-timeout": "300 s"})  # a busy machine starts workers again slowly
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        pids: dict[str, int] = client.run(os.getpid)  # pyright: ignore[reportAssignmentType]
        workers, kills = list(pids.values()), []

        def told(done: int, _: int) -> None:
            if done == (64 if kill == "fits" else 4 * BLOCK) and kill != "nobody":
                kills.append(done)
                os.kill(workers[0] if kill in ("worker", "fits") else os.getpid(), signal.SIGKILL)

        if kill == "point":
            jaxdamp.sweep(ending, points(at, 2 * FATAL), file=folder / "point.zarr", cluster=client)
            return
        if kill == "fits":
            identify.fit_many(start(), DAMPERS, file=folder / "fits.zarr", cluster=client, progress=told)
            assert kills == [64]
            return
        data = jaxdamp.sweep(decay(), POINTS, file=folder / f"{kill}.zarr", cluster=client, progress=told)
        assert data.attrs["points_done"] == POINTS.count


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
