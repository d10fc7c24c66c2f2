"""The devices of a sweep, and the memory that they have left."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh

from jaxdamp import _checks
from jaxdamp.sweeps import processes


def choose_devices(devices: Any) -> list[Any]:
    """The devices to use: all, so many of each process, or those given."""
    if devices is None:
        return jax.devices() if processes.several() else jax.local_devices()
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
    everywhere = jax.devices() if processes.several() else jax.local_devices()
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
