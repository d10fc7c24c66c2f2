"""Start values from measured force and velocity."""

from collections.abc import Callable

import numpy as np


def binned_curve(velocity: np.ndarray, force: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean velocity and mean force in each bin with data; hysteresis averages out over whole cycles."""
    velocity, force = np.asarray(velocity), np.asarray(force)
    place = np.digitize(velocity, edges)
    filled = [k for k in range(1, len(edges)) if np.any(place == k)]
    return (
        np.array([velocity[place == k].mean() for k in filled]),
        np.array([force[place == k].mean() for k in filled]),
    )


def velocity_grid(velocity: np.ndarray, points_a_side: int) -> np.ndarray:
    """Velocities from the lowest to the highest in the data, through zero, finer towards zero where valves open."""
    share = (np.arange(points_a_side + 1) / points_a_side) ** 2
    low, high = min(np.min(velocity), -1e-6), max(np.max(velocity), 1e-6)
    return np.concatenate([low * share[:0:-1], high * share])


def secant_rate(velocity: np.ndarray, force: np.ndarray, side: int, low: float = 0.0, high: float = 1.0) -> float:
    """Least-squares slope through the origin, for |v| between two fractions of the peak, on one side (+1 rebound)."""
    velocity, force = np.asarray(velocity), np.asarray(force)
    v, f = side * velocity, side * force
    peak = max(float(v.max()), 1e-9)
    use = (v > low * peak) & (v <= high * peak)
    if not use.any():
        use = v > 0
    if not use.any():
        return max(float(np.vdot(velocity, force) / max(np.vdot(velocity, velocity), 1e-12)), 1.0)
    return max(float(np.vdot(v[use], f[use]) / np.vdot(v[use], v[use])), 1.0)


ELASTIC_TRAVEL = 5e-4  # m, elastic deflection of seals and guides before sliding


def sliding_fit(velocity: np.ndarray, force: np.ndarray) -> tuple[float, float, float]:
    """C [N s/m], F_c [N] and f₀ [N] of F ≈ c v + F_c sgn v + f₀ at higher velocities, in sliding."""
    velocity, force = np.asarray(velocity), np.asarray(force)
    fast = np.abs(velocity) >= 0.5 * np.max(np.abs(velocity))
    velocity, force = velocity[fast], force[fast]
    columns = np.stack([velocity, np.sign(velocity), np.ones_like(velocity)], axis=1)
    rate, level, offset = (float(a) for a in np.linalg.lstsq(columns, force, rcond=None)[0])
    least = 0.02 * max(float(np.max(np.abs(force - offset))), 1e-3)
    return max(rate, 1.0), max(level, least), offset


def knee_scan(
    velocity: np.ndarray,
    force: np.ndarray,
    side: int,
    columns: Callable[[np.ndarray, float], list[np.ndarray]],
    shares: np.ndarray,
) -> tuple[float, np.ndarray]:
    """The knee velocity [m/s] and the coefficients ≥ 0 that fit the mean curve of one side best.

    Arguments:
        velocity: measured velocity [m/s].
        force: measured force [N].
        side: +1 rebound, −1 compression; a side without data uses that of the other.
        columns: the factors of the coefficients in |F|, for |v| and a knee.
        shares: knees to try, as fractions of the peak velocity.
    """
    from scipy.optimize import nnls  # a slow import, needed only here

    v, f = side * np.asarray(velocity, dtype=float), side * np.asarray(force, dtype=float)
    if not np.any(v > 0):
        v, f = -v, -f
    if not np.any(v > 0):
        v, f = np.ones(1), np.ones(1)
    peak = float(v.max())
    # bins of equal width in √v, since knees are at low velocities, where a sine has few samples
    edges = peak * np.linspace(0.0, 1.0, 41) ** 2
    edges[-1] *= 1.0 + 1e-9
    v, f = binned_curve(v, f, edges)
    best = (np.inf, peak, np.ones(1))
    for knee in peak * shares:
        matrix = np.stack(columns(v, knee), axis=1)
        coefficients, error = nnls(matrix, f)
        if error < best[0]:
            best = (error, float(knee), coefficients)
    return best[1], best[2]
