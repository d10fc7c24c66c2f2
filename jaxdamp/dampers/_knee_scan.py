"""Start values for laws that are linear in all parameters but one on each side, which is varied on a grid."""

from collections.abc import Callable

import numpy as np

from jaxdamp.dampers._guesses import binned_curve


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
