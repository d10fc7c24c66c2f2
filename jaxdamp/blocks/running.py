"""Blocks of work, computed here, by a part of an array job, or by the processes of an executor or a Dask cluster."""

import functools
import importlib.metadata
import itertools
import os
import pickle
import platform
import queue
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from typing import NamedTuple, Protocol, final, runtime_checkable

import jax
import numpy as np

from jaxdamp import _checks
from jaxdamp._one_thread import usable_cores
from jaxdamp._progress import Progress, tell
from jaxdamp._warned import warn
from jaxdamp.blocks.store import AbstractStore


@runtime_checkable
class HasExecutor(Protocol):
    """A Dask `Client`, as far as it is needed."""

    def get_executor(self, **options: object) -> Executor:
        """Runs functions on the workers."""
        ...


Cluster = Executor | HasExecutor | str | None
Results = Mapping[str, np.ndarray]
WAITING = 3  # blocks that wait for each worker, so that none stands still
LOOK, NO_WORKER = 5.0, 60.0  # s between two looks at the workers, and without any before it is given up


class AbstractWork(ABC):
    """Something to compute at many points. It is pickled, without what it compiled, and sent to the workers.

    Results have the points along the first axis; "failed" and "reason", which is empty where a point can be computed,
    are among them.
    """

    @abstractmethod
    def compute(self, indices: np.ndarray) -> Results:
        """The results at some points, by their numbers."""

    @abstractmethod
    def without_results(self, indices: np.ndarray, reason: str) -> Results:
        """What stands in the store for points that cannot be computed."""

    def part(self, indices: np.ndarray) -> "AbstractWork":
        """The work with only what these points need, which is sent with their block; itself if all need the same."""
        del indices
        return self


class _Job(NamedTuple):
    """Work as it travels."""

    name: str  # of this job, by which a worker knows that it has it already
    pickled: bytes
    versions: dict[str, str]
    double: bool  # precision


def fill(
    store: AbstractStore,
    work: AbstractWork,
    cluster: Cluster,
    progress: Callable[[int, int], None] | None,
    doing: str,
    what: str = "points",
) -> None:
    """Compute the blocks that a store lacks or that were damaged on the disk, and tell how far it is.

    Arguments:
        store: takes the blocks.
        work: computes the points.
        cluster: a `concurrent.futures.Executor`, a Dask `Client`, "k/n" for the k-th of n parts of the blocks in this
            process, or None for all of them in this process.
        progress: called with the number of points done and of all points, of a part with "k/n"; a line in the terminal
            if None.
        doing: in a word, such as "Sweeping".
        what: the points are.
    """
    part, parts = _checks.part_of("cluster", cluster) if isinstance(cluster, str) else (1, 1)
    own = range(part - 1, store.blocks.count, parts)
    damaged = store.repair(own)
    if damaged:
        warn(f"{damaged} blocks in {store.path} were damaged on the disk, and are computed anew.")
    left = [int(number) for number in store.left() if number in own]
    total, missing = (sum(map(store.blocks.size, numbers)) for numbers in (own, left))
    done, start = total - missing, time.monotonic()
    with Progress(doing) as shown:

        def on_block(points: int) -> None:
            nonlocal done
            done += points
            rate = (done - total + missing) / max(time.monotonic() - start, 1e-9)
            tell(progress, shown, done, total, rate, what)

        if cluster is None or isinstance(cluster, str):
            for number in left:
                indices = store.blocks.indices(number)
                store.write(number, work.compute(indices))
                on_block(indices.size)
        elif left:
            _by_workers(work, store, _Workers(cluster, work, store.blocks.indices(left[0])), left, on_block)


@final
class _Workers:
    """The processes of a cluster, which have the work."""

    def __init__(self, cluster: "Executor | HasExecutor", work: AbstractWork, first: np.ndarray) -> None:
        self._cluster, self._work = cluster, work
        self._job = _packed(work) if work.part(first) is work else None
        executor = cluster.get_executor(pure=False) if isinstance(cluster, HasExecutor) else cluster
        if not isinstance(executor, Executor):
            must = "be a Dask client, an executor of `concurrent.futures`, or a part such as '1/4'"
            _checks.refuse("cluster", must, _checks.described(cluster), "The call is `sweep(..., cluster=Client())`.")
        if not self.count():
            remedy = "Start some: `Client(n_workers=4, threads_per_worker=1)`."
            _checks.refuse("cluster", "have workers", "one without", remedy)
        self._executor = executor

    def count(self) -> int:
        """How many blocks can be computed at a time."""
        threads = getattr(self._cluster, "nthreads", None)
        try:
            return usable_cores() if threads is None else sum(threads().values())
        except Exception as error:  # what a client raises that has no scheduler depends on how it lost it
            raise RuntimeError(
                "The client is closed, or its scheduler has ended. Blocks that are done are in the store: make a new "
                f"client, and the same call goes on from there. ({type(error).__name__}: {error})"
            ) from error

    def job(self, indices: np.ndarray) -> _Job:
        """The work as it travels, with every block: no copy is lost with its worker."""
        return self._job or _packed(self._work.part(indices))

    def block(self, store: AbstractStore, number: int, tell: Callable[["Future[int]"], object]) -> "Future[int]":
        """Compute and write a block, and tell when it has ended; gives the number of its points."""
        future = self._executor.submit(_block, self.job(store.blocks.indices(number)), store, number)
        future.add_done_callback(tell)
        return future


def _by_workers(
    work: AbstractWork, store: AbstractStore, workers: _Workers, left: list[int], on_block: Callable[[int], None]
) -> None:
    """Compute the blocks on workers; those that end workers last, by processes of this one, which only they can hit."""
    fatal = []
    for number, future in _in_turn(workers, store, left):
        try:
            on_block(future.result())
        except CancelledError as error:
            raise RuntimeError(
                f"Block {number} was cancelled: by someone, or because the client was closed or its scheduler ended. "
                f"What is done is in {store.path}, and the same call with a working client goes on from there."
            ) from error
        except BrokenExecutor as error:
            raise RuntimeError(
                f"A process of the pool ended while it computed block {number} or one of those beside it. What is "
                f"done is in {store.path}, and the same call goes on from there. A Dask client replaces workers that "
                "end, and leaves out points that end them."
            ) from error
        except Exception as error:
            if type(error).__name__ != "KilledWorker":
                raise
            fatal.append(number)
        del future  # Dask computes again what is asked for and was lost with a worker
    for number in fatal:
        indices = store.blocks.indices(number)
        pieces = list(_survivors(workers.job(indices), work, indices))
        store.write(number, {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]})
        on_block(indices.size)


def _in_turn(workers: _Workers, store: AbstractStore, left: list[int]) -> Iterator[tuple[int, Future[int]]]:
    """The blocks as they end, few of them submitted at a time; whoever stops cancels the others.

    Whatever the number of workers, a block costs the same: futures report themselves, and workers are counted now and
    then.
    """
    waiting, active = iter(left), {}
    ended: queue.SimpleQueue[Future[int]] = queue.SimpleQueue()
    missing_since, looked, count = np.inf, -np.inf, 0  # start of an absence of all workers, last look, workers
    try:
        while True:
            now = time.monotonic()
            if now - looked >= LOOK or not count:
                looked, count = now, workers.count()
                missing_since = np.inf if count else min(missing_since, now)
            room = max(WAITING * count - len(active), 0 if active else 1)
            active |= {workers.block(store, number, ended.put): number for number in itertools.islice(waiting, room)}
            if not active:
                return
            try:
                done = ended.get(timeout=LOOK)
            except queue.Empty:
                if time.monotonic() - missing_since > NO_WORKER:
                    blocks = ", ".join(map(str, sorted(active.values())))
                    raise RuntimeError(
                        f"All workers of the cluster have ended, and none came in {NO_WORKER:g} s; blocks {blocks} "
                        f"were asked for. What is done is in {store.path}, and the same call goes on from there."
                    ) from None
            else:
                yield active.pop(done), done
                del done
    finally:
        for future in active:
            future.cancel()


def _survivors(job: _Job, work: AbstractWork, indices: np.ndarray) -> Iterator[Results]:
    """The results of a block that ends the process that computes it: by halves, without the points that do it."""
    pending, child = [indices], _child()
    try:
        while pending:
            part = pending.pop()
            try:
                yield child.submit(_points, job, part).result()
            except BrokenExecutor:
                child.shutdown()
                child = _child()
                if part.size > 1:
                    pending += np.array_split(part, 2)[::-1]
                else:
                    yield work.without_results(part, "it ended the process that computed it")
    finally:
        child.shutdown(cancel_futures=True)


def _child() -> Executor:
    """One process of this one's own, which may end."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    return ProcessPoolExecutor(1, get_context("spawn"))


@functools.cache
def _versions() -> dict[str, str]:
    return {name: importlib.metadata.version(name) for name in ("jaxdamp", "jax", "jaxlib", "numpy")}


def _packed(work: AbstractWork) -> _Job:
    """The work, pickled."""
    try:
        import cloudpickle  # comes with Dask; takes functions of notebooks along
    except ImportError:
        cloudpickle = pickle
    try:
        pickled = cloudpickle.dumps(work)
    except Exception:
        part = _cannot_travel(getattr(work, "function", work), "function") or _cannot_travel(work, "sweep")
        remedy = "Write it as a function or class at the top of a module that the workers can import, with plain data."
        _checks.refuse("function", "be one that can be sent to other processes", f"one in which {part}", remedy)
    name = f"{os.getpid()}-{os.urandom(8).hex()}"
    return _Job(name, pickled, _versions(), bool(jax.config.read("jax_enable_x64")))


def _cannot_travel(thing: object, path: str) -> str:
    """Which part cannot be pickled, and why."""
    try:
        pickle.dumps(thing)
    except Exception as error:
        why = f"{path} ({type(thing).__name__}) cannot be pickled: {error}"
    else:
        return ""
    state = thing.__getstate__()
    inside = thing if isinstance(thing, dict) else state if isinstance(state, dict) else {}
    return next((said for name, part in inside.items() if (said := _cannot_travel(part, f"{path}.{name}"))), why)


_jobs: dict[str, AbstractWork] = {}  # of this worker process
_one_at_a_time = threading.Lock()  # threads of a worker share its devices


def _unpacked(job: _Job) -> AbstractWork:
    """The work of a job, made once in a process; refused where it would give other numbers."""
    if job.name not in _jobs:
        here = _versions()
        different = [f"{name} {here[name]}, not {v}" for name, v in job.versions.items() if here[name] != v]
        if different:
            versions = "; ".join(different)
            raise RuntimeError(f"A worker on {platform.node()} has {versions} as here. Install the same versions.")
        _jobs.clear()
        _jobs[job.name] = pickle.loads(job.pickled)
    return _jobs[job.name]


def _points(job: _Job, indices: np.ndarray) -> Results:
    """The results at some points, in a worker."""
    with _one_at_a_time:
        before = bool(jax.config.read("jax_enable_x64"))
        jax.config.update("jax_enable_x64", job.double)  # of all threads: JAX calls Python back from others, too
        try:
            return _unpacked(job).compute(indices)
        finally:
            jax.config.update("jax_enable_x64", before)


def _block(job: _Job, store: AbstractStore, number: int) -> int:
    """Compute and write a block, in a worker; returns the number of its points."""
    indices = store.blocks.indices(number)
    store.write(number, _points(job, indices))
    return indices.size
