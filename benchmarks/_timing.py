"""What all benchmarks share: warm timing, the machine they ran on, a table."""

import platform
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import numpy as np


def first_and_warm(work: Callable[[], Any], repeats: int = 15) -> tuple[float, float]:
    """Seconds of the first call, which compiles, and the median of the following ones, results waited for."""
    samples = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        jax.block_until_ready(work())
        samples.append(time.perf_counter() - start)
    return samples[0], float(np.median(samples[1:]))


def machine() -> str:
    """Processor, cores and versions in one line."""
    cpu = platform.processor()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if "model name" in line]
        cpu = names[0] if names else cpu
    packages = ", ".join(f"{name} {version(name)}" for name in ("jax", "equinox", "diffrax", "optimistix"))
    devices = ", ".join(str(device) for device in jax.devices())
    return f"{cpu}; {devices}; Python {platform.python_version()}, {packages}"


def show(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table."""
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    print(title)
    print(machine())
    for row in [head, ["-" * w for w in widths], *rows]:
        print(
            "  ".join(
                cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True))
            )
        )
