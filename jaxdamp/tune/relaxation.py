"""What a limit costs at the optimum, and as far as a search came where limits are not met, in words."""

from collections.abc import Sequence

import numpy as np

from jaxdamp.tune.descending import Ended, held_by
from jaxdamp.tune.limits import Limit, LimitEnd, end_moved, limit_ends
from jaxdamp.tune.task import DesignTask
from jaxdamp.vehicles import AbstractVehicle


OUTWARDS = 1e-3  # of what the search reached, by which a relaxed limit is beyond it
SHARE = 0.01  # of the metric: the gain for which a relaxation is said
FAR = 0.1  # of a limit, up to which its price at the optimum is taken to hold


def relaxation(task: DesignTask[AbstractVehicle], ended: Ended, limits: tuple[Sequence[Limit], Sequence[Limit]]) -> str:
    """Which limit, relaxed by how much, would give a tuning within the limits, or one that is 1 % better, in words.

    Where limits are not met: as far as the search came. At an optimum f within the limits, the Lagrange multiplier λ of
    a limit that holds it is its price −df/d(limit), and it must be relaxed by about 0.01 |f|/λ: said is the limit for
    which this is the smallest share of its scale, if it is near. All places or scenarios are relaxed alike.
    """
    ends, of = limit_ends(limits[0]), {limit.name: limit for limit in limits[0]}
    rows = ended.evaluation.rows[len(task.followed) :]
    over = [(row - end.sign * end.value) / end.scale for end, row in zip(ends, rows, strict=True)]
    worst = {of[ends[i].name].of: i for i in np.argsort(over) if over[i] > task.tolerance.limit}
    if worst:
        return _within_reach([(of[ends[i].name], ends[i], float(rows[i])) for i in worst.values()])
    prices: dict[tuple[str, float], list[tuple[float, int]]] = {}
    for i, price in _prices(task, ended, limit_ends(limits[1])).items():
        limit, end = of[ends[i].name], ends[i]
        if not limit.is_shape:
            prices.setdefault((limit.of, end.sign), []).append((price * end.scale, i))
    totals = {limit: sum(price for price, _ in each) for limit, each in prices.items()}
    if not totals:
        return ""
    dearest = max(totals, key=totals.__getitem__)
    end = ends[max(prices[dearest])[1]]
    by = end.scale * SHARE * abs(task.metric(ended.evaluation)) / totals[dearest]
    if by > FAR * abs(end.value):  # where there may be no such optimum
        return ""
    to = end.value + end.sign * by
    alike = ", and all others of this limit alike" * (len({e.name for e in ends if of[e.name].of == dearest[0]}) > 1)
    return f"Cheapest for 1 % less {task.objective.name}: {end_moved(of[end.name], end, to)}{alike}."


def _within_reach(reached: Sequence[tuple[Limit, LimitEnd, float]]) -> str:
    """The limits as far as the search came, by the rows that it reached."""
    ends = [(limit, end, end.sign * row) for limit, end, row in reached]
    moved = [end_moved(limit, end, to + end.sign * OUTWARDS * abs(to)) for limit, end, to in ends]
    return f"Within reach: {' and '.join(moved)}."


def _prices(task: DesignTask[AbstractVehicle], ended: Ended, ends: Sequence[LimitEnd]) -> dict[int, float]:
    """−df/d(limit) of each end of a limit that holds an optimum, by its number."""
    count, rows = len(task.followed), ended.evaluation.rows
    least, free = task.tolerance.limit, np.array([not side for side in task.space.side(ended.values)])
    free &= ~(task.space.is_choice | task.space.is_held)
    tight = [i for i, end in enumerate(ends) if abs(rows[count + i] - end.sign * end.value) < least * end.scale]
    if not (tight and free.any() and ended.slope_left() < task.tolerance.slope):
        return {}
    _, multipliers = held_by(task, ended.evaluation, tight, free)
    return {i: float(price) for i, price in zip(tight, multipliers, strict=True) if price > 0.0}
