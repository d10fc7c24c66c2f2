"""The compiled program of a sweep: chunks of points side by side, chunk after chunk, on every device at once."""

import dataclasses
import functools
import logging
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._quickly import FEW, Level, options_of
from jaxdamp.sweeps.axes import Columns
from jaxdamp.sweeps.function import Traced, evaluate, number_type


if TYPE_CHECKING:
    from jaxlib._jax import Device


def choose_devices(devices: object) -> "list[Device]":
    """The devices to use: all of this process, so many, or those given."""
    here = jax.local_devices()
    if devices is None:
        return here
    if not isinstance(devices, int):
        if not isinstance(devices, Sequence) or not devices:
            _checks.refuse("devices", "be a number, or one or more of `jax.devices()`", devices)
        return list(devices)
    if not 1 <= devices <= len(here):
        remedy = (
            "A processor is one device unless `jaxdamp.configure(cpu_devices=...)` says otherwise, before anything "
            "is computed."
        )
        _checks.refuse("devices", f"be from 1 to {len(here)}, the devices that JAX shows", devices, remedy)
    return here[:devices]


def free_memory(mesh: Mesh) -> float:
    """Bytes that each device of this process could still take."""
    devices = list(mesh.devices.flat)
    stats = devices[0].memory_stats() if devices[0].platform != "cpu" else None
    if stats and "bytes_limit" in stats:
        return float(stats["bytes_limit"] - stats["bytes_in_use"])
    free = []
    if Path("/proc/meminfo").exists():
        lines = dict(line.split(":") for line in Path("/proc/meminfo").read_text().splitlines())
        free.append(1024 * float(lines["MemAvailable"].split()[0]))
    group = Path("/sys/fs/cgroup")  # a container may have less than the machine
    if (group / "memory.max").exists() and (group / "memory.max").read_text().strip() != "max":
        used = float((group / "memory.current").read_text())
        free.append(float((group / "memory.max").read_text()) - used)
    if not free:
        free.append(0.5 * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 2e9)
    return max(min(free), 1e6) / len(devices)


ON_CPU, ON_GPU = 256, 2**18  # points side by side where nobody says how many
# Reverse derivatives take one in so many of a run's lanes. A quarter car with a Besinger damper, 10 s at 1 kHz,
# one core with 16 MB of the last cache, microseconds a car: 302 for 16 lanes, 201 for 32, 672 for 64, 1140 for 128,
# where a run takes 99, 62, 43 and 62. So a sweep of any size costs what 32 lanes do (`python -m benchmarks.gradients`).
REVERSE = 4
BUFFER_POINTS = 2**15  # that one call can hand to one device
BUFFER_BYTES = 2**28  # of their results
SHARE = 0.5  # of the free memory that a sweep may take
POINTS, ALL = PartitionSpec("points"), PartitionSpec()


class Layout(NamedTuple):
    """How points are laid out. Programs of equal layouts of equal functions are compiled once."""

    mesh: Mesh
    chunk: int  # points side by side on one device
    rounds: int  # chunks that one call can hold for each device


@final
@dataclasses.dataclass(frozen=True)
class Program:
    """A compiled sweep, which takes any number of points up to what its layout holds."""

    traced: Traced
    layout: Layout
    arrays: list[jax.Array]
    run: jax.stages.Compiled

    def capacity(self, rounds: int) -> int:
        """Points of a call that runs so many chunks on each device."""
        return rounds * self.layout.chunk * self.layout.mesh.size

    def start(self, columns: Columns) -> dict[str, jax.Array]:
        """Run some points; raises what the function raises on a device of this process."""
        mesh, chunk, most = self.layout
        size = len(next(iter(columns.values())))
        rounds = -(-size // self.capacity(1))
        spread = NamedSharding(mesh, POINTS)

        def buffer(column: np.ndarray) -> jax.Array:
            full = np.full((mesh.size, most * chunk), column[0], number_type())
            padded = np.concatenate([column, np.full(self.capacity(rounds) - size, column[0])])
            full[:, : rounds * chunk] = padded.reshape(mesh.size, -1)
            return jax.device_put(full.ravel(), spread)

        point = {name: buffer(column) for name, column in columns.items()}
        count = jax.device_put(np.array(rounds, np.int32), NamedSharding(mesh, ALL))
        return jax.block_until_ready(self.run(self.arrays, point, count))

    def collect(self, results: dict[str, jax.Array], size: int) -> dict[str, np.ndarray]:
        """The results of as many points as were given."""
        mesh, chunk, _ = self.layout
        rounds = -(-size // self.capacity(1))
        collected = {}
        for name, values in results.items():
            by_device = np.asarray(values).reshape(mesh.size, -1, *values.shape[1:])
            collected[name] = by_device[:, : rounds * chunk].reshape(-1, *values.shape[1:])[:size]
        return collected


def prepare(
    traced: Traced, count: int, asked: int | None, devices: object, lanes: int | None, *, quickly: bool = False
) -> Program:
    """Choose devices and chunk, and compile; a chunk that nobody asked for is made to fit into the memory.

    Of few points, and where `quickly` asks for it, the program is compiled with little optimisation.
    """
    mesh = Mesh(np.array(choose_devices(devices)), ("points",))
    fixed = asked is not None
    if asked is not None and asked < 1:
        _checks.refuse("chunk", "be one or more points", asked)
    wanted = asked or _side_by_side(traced, mesh, lanes)
    each = -(-count // mesh.size)  # points of a device; the next power of two, so that few programs are compiled
    chunk = min(wanted, each if fixed else 2 ** (each - 1).bit_length())
    free = free_memory(mesh)
    while True:
        program = with_chunk(traced, mesh, chunk, 1 if quickly or count <= FEW else None)
        if fixed or chunk == 1:
            return program
        size = program.run.memory_analysis()
        need = size.temp_size_in_bytes + size.output_size_in_bytes + size.argument_size_in_bytes if size else 0
        if need / free <= SHARE:
            return program
        chunk = 2 ** max(int(np.log2(chunk * SHARE * free / need)), 0)


def _side_by_side(traced: Traced, mesh: Mesh, lanes: int | None) -> int:
    """Points side by side that a device likes best, as far as memory allows."""
    if mesh.devices.flat[0].platform != "cpu":
        return ON_GPU
    lanes = lanes or ON_CPU
    if traced.mode is None:
        return lanes
    # tangents are lanes too, and what a core works on at a time must stay in its nearest cache; reverse derivatives
    # keep numbers of every instant beside it, of so few lanes that they stay in the last one
    share = lanes // (1 + len(traced.axes)) if traced.mode == "forward" else lanes // REVERSE
    return min(lanes, max(2 ** max(share.bit_length() - 1, 0), 8))


def with_chunk(traced: Traced, mesh: Mesh, chunk: int, level: Level = None) -> Program:
    """The program for a chunk, compiled at a level of optimisation."""
    each = sum(int(np.prod(r.shape)) * r.dtype.itemsize for r in traced.results.values())
    rounds = max(min(BUFFER_POINTS, BUFFER_BYTES // each) // chunk, 1)
    layout = Layout(mesh, chunk, rounds)
    arrays = [jax.device_put(array, NamedSharding(mesh, ALL)) for array in traced.arrays]
    spread, everywhere = NamedSharding(mesh, POINTS), NamedSharding(mesh, ALL)
    total = (mesh.size * rounds * chunk,)
    point = dict.fromkeys(traced.axes, jax.ShapeDtypeStruct(total, number_type(), sharding=spread))
    rounds_done = jax.ShapeDtypeStruct((), np.dtype(np.int32), sharding=everywhere)
    static = _Static(traced._replace(arrays=[], fingerprint=str), layout)
    options = options_of(level, mesh.devices.flat[0].platform)
    lowered = _jitted(static).lower(arrays, point, rounds_done)
    return Program(traced, layout, arrays, lowered.compile(options))  # pyright: ignore[reportArgumentType]


@final
class _Static:
    """What a program depends on apart from arrays, compared by what it computes."""

    def __init__(self, traced: Traced, layout: Layout) -> None:
        self.traced, self.layout = traced, layout
        results = tuple((name, r.shape, str(r.dtype)) for name, r in traced.results.items())
        self._key = (traced.static, traced.axes, results, traced.mode, layout)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Static) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


@functools.lru_cache(maxsize=16)
def _jitted(static: _Static) -> jax.stages.Wrapped:
    """The program before it is compiled. Kept, because JAX then keeps what it compiles."""
    traced, (mesh, chunk, rounds) = static.traced, static.layout

    def on_device(arrays: list[Array], point: dict[str, Array], count: Array) -> dict[str, Array]:
        rows = {name: column.reshape(rounds, chunk) for name, column in point.items()}

        def one_chunk(i: Array, results: dict[str, Array]) -> dict[str, Array]:
            lanes = {name: jax.lax.dynamic_index_in_dim(row, i, keepdims=False) for name, row in rows.items()}
            computed = evaluate(traced, arrays, lanes)
            return {
                name: jax.lax.dynamic_update_index_in_dim(results[name], computed[name], i, 0)
                for name in traced.results
            }

        empty = {name: jnp.zeros((rounds, chunk, *r.shape), r.dtype) for name, r in traced.results.items()}
        results = jax.lax.fori_loop(0, count, one_chunk, empty)
        return {name: values.reshape(-1, *values.shape[2:]) for name, values in results.items()}

    # what a function does inside says nothing about where it runs: its loops may start from the same value everywhere
    return jax.jit(jax.shard_map(on_device, mesh=mesh, in_specs=(ALL, POINTS, ALL), out_specs=POINTS, check_vma=False))


def forget_errors(mesh: Mesh) -> None:
    """Run a callback that does not raise: JAX keeps the last one of each device, and raises again when Python ends."""

    def unharmed(zero: Array) -> Array:
        return jax.pure_callback(np.asarray, jax.ShapeDtypeStruct(zero.shape, zero.dtype), zero)

    everywhere = jax.shard_map(unharmed, mesh=mesh, in_specs=POINTS, out_specs=POINTS, check_vma=False)
    zeros = jax.device_put(np.zeros(mesh.size, np.float32), NamedSharding(mesh, POINTS))
    jax.block_until_ready(jax.jit(everywhere)(zeros))


@contextmanager
def quiet() -> Iterator[None]:
    """What raises inside a program is counted and told at the end: JAX need not log each of them."""
    logger = logging.getLogger("jax._src.callback")
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before
