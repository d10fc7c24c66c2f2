"""What 1e10 cars on 1000 workers cost: a simulation of the scheduler, with figures measured on two workers.

    python -m benchmarks.cluster_model

Blocks wait at the scheduler, which hands out one after the other; up to three wait at each worker. A worker compiles
first, computes block after block, ends at random, and comes back after a while; its blocks are handed out again, and
those that wait at it too. Written into docs/cluster.md.
"""

import dataclasses
import heapq
from collections import deque

import numpy as np

from benchmarks._timing import report


@dataclasses.dataclass(frozen=True)
class Cluster:
    """A cluster and its work.

    Attributes:
        blocks: of the sweep.
        workers: that are there.
        block: time of a block on a worker [s].
        spread: of this time, relative, uniform.
        handing: time of scheduler and client for a block [s], one block after the other.
        compiling: time before the first block of a worker [s].
        failures: of a worker in an hour.
        restart: time until a worker that ended is there again [s].
        waiting: blocks at each worker, with the one that is computed.
    """

    blocks: int
    workers: int
    block: float
    spread: float = 0.1
    handing: float = 6e-3
    compiling: float = 5.0
    failures: float = 0.0
    restart: float = 60.0
    waiting: int = 3


@dataclasses.dataclass(frozen=True)
class Course:
    """What a simulation gave: wall time [s], share of it that the workers computed, blocks lost, workers lost."""

    wall: float
    busy: float
    lost_blocks: int
    lost_workers: int


def simulate(cluster: Cluster, seed: int = 0) -> Course:
    """The course of a sweep, event after event."""
    rng = np.random.default_rng(seed)
    left, done, clock, free = cluster.blocks, 0, 0.0, 0.0  # free: when the scheduler can hand out the next block
    queues: list[deque[float]] = [deque() for _ in range(cluster.workers)]  # when each block that waits is there
    computing: list[float | None] = [None] * cluster.workers  # begin of the block that is computed
    life = [0] * cluster.workers  # events of an earlier life of a worker count no more
    ready = [cluster.compiling] * cluster.workers
    events: list[tuple[float, int, str, int]] = []
    busy, lost_blocks, lost_workers = 0.0, 0, 0

    def fails(worker: int, now: float) -> None:
        if cluster.failures:
            ends = now + rng.exponential(3600.0 / cluster.failures)
            heapq.heappush(events, (ends, worker, "ends", life[worker]))

    def hand(worker: int, now: float) -> None:
        nonlocal left, free
        while left and len(queues[worker]) + (computing[worker] is not None) < cluster.waiting:
            free = max(free, now) + cluster.handing
            left -= 1
            queues[worker].append(free)
        begin(worker, now)

    def begin(worker: int, now: float) -> None:
        if computing[worker] is None and queues[worker]:
            start = max(now, queues[worker].popleft(), ready[worker])
            computing[worker] = start
            takes = cluster.block * (1.0 + cluster.spread * rng.uniform(-1.0, 1.0))
            heapq.heappush(events, (start + takes, worker, "done", life[worker]))

    for _ in range(cluster.waiting):  # one block for each, then the second
        for worker in range(cluster.workers):
            if left:
                free, left = free + cluster.handing, left - 1
                queues[worker].append(free)
    for worker in range(cluster.workers):
        fails(worker, 0.0)
        begin(worker, 0.0)
    while done < cluster.blocks:
        clock, worker, what, of_life = heapq.heappop(events)
        if of_life != life[worker]:
            continue
        begun = computing[worker]
        if what == "done":
            assert begun is not None
            done, busy, computing[worker] = done + 1, busy + clock - begun, None
            hand(worker, clock)
        elif what == "ends":
            lost_workers += 1
            lost_blocks += begun is not None and begun <= clock
            left += len(queues[worker]) + (begun is not None)
            queues[worker].clear()
            computing[worker], life[worker] = None, life[worker] + 1
            ready[worker] = clock + cluster.restart + cluster.compiling
            heapq.heappush(events, (clock + cluster.restart, worker, "back", life[worker]))
        else:
            fails(worker, clock)
            hand(worker, clock)
    return Course(clock, busy / (clock * cluster.workers), lost_blocks, lost_workers)


BLOCKS = -(-(10**10) // 2**15)
CASES = {
    "cars of 10 s, blocks of 0.7 s": Cluster(BLOCKS, 1000, 0.7),
    "the same on 100 workers": Cluster(BLOCKS, 100, 0.7),
    "cars of 60 s, 4 s": Cluster(BLOCKS, 1000, 4.0),
    "half cars of 60 s, 12 s": Cluster(BLOCKS, 1000, 12.0),
    "12 s, a worker ends in 100 h": Cluster(BLOCKS, 1000, 12.0, failures=0.01),
    "12 s, a worker ends in 1 h": Cluster(BLOCKS, 1000, 12.0, failures=1.0),
    "12 s, a worker ends in 6 min": Cluster(BLOCKS, 1000, 12.0, failures=10.0),
}


def main() -> None:
    rows = []
    for name, cluster in CASES.items():
        course = simulate(cluster)
        ideal = cluster.blocks * cluster.block / cluster.workers
        times = course.wall / ideal
        rows.append([name, ideal, course.wall, times, 100.0 * course.busy, course.lost_workers, course.lost_blocks])
    head = ["case", "work / workers, s", "wall s", "times", "workers compute, %", "workers lost", "blocks lost"]
    report("cluster_model", f"1e10 cars: {BLOCKS} blocks of 32768", head, rows)


if __name__ == "__main__":
    main()
