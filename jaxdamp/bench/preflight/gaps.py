"""Stretches in which a channel repeats one value although it should move."""

import numpy as np
from jaxtyping import Int

from jaxdamp.bench.motion import Samples, white_noise


SHARE = 0.3  # of the cycles: what is there more often is the damper's, such as friction that turns
_BY_CHANCE = 0.01  # expected number of such repetitions in the record, below which they are no chance
_CLEAR = 8.0  # standard deviations of the noise


def runs_of(mask: np.ndarray) -> Int[np.ndarray, "stretches 2"]:
    """First and last index of each stretch where a mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return np.stack([edges[::2], edges[1::2] - 1], axis=1)


def gaps(values: Samples, velocity: Samples, moving: slice, cycles: int) -> Int[np.ndarray, "stretches 2"]:
    """First and last sample of each stretch of equal values in the motion that is no chance and no clipping.

    Neighbours are equal by chance with a probability of q / (2 √π σ + |slope|), with the resolution q, the noise σ and
    the change per sample. Where that is near one, as in a coarse channel, a stretch counts that ends with a jump which
    only it makes.
    """
    at = runs_of(np.diff(values[moving]) == 0.0)
    at = at[(at[:, 0] > 0) & (at[:, 1] < len(values[moving]) - 3)]
    if not len(at):
        return at
    x, v = values[moving], velocity[moving]
    first, last = at[:, 0], at[:, 1] + 1
    resolution, noise, length = _resolution(x, int(np.sum(last - first)), len(at)), white_noise(x), last - first
    outside, into, out = x[last + 1] - x[first - 1], x[first] - x[first - 1], x[last + 1] - x[last]
    chance = resolution / np.maximum(2 * np.sqrt(np.pi) * noise + np.abs(outside) / (length + 2), resolution)
    lost = (len(x) * chance**length < _BY_CHANCE) & (np.abs(outside) > resolution) & (noise > 2.0 * resolution)
    edge = np.maximum(_CLEAR * np.sqrt(2.0) * noise, 4.0 * resolution)
    extreme = (x[first] == x.max()) | (x[first] == x.min())
    smooth = np.maximum(np.abs(into), np.abs(out)) < 2.0 * edge
    clipped = extreme & (smooth | (np.count_nonzero(extreme) > 2)) & (x[first] != 0.0)
    usual = np.abs(x[np.minimum(last + 2, len(x) - 1)] - x[last + 1])
    jumps = (length > 2) & (np.abs(out) > np.maximum(edge, 3.0 * usual))
    fastest = float(np.max(np.abs(v)))
    jumps &= np.abs(v[last] - v[first]) > 0.1 * fastest  # at constant velocity a force may well be constant
    if np.count_nonzero(jumps) > max(1, SHARE * cycles):
        jumps[:] = False
    return at[(lost | jumps) & ~clipped] + moving.start + np.array([0, 1])


def _resolution(values: Samples, still: int, stretches: int) -> float:
    """The step of the numbers as they were written: of their decimals, or of a converter; rounding of floats else.

    A converter shows by values that recur: of n values on m levels, about n² / 2m do. Those of the stretches of equal
    neighbours do not count.
    """
    some = values[:: max(len(values) // 2000, 1)]
    largest, decimals = float(np.max(np.abs(some))), 1e-15
    for digits in range(12):
        unit = 10.0 ** (np.ceil(np.log10(max(largest, 1e-300))) - digits)
        if np.all(np.abs(some / unit - np.round(some / unit)) < 1e-3):
            decimals = unit / largest
            break
    count, distinct = len(values), len(np.unique(values))
    recurring = max(count - distinct - still - stretches, 0)
    span = float(np.ptp(np.quantile(values, (0.01, 0.99))))
    levels = distinct if distinct < 0.7 * count else count**2 / (2.0 * max(recurring, 1e-3))
    coarse = span / levels if recurring > 3 else 0.0
    return max(float(decimals) * largest, coarse)
