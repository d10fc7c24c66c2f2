"""Start values from measured force and velocity."""

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
