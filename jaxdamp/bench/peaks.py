"""Where strokes have their largest velocity: a sine in its middle, a triangle all along."""

import numpy as np
from jaxtyping import Bool, Float


NEAR_PEAK = 0.98  # of the peak velocity, beyond which samples count as taken at the peak
CENTRAL = 0.1  # share of the stroke range that counts as mid-stroke
STEADY = 0.5  # the same, of strokes at constant velocity, clear of their turns
CONSTANT, MOST = 0.1, 0.7  # of the velocity at mid-stroke, within which most of the samples of such a stroke are

Cycles = Float[np.ndarray, "cycles points"]
Figures = Float[np.ndarray, " cycles"]


def at_peak(stroke: Cycles, directed: Cycles) -> Bool[np.ndarray, "cycles points"]:
    """The samples near the largest velocity of a direction, in which `directed` is positive.

    In strokes at constant velocity those of their central half: what is largest there is noise, and what a velocity
    estimated from the stroke makes of the turns.
    """
    highest = directed.max(axis=1, keepdims=True)
    near = (directed >= NEAR_PEAK * highest) & (highest > 0)
    constant = speed_is_constant(stroke, directed)[:, None]
    return np.where(constant, around_middle(stroke, STEADY) & (directed > 0), near)


def speed_is_constant(stroke: Cycles, directed: Cycles) -> Bool[np.ndarray, " cycles"]:
    """Whether the strokes in a direction have one velocity; a sine has nearly its largest in 0.3 of its time."""
    moving = directed > 0
    level = mean_where(directed, moving & around_middle(stroke, CENTRAL))[:, None]
    near = moving & (np.abs(directed - level) <= CONSTANT * level)
    return near.sum(axis=1) > MOST * moving.sum(axis=1)


def around_middle(stroke: Cycles, share: float) -> Bool[np.ndarray, "cycles points"]:
    """The samples within a share of the stroke range around its middle."""
    highest, lowest = stroke.max(axis=1, keepdims=True), stroke.min(axis=1, keepdims=True)
    return np.abs(stroke - 0.5 * (highest + lowest)) <= 0.5 * share * (highest - lowest)


def mean_where(values: Cycles, where: Bool[np.ndarray, "cycles points"]) -> Figures:
    """Mean of each cycle over some of its samples; NaN where there is none."""
    count = where.sum(axis=1)
    sums = np.where(where, values, 0.0).sum(axis=1)
    return np.divide(sums, count, out=np.full(len(values), np.nan), where=count > 0)
