"""The first part of long records, on which starts are compared: the whole motion in a fraction of the samples."""

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp.identify.problem import Problem
from jaxdamp.identify.traces import signals


SHARE = 0.25  # of the samples of a record, at least
REACHED = 0.95  # of the range of stroke and velocity, which it covers
MOVING = 0.1  # of its largest velocity, at which its motion begins
MOST = 0.5  # share of all samples, above which it is not worthwhile
LEAST = 4000  # samples, below which a search is short anyway


def first_part(problem: Problem) -> Problem | None:
    """The problem on the first part of each record, or None where that is hardly shorter.

    What is left of a record weighs as much as the whole record, so that sums of squares and priors stay comparable.
    """
    used, factor = problem.used, np.ones(problem.used.size)
    stroke, velocity = signals(problem.residuals, "stroke", "velocity")
    for place in problem.places:
        factor[place] = _of_record(used[place], stroke[place], velocity[place])
    count, kept = np.count_nonzero(used), np.count_nonzero(used & (factor > 0))
    return problem.reweighted(factor) if count >= LEAST and kept <= MOST * count else None


def _of_record(
    used: Bool[np.ndarray, " time"], stroke: Float[np.ndarray, " time"], velocity: Float[np.ndarray, " time"]
) -> Float[np.ndarray, " time"]:
    """Factor on the weights: zero after the first part."""
    if not np.any(used):
        return np.ones(used.size)
    samples, moving = np.flatnonzero(used), used & (np.abs(velocity) > MOVING * np.abs(velocity[used]).max())
    rest = np.count_nonzero(samples < np.argmax(moving))
    last = samples[rest + int(SHARE * (samples.size - rest - 1))]
    for signal in (stroke, velocity):
        for way in (signal, -signal):
            low, high = way[used].min(), way[used].max()
            last = max(last, samples[np.argmax(way[used] >= low + REACHED * (high - low))])
    kept = np.arange(used.size) <= last
    return np.where(kept, np.sqrt(samples.size / np.count_nonzero(used & kept)), 0.0)
