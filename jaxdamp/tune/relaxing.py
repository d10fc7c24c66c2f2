"""What the limits of a tuning cost: the cheapest relaxation for one percent, and the one that can be met."""

from collections.abc import Sequence

import numpy as np

from jaxdamp._tables import typeset_unit
from jaxdamp.tune.descending import Ended
from jaxdamp.tune.limits import Limit, LimitEnd, limit_ends
from jaxdamp.tune.result import V
from jaxdamp.tune.task import DesignTask


OUTWARDS = 1e-3  # of what the search reached, by which a relaxed limit is beyond it
SHARE = 0.01  # of the metric: the gain for which a relaxation is said


def relaxation(task: DesignTask[V], ended: Ended, limits: tuple[Sequence[Limit], Sequence[Limit]]) -> str:
    """Which limit, relaxed by how much, would give a tuning within the limits, or one that is 1 % better, in words.

    Where limits are not met: as far as the search came. At an optimum f within the limits, the Lagrange multiplier λ of
    a limit that holds it is its price −df/d(limit), and it must be relaxed by about 0.01 |f|/λ: said is the limit for
    which this is the smallest share of its scale. All places or scenarios of one limit are relaxed alike.

    Arguments:
        task: of the tuning.
        ended: where the search ended.
        limits: those of the task, and those of the search, which may be tighter.
    """
    ends, of = limit_ends(limits[0]), {limit.name: limit for limit in limits[0]}
    rows = ended.evaluation.rows
    over = [(row - end.sign * end.value) / end.scale for end, row in zip(ends, rows[1:], strict=True)]
    worst = {of[ends[i].name].of: i for i in np.argsort(over) if over[i] > task.tolerance.limit}
    if worst:
        reached = [(ends[i], ends[i].sign * rows[1 + i]) for i in worst.values()]
        moved = [_moved(of[end.name], end, to + end.sign * OUTWARDS * abs(to)) for end, to in reached]
        return f"Within reach: {' and '.join(moved)}."
    prices: dict[tuple[str, float], float] = {}
    for i, price in _prices(task, ended, limit_ends(limits[1])).items():
        limit, sign = of[ends[i].name], ends[i].sign
        if not limit.is_shape:
            prices[limit.of, sign] = prices.get((limit.of, sign), 0.0) + price * ends[i].scale
    dearest = max(prices, key=lambda key: prices[key], default=None)
    if dearest is None:
        return ""
    end = next(end for end in ends if (of[end.name].of, end.sign) == dearest)
    to = end.value + end.sign * end.scale * SHARE * abs(float(rows[0])) / prices[dearest]
    return f"Cheapest for 1 % less {task.objective.name}: {_moved(of[end.name], end, to)}."


def _prices(task: DesignTask[V], ended: Ended, ends: Sequence[LimitEnd]) -> dict[int, float]:
    """−df/d(limit) of each end of a limit that holds an optimum, by its number."""
    _, rows, slopes = ended.evaluation
    least, free = task.tolerance.limit, np.array([not side for side in task.space.side(ended.values)])
    free &= ~task.space.is_choice
    tight = [i for i, end in enumerate(ends) if abs(rows[1 + i] - end.sign * end.value) < least * end.scale]
    if not (tight and free.any() and ended.slope_left < task.tolerance.slope):
        return {}
    multipliers = -np.linalg.lstsq(slopes[1:][tight][:, free].T, slopes[0, free], rcond=None)[0]
    return {i: float(price) for i, price in zip(tight, multipliers, strict=True) if price > 0.0}


def _moved(limit: Limit, end: LimitEnd, to: float) -> str:
    """A limit with another end, in words."""
    sign = "≤" if end.sign > 0 else "≥"
    return f"{limit.name} {sign} {to:.4g} {typeset_unit(limit.unit)}".rstrip() + f" instead of {end.value:.4g}"
