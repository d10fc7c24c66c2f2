"""Filters of NumPy and LAPACK for what every record needs: `scipy.signal` takes half a second to import."""

import math

import numpy as np
from jaxtyping import Float


Samples = Float[np.ndarray, " time"]


def smoothing_weights(window: int, order: int, derivative: int = 0, step: float = 1.0) -> Float[np.ndarray, " window"]:
    """Weights of the samples of a window, whose sum is the polynomial through them, or a derivative, in its middle.

    Savitzky and Golay, Analytical Chemistry 36 (1964); `scipy.signal.savgol_coeffs(..., use="dot")`.

    Arguments:
        window: number of samples, odd.
        order: of the polynomial.
        derivative: which one.
        step: between the samples.
    """
    from scipy.linalg import lstsq

    half = window // 2
    powers = np.arange(half, -half - 1.0, -1.0) ** np.arange(order + 1.0)[:, None]
    wanted = np.zeros(order + 1)
    wanted[derivative] = math.factorial(derivative) / step**derivative
    return lstsq(powers, wanted)[0][::-1]  # pyright: ignore[reportOptionalSubscript]


def smoothed(values: Samples, window: int, order: int, derivative: int = 0, step: float = 1.0) -> Samples:
    """Polynomials through the samples of a window around each, or a derivative; at the ends, those of the last windows.

    `scipy.signal.savgol_filter`.

    Arguments:
        values: at uniform instants.
        window: number of samples, odd, at most all.
        order: of the polynomials.
        derivative: which one.
        step: between the instants.
    """
    from scipy.ndimage import correlate1d

    half, places = window // 2, np.arange(0.0, window)
    whole = correlate1d(values, smoothing_weights(window, order, derivative, step), mode="constant")
    ends = []
    for part, wanted in ((values[:window], places[:half]), (values[-window:], places[half + 1 :])):
        curve = np.polyder(np.polyfit(places, part, order), derivative)
        ends.append(np.polyval(curve, wanted) / step**derivative)
    return np.concatenate([ends[0], whole[half : whole.size - half], ends[1]])


def decaying(values: Float[np.ndarray, "time ..."], decay: float) -> Float[np.ndarray, "time ..."]:
    """Y of y[n] = decay y[n − 1] + values[n], which begins at values[0], for a decay from 0 to 1."""
    from scipy.linalg import solve_banded

    bands = np.stack([np.ones(len(values)), np.full(len(values), -decay)])
    return solve_banded((1, 0), bands, values, check_finite=False)


def spline(values: Samples, places: Samples) -> Samples:
    """A cubic spline through values at 0, 1, 2, ..., whose ends are no knots, at places between; four values or more.

    `scipy.interpolate.CubicSpline`.
    """
    from scipy.linalg import solve_banded

    rises = np.diff(values)
    bands = np.empty((3, len(values)))
    bands[0], bands[1], bands[2] = 1.0, 4.0, 1.0
    bands[1, 0] = bands[1, -1] = 1.0
    bands[0, 1] = bands[2, -2] = 2.0
    right = np.empty(len(values))
    right[1:-1] = 3.0 * (rises[1:] + rises[:-1])
    right[0], right[-1] = 0.5 * (5.0 * rises[0] + rises[1]), 0.5 * (5.0 * rises[-1] + rises[-2])
    slopes = solve_banded((1, 1), bands, right, check_finite=False)
    before = np.clip(places.astype(int), 0, len(values) - 2)
    s = places - before
    bend = slopes[:-1] + slopes[1:] - 2.0 * rises
    third, second = bend[before], (rises - slopes[:-1] - bend)[before]
    return values[before] + s * (slopes[before] + s * (second + s * third))
