"""The gradient that needs no derivatives: central differences of a kernel in C."""

from collections.abc import Callable

import numpy as np

from benchmarks.peers import c
from benchmarks.peers.problem import Heights, Parameters, Results


def gradient(
    case: str,
    parameters: Parameters,
    road: Heights,
    dt: float = 1e-3,
    *,
    step: float = 1e-5,
    threads: int = 1,
    kernel: Callable[..., Results] = c.rk4,
) -> Parameters:
    """Gradients of the RMS in the parameters of each car, of the same shape; `step` is relative to a parameter."""
    table = np.asarray(parameters, dtype=np.float64)
    cars, count = table.shape
    sizes = step * np.abs(table)
    shifts = sizes[:, None, :] * np.eye(count)
    moved = np.stack([table[:, None, :] + shifts, table[:, None, :] - shifts])
    rows = moved.reshape(-1, count)
    lanes = next((few for few in (8, 16) if len(rows) <= few), 32)  # no block larger than needed
    found = kernel(case, rows, road, dt, threads=threads, lanes=lanes).reshape(2, cars, count)
    return (found[0] - found[1]) / (2.0 * sizes)
