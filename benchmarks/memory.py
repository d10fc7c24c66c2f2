"""Memory over the length of the run: needs of a compiled run and its derivatives, besides the road.

    python -m benchmarks.memory

The road itself takes 8 bytes for each instant and wheel; its slopes and slices in the loop as much again, a few times.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdamp import configure


configure(cpu_devices=1, cache=False)

from benchmarks import ours  # noqa: E402
from benchmarks._timing import report  # noqa: E402
from benchmarks.peers import problem  # noqa: E402
from jaxdamp.parameters import replace  # noqa: E402
from jaxdamp.simulation import Exponential  # noqa: E402
from jaxdamp.simulation.observer import recorded  # noqa: E402


DT = 1e-3


def megabytes(work: Any, *arguments: Any) -> float:
    """What the compiled work needs for results and in between."""
    size = jax.jit(work).lower(*arguments).compile().memory_analysis()
    assert size is not None
    return (size.temp_size_in_bytes + size.output_size_in_bytes) / 1e6


def main() -> None:
    ride = ours.ride("besinger", problem.heights("besinger", 1.0))
    path = ours.paths("besinger")[1]

    def level(heights: Array, rate: Array) -> Array:
        return eqx.tree_at(lambda r: r.heights, ride, heights)({path: rate})[ours.METRIC]

    def saved(every: int) -> Callable[[Array, Array], Array]:
        def run(heights: Array, rate: Array) -> Array:
            changed = replace(ride.vehicle, {path: rate})
            saved, _ = recorded(Exponential(), changed.system(), heights, jnp.asarray(DT), None, every, None)
            return saved.motion

        return run

    rows: list[list[Any]] = []
    for seconds in (10, 60, 600, 3600):
        heights = jax.ShapeDtypeStruct((round(seconds / DT) + 1, 1), float)
        rate = jax.ShapeDtypeStruct((), float)
        road = 8e-6 * heights.shape[0]
        whole, tenth = (megabytes(saved(every), heights, rate) for every in (1, 10))
        run = megabytes(level, heights, rate)
        ahead = megabytes(lambda h, r: jax.jvp(lambda r: level(h, r), (r,), (r,)), heights, rate)
        back = megabytes(jax.grad(level, argnums=1), heights, rate)
        rows.append([f"{seconds} s", road, run, ahead, back, whole, tenth])
    head = [
        "run",
        "road, MB",
        "metrics, MB",
        "with forward derivative",
        "with reverse derivative",
        "every instant saved",
        "one in ten",
    ]
    report("memory", "Memory of one quarter car at 1 kHz", head, rows)


if __name__ == "__main__":
    main()
