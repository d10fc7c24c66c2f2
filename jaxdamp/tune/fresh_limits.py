"""What fresh roads say of limits: by how much they are broken, and whether further roads would change anything."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from jaxdamp.tune.limits import LimitRange, in_scenarios


if TYPE_CHECKING:
    from jaxdamp.tune.rescoring import Rescore


WITHIN = 0.01  # relative excess over a limit on fresh roads up to which it counts as met


def in_each(allowed: Mapping[str, LimitRange], scenarios: Sequence[str]) -> dict[str, LimitRange]:
    """The ranges of limited metrics in every scenario, by the names of their values there."""
    return {one: span for name, span in allowed.items() for one in in_scenarios(name, scenarios)}


def lost_limits(fresh: "Rescore | None", allowed: Mapping[str, LimitRange]) -> dict[str, float]:
    """The mean excess over limits that are broken on average over fresh roads, by more than the error of this mean.

    Arguments:
        fresh: the vehicle before and after on these roads.
        allowed: the range of each limited metric, in every scenario (`in_each`).
    """
    if fresh is None or fresh.roads < 2:
        return {}
    over = {name: excess(fresh, name, limit) for name, limit in allowed.items()}
    return {name: float(np.mean(x)) for name, x in over.items() if np.mean(x) - half_interval(x) > WITHIN}


def excess(fresh: "Rescore", name: str, allowed: LimitRange) -> Float[np.ndarray, " roads"]:
    """Excess over a limit on each fresh road, relative to it, negative inside."""
    over = []
    for before, after in zip(fresh.before[name], fresh.after[name], strict=True):
        lower, upper = allowed.at(float(before))
        size = max(abs(end) for end in (lower, upper) if np.isfinite(end)) or 1.0
        over.append(max(after - upper, lower - after) / size)
    return np.array(over)


def half_interval(values: Float[np.ndarray, " roads"], level: float = 0.95) -> float:
    """Half the interval of the mean of independent values, by Student's distribution; infinite for one value.

    Arguments:
        values: one for each road.
        level: of the interval.
    """
    from scipy.special import stdtrit

    if len(values) < 2:
        return np.inf
    return float(stdtrit(len(values) - 1, 0.5 + 0.5 * level) * np.std(values, ddof=1) / np.sqrt(len(values)))


def decided(fresh: "Rescore", allowed: Mapping[str, LimitRange]) -> bool:
    """Whether further roads would change nothing: the sign of the gain and every limit are certain, or the error small.

    It is asked again as roads are added, hence at 99 %.
    """
    offsets = [fresh.change(fresh.metric), *(excess(fresh, name, limit) - WITHIN for name, limit in allowed.items())]
    halves = [half_interval(offset, 0.99) for offset in offsets]
    return all(abs(np.mean(offset)) > half or half < WITHIN for offset, half in zip(offsets, halves, strict=True))
