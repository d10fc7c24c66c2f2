"""The devices that a sweep runs on, and their memory."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
from jax.sharding import Mesh

from jaxdamp import _checks


def choose_devices(devices: object) -> list[Any]:
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
