"""What is remarked on many fits: dampers that differ from the others, numbers that the records do not determine."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp.identify.estimating import WEAK
from jaxdamp.parameters import FreeParameters, listed


LEAST_SPREAD = 0.02  # of the median: numbers that differ by less do not make a damper stand out
MOST = 0.5  # of the dampers, above which a number that they do not determine is no remark on one of them


def trend(values: np.ndarray, settings: tuple[float, ...] | None) -> np.ndarray:
    """The median, or with settings a line through the medians of slopes and levels (Theil and Sen)."""
    if settings is None or np.ptp(settings) == 0:
        return np.full(values.shape, np.median(values))
    x = np.array(settings)
    first, second = np.triu_indices(x.size, 1)
    apart = x[second] != x[first]
    slope = np.median((values[second] - values[first])[apart] / (x[second] - x[first])[apart])
    return slope * x + np.median(values - slope * x)


def robust_scores(values: np.ndarray, settings: tuple[float, ...] | None) -> np.ndarray:
    """Distances from the trend in deviations, as the median of distances gives them; zero for four dampers or fewer."""
    if values.size < 5:
        return np.zeros(values.shape)
    expected = trend(values, settings)
    spread = max(1.4826 * np.median(np.abs(values - expected)), LEAST_SPREAD * np.median(np.abs(values)))
    return (values - expected) / spread if spread > 0 else np.zeros(values.shape)


def undetermined(
    free: FreeParameters, values: Float[np.ndarray, "dampers free"], errors: Float[np.ndarray, "dampers free"]
) -> Bool[np.ndarray, "dampers free"]:
    """Which numbers the records of each damper do not determine, of those that are judged by their size.

    A number of either sign may be near zero, one on an end of its range is held there, and an ordered one is a place.
    """
    lower, upper = free.limits()
    ordered = np.array([p.domain.ordered for p in free.owners])
    by_size = ~((lower < 0) & (upper > 0)) & ~ordered
    inside = (values != lower) & (values != upper)
    return by_size & inside & ~(errors <= WEAK * np.abs(values))


def on_most(names: Sequence[str], weak: Bool[np.ndarray, "dampers free"]) -> list[str]:
    """A sentence on numbers that the records of most dampers do not determine."""
    counts = weak.sum(axis=0)
    often = [(name, count) for name, count in zip(names, counts, strict=True) if count > MOST * len(weak)]
    if not often:
        return []
    numbers = listed([f"{name} (in {count} of {len(weak)} dampers)" for name, count in often])
    remedy = "Freeze or share such numbers, or add records that excite them; `fit(name)` of one damper says more."
    return [f"The records do not determine {numbers}. {remedy}"]


def on_few(names: Sequence[str], weak: Bool[np.ndarray, "dampers free"]) -> list[str]:
    """For each damper, in words, the numbers that its records do not determine, but those of most others do."""
    few = weak.sum(axis=0) <= MOST * len(weak)
    return [
        f"its records do not determine {listed(np.array(names)[row].tolist())}" if row.any() else ""
        for row in weak & few
    ]
