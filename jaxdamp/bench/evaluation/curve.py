"""The force-velocity curve of a damper at one setting: forces at stated velocities, rates, knee."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.bench.analysis import FoldedCycles
from jaxdamp.bench.evaluation.measurements import Measurement, measured
from jaxdamp.bench.evaluation.separation import LOW_SPEED, LOWEST_SHARE


OEM_VELOCITIES = (0.052, 0.131, 0.262, 0.393, 0.524, 1.047)  # m/s, common in damper specifications
METHODS = ("interpolation", "window", "loop")
DIRECTIONS = {"rebound": 1.0, "compression": -1.0}
_KNEES = 40  # candidates of the search, twice
_BEND = 0.1  # relative difference of two rates from which there is a knee
_EXPLAINS = 0.5  # of the straight line's residual that the knee must take away

Cycle = Float[np.ndarray, " points"]


class PeakForce(NamedTuple):
    """Force of one record at the peak velocity of one direction."""

    velocity: float  # m/s, positive
    force: float  # N
    scatter: float | None  # N


def interpolated(points: Sequence[PeakForce], velocity: float) -> tuple[float, float | None, int]:
    """Force on the straight line between the records whose peak velocities enclose a velocity; NaN beyond them."""
    points = sorted(points)
    velocities = np.array([point.velocity for point in points])
    after = int(np.searchsorted(velocities, velocity))
    if after < len(points) and np.isclose(velocities[after], velocity, rtol=1e-9):
        point = points[after]
        return point.force, point.scatter, 1
    if not 0 < after < len(points):
        return float("nan"), None, 0
    one, two = points[after - 1], points[after]
    share = (velocity - one.velocity) / (two.velocity - one.velocity)
    have_scatter = one.scatter is not None and two.scatter is not None
    scatter = (
        float(np.hypot((1 - share) * (one.scatter or 0.0), share * (two.scatter or 0.0))) if have_scatter else None
    )
    return (1 - share) * one.force + share * two.force, scatter, 2


def in_window(points: Sequence[PeakForce], velocity: float, window: float) -> tuple[float, float | None, int]:
    """Mean force of the records whose peak velocity is within a share of a velocity; NaN without one.

    The scatter is that over the records, or over the cycles of a single one.
    """
    inside = [point for point in points if abs(point.velocity / velocity - 1.0) <= window]
    value, scatter, count = measured(np.array([point.force for point in inside]))
    return value, inside[0].scatter if count == 1 else scatter, count


def on_loop(cycles: FoldedCycles, sign: float, velocity: float, window: float) -> tuple[float, float | None, int]:
    """Force at a velocity on the continuous loop, mean of its accelerating and its decelerating branch.

    Each branch is fitted by a straight line over the velocities within a share of the stated one. NaN where the
    record does not reach it.
    """
    directed = sign * cycles.velocity
    branches = np.gradient(directed, axis=1) > 0
    forces = [
        0.5 * sum(_force_at(v[branch], f[branch], velocity, window) for branch in (accelerating, ~accelerating))
        for v, f, accelerating in zip(directed, cycles.force, branches, strict=True)
    ]
    return measured(np.array(forces))


def _force_at(velocity: Cycle, force: Cycle, at: float, window: float) -> float:
    """Force at a velocity on one branch."""
    near = np.abs(velocity - at) <= window * at
    if near.sum() >= 3 and velocity[near].min() < at < velocity[near].max():
        offset = velocity[near] - at
        slope = np.dot(offset - offset.mean(), force[near]) / np.dot(offset - offset.mean(), offset)
        return float(force[near].mean() - slope * offset.mean())
    order = np.argsort(velocity)
    return float(np.interp(at, velocity[order], force[order], left=np.nan, right=np.nan)) if len(order) else np.nan


def rates_and_knees(cycles: FoldedCycles, setting: str, record: str) -> list[Measurement]:
    """Low- and high-speed rate and knee velocity of both directions, of the loop of the fastest record.

    F = F₀ + c_low min(|v|, v_k) + c_high max(|v| - v_k, 0) + k x by least squares in every cycle, from
    0.015 m/s on, where friction is fully there. A knee exists where both rates differ by more than a tenth and it
    takes away more than half of what a straight line leaves; otherwise there is one rate, and no knee.
    """
    measurements = []
    for name, sign in DIRECTIONS.items():
        rows = np.array(
            [_bend(*cycle, sign) for cycle in zip(cycles.stroke, cycles.velocity, cycles.force, strict=True)]
        )
        quantities = (f"{name} rate", f"{name} low-speed rate", f"{name} high-speed rate", f"{name} knee velocity")
        for quantity, column in zip(quantities, rows.T, strict=True):
            if np.isfinite(column).mean() >= 0.5:
                unit = "m/s" if quantity.endswith("velocity") else "N s/m"
                measurements.append(Measurement(quantity, unit, *measured(column), setting=setting, record=record))
    return measurements


def _bend(stroke: Cycle, velocity: Cycle, force: Cycle, sign: float) -> tuple[float, float, float, float]:
    """One rate, or low-speed rate, high-speed rate and knee velocity, of one direction of one cycle; NaN for others."""
    use = sign * velocity > LOWEST_SHARE * LOW_SPEED
    v, f, x = sign * velocity[use], sign * force[use], stroke[use] - stroke.mean()
    nothing = float("nan")
    if use.sum() < 8:
        return nothing, nothing, nothing, nothing
    straight, left = _solve(np.stack([np.ones(len(v)), x, v])[None], f)
    low, high = np.quantile(v, [0.1, 0.9])
    knees = np.linspace(low, high, _KNEES)
    near = int(np.argmin(_with_knees(v, x, f, knees)[1]))
    knees = np.linspace(knees[max(near - 1, 0)], knees[min(near + 1, _KNEES - 1)], _KNEES)
    bent, squares = _with_knees(v, x, f, knees)
    best = int(np.argmin(squares))
    low_rate, high_rate = bent[best, 2:].tolist()
    bends = abs(low_rate - high_rate) > _BEND * max(abs(low_rate), abs(high_rate))
    if bends and squares[best] < (1 - _EXPLAINS) * left[0]:
        return nothing, low_rate, high_rate, float(knees[best])
    return float(straight[0, 2]), nothing, nothing, nothing


def _with_knees(v: Cycle, x: Cycle, force: Cycle, knees: Float[np.ndarray, " knees"]) -> tuple[np.ndarray, np.ndarray]:
    """Least squares with two rates for each of several knee velocities: F₀, k, c_low, c_high and the squares left."""
    ramps = [np.broadcast_to(c, (len(knees), len(v))) for c in (np.ones(len(v)), x)]
    bent = [np.minimum(v, knees[:, None]), np.maximum(v - knees[:, None], 0.0)]
    return _solve(np.stack([*ramps, *bent], axis=1), force)


def _solve(rows: Float[np.ndarray, "knees terms points"], force: Cycle) -> tuple[np.ndarray, np.ndarray]:
    """Least squares for many sets of terms, and the squares that each leaves.

    By normal equations of terms of one size, and their eigenvalues: far less work than a pseudo-inverse of the terms.
    """
    gram = rows @ rows.transpose(0, 2, 1)
    sizes = np.sqrt(np.einsum("ktt->kt", gram))
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    values, vectors = np.linalg.eigh(gram / (sizes[:, :, None] * sizes[:, None, :]))
    seen = values > 1e-12 * values[:, -1:]
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=seen)
    along = np.matmul(vectors.transpose(0, 2, 1), (rows @ force / sizes)[..., None])[..., 0]
    solutions = np.matmul(vectors, (inverse * along)[..., None])[..., 0] / sizes
    left = np.matmul(solutions[:, None, :], rows)[:, 0] - force
    return solutions, np.einsum("kp,kp->k", left, left)
