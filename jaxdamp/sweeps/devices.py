"""The devices of one or of several processes: arrays go out to all of them and come back to each."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding

from jaxdamp import _checks


def several() -> bool:
    """Whether `jax.distributed` has joined processes."""
    return jax.process_count() > 1


def is_first() -> bool:
    """Whether this process writes files and shows progress."""
    return jax.process_index() == 0


def put(array: Any, sharding: NamedSharding) -> jax.Array:
    """An array, the same in every process, onto the devices."""
    if several() and not jnp.issubdtype(array.dtype, jax.dtypes.prng_key):
        array = np.asarray(array)
        return jax.make_array_from_callback(array.shape, sharding, lambda part: array[part])
    return jax.device_put(array, sharding)


def fetch(array: jax.Array) -> np.ndarray:
    """The whole array, in every process."""
    if several():
        from jax.experimental import multihost_utils

        return np.asarray(multihost_utils.process_allgather(array, tiled=True))
    return np.asarray(array)


def largest(*numbers: float | bool) -> np.ndarray:
    """The largest of what the processes say, for each number."""
    mine = np.asarray(numbers, np.float32)
    if several():
        from jax.experimental import multihost_utils

        return np.max(np.asarray(multihost_utils.process_allgather(mine)), axis=0)
    return mine


def of_first(tree: object) -> Any:
    """What the first process says."""
    if several():
        from jax.experimental import multihost_utils

        return jax.tree.map(np.array, multihost_utils.broadcast_one_to_all(tree))
    return tree


def text_of_first(text: str) -> str:
    """What the first process says, as a text."""
    if not several():
        return text
    size = int(largest(len(text.encode()))[0])  # arrays that are sent must be equally long everywhere
    padded = np.frombuffer(text.encode().ljust(size), np.uint8)
    return np.asarray(of_first(padded)).tobytes().decode().rstrip()


def choose_devices(devices: object) -> list[Any]:
    """The devices to use: all, so many of each process, or those given."""
    if devices is None:
        return jax.devices() if several() else jax.local_devices()
    if not isinstance(devices, int):
        if not isinstance(devices, Sequence) or not devices:
            _checks.refuse("devices", "be a number, or one or more of `jax.devices()`", devices)
        return list(devices)
    here = len(jax.local_devices())
    if not 1 <= devices <= here:
        remedy = (
            "A processor is one device unless `jaxdamp.configure(cpu_devices=...)` says otherwise, before anything "
            "is computed."
        )
        _checks.refuse("devices", f"be from 1 to {here}, the devices that JAX shows", devices, remedy)
    everywhere = jax.devices() if several() else jax.local_devices()
    by_process = {d.process_index: [e for e in everywhere if e.process_index == d.process_index] for d in everywhere}
    return [device for of_process in by_process.values() for device in of_process[:devices]]


def free_memory(mesh: Mesh) -> float:
    """Bytes that each device of this process could still take."""
    devices = [device for device in mesh.devices.flat if device.process_index == jax.process_index()]
    if not devices:
        return np.inf
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
