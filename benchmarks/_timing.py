"""Common functions of the benchmarks: timing, description of the machine, table, file."""

import json
import os
import platform
import time
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import jax


RESULTS = Path(__file__).parent / "results"
PACKAGES = ("jax", "equinox", "diffrax", "optimistix", "scipy", "numba", "casadi")


def first_and_warm(work: Callable[[], Any], repeats: int = 9) -> tuple[float, float]:
    """Seconds of the first call, which compiles, and of the best following one, until the results are ready.

    The best, not the mean, because other work on the machine only adds time.
    """
    samples = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        jax.block_until_ready(work())
        samples.append(time.perf_counter() - start)
    return samples[0], min(samples[1:])


class Cost(NamedTuple):
    """Seconds of one piece of work."""

    wall: float
    processor: float  # on all cores, which other work on the machine changes less

    def times(self, share: float) -> "Cost":
        """That of a part of the work, or of a multiple."""
        return Cost(share * self.wall, share * self.processor)


def cost_of(work: Callable[[], Any], repeats: int = 1) -> tuple[Cost, Any]:
    """The least of several repeats, each clock for itself, and the last answer."""
    costs, answer = [], None
    for _ in range(repeats):
        wall, processor = time.perf_counter(), time.process_time()
        answer = work()
        costs.append((time.perf_counter() - wall, time.process_time() - processor))
    return Cost(*map(min, zip(*costs, strict=True))), answer


def best(work: Callable[[], Any], repeats: int = 3) -> float:
    """Seconds of the best call after a first one."""
    return first_and_warm(work, repeats)[1]


def machine() -> dict[str, Any]:
    """Processor and its widest vectors, cores, devices, load and versions."""
    cpu, vectors, info = platform.processor(), "unknown", Path("/proc/cpuinfo")
    if info.exists():
        text = info.read_text()
        names = [line.split(":", 1)[1].strip() for line in text.splitlines() if "model name" in line]
        cpu = names[0] if names else cpu
        vectors = next((name for name in ("avx512f", "avx2") if name in text), vectors)
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return {
        "cpu": cpu,
        "vectors": vectors,
        "cores": os.cpu_count(),
        "devices": [str(device) for device in jax.devices()],
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "python": platform.python_version(),
        **found,
    }


def report(question: str, title: str, head: Sequence[str], rows: Sequence[Sequence[Any]], digits: int = 3) -> None:
    """Print a table and write it, with the machine, as `results/QUESTION.json`."""
    on = machine()
    texts = [[_text(cell, digits) for cell in row] for row in rows]
    widths = [max(len(row[i]) for row in [head, *texts]) for i in range(len(head))]
    print(f"\n{title}")
    print(", ".join(f"{name} {value}" for name, value in on.items() if value != "not installed"))
    for row in [head, ["-" * w for w in widths], *texts]:
        cells = enumerate(zip(row, widths, strict=True))
        print("  ".join(cell.rjust(w) if i else cell.ljust(w) for i, (cell, w) in cells), flush=True)
    RESULTS.mkdir(exist_ok=True)
    content = {"title": title, "machine": on, "columns": list(head), "rows": [list(row) for row in rows]}
    (RESULTS / f"{question}.json").write_text(json.dumps(content, indent=1) + "\n")


def _text(cell: Any, digits: int) -> str:
    return f"{cell:.{digits}g}" if isinstance(cell, float) else str(cell)
