"""Searches of a front where a peak or another kink stops smooth models: descent by sampled gradients."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from jaxdamp.tune.side_by_side import PENALTY, SHARE, BatchEvaluator, Computed, Lane, Scaling
from jaxdamp.tune.task import DesignTask


RADII = (3e-2, 1e-2, 3e-3, 1e-3)  # around each design within which gradients are sampled, relative to its start
TRIES = 4  # steps at each radius
LENGTHS = (0.3, 1.0, 3.0, 10.0)  # of the steps tried, in radii
FLAT = 1e-2  # slope of an optimum: the range of an objective per 100 % of the parameters


def has_kinks(task: DesignTask) -> bool:
    """Whether an objective or a limit is the largest or smallest value over time."""
    by_name = {metric.name: metric for metric in task.objective.metrics}
    followed = [by_name[name] for name in (*task.objective.names, *task.allowed) if name in by_name]
    kinked = ("largest", "smallest")
    return any(term.reduction.value in kinked for metric in followed for term in metric.statistic.terms)


def descend(lanes: Sequence[Lane], evaluator: BatchEvaluator, scaling: Scaling) -> None:
    """Move searches along the shortest convex combination of gradients sampled around them, until it is nearly zero.

    A search ends `converged` if it is so within the smallest radius. Source: as of `searching`, Burke et al. (2005).
    """
    space, random = evaluator.task.space, np.random.default_rng(0)
    free = len(lanes[0].at)
    lower, upper = space.lower / space.unit, space.upper / space.unit
    for radius in RADII:
        todo = list(lanes)
        for attempt in range(TRIES + 1):
            spread = [radius * random.uniform(-1.0, 1.0, (2 * free + 2, free)) for _ in todo]
            around = [np.clip(lane.at + near, lower, upper) for lane, near in zip(todo, spread, strict=True)]
            computed = evaluator.at(np.concatenate(around))
            steps = []
            for i, lane in enumerate(todo):
                near = [lane.now, *computed[i * len(spread[0]) : (i + 1) * len(spread[0])]]
                downhill = _downhill([_slope(c, lane, scaling) for c in near], lane.at, lower, upper)
                lane.converged, lane.open = bool(np.linalg.norm(downhill) < FLAT), False
                if not lane.converged:
                    steps.append((lane, downhill / np.linalg.norm(downhill)))
            if not steps or attempt == TRIES:
                break
            todo = _moved(steps, radius, evaluator, scaling)
            if not todo:
                break


def _slope(computed: Computed, lane: Lane, scaling: Scaling) -> Float[np.ndarray, " free"]:
    """A gradient of the merit: of the objective farthest beyond its aim, and of the most violated limit."""
    level, count = scaling.of(computed.rows), scaling.objectives
    slopes = computed.slopes / scaling.unit[:, None]
    slope = slopes[int(np.argmax(level[:count] - lane.aim))] + SHARE * slopes[:count].sum(axis=0)
    if len(level) > count and level[count:].max() > 0.0:
        slope = slope + PENALTY * slopes[count + int(np.argmax(level[count:]))]
    return slope


def _downhill(
    slopes: Sequence[np.ndarray], at: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> Float[np.ndarray, " free"]:
    """The direction against the shortest convex combination of gradients, with bounds that hold the design."""
    import scipy.optimize

    sides = (at >= upper - 1e-9).astype(float) - (at <= lower + 1e-9)
    walls = [side * row for side, row in zip(sides, np.eye(len(at)), strict=True) if side]
    heavy = 1e3 * max(float(np.linalg.norm(slope)) for slope in slopes) + np.finfo(float).tiny
    columns = [np.append(slope, heavy) for slope in slopes] + [np.append(wall, 0.0) for wall in walls]
    matrix = np.stack(columns, axis=1)
    weights, _ = scipy.optimize.nnls(matrix, np.append(np.zeros(len(at)), heavy))
    return -(matrix[:-1] @ weights)


def _moved(
    steps: Sequence[tuple[Lane, np.ndarray]], radius: float, evaluator: BatchEvaluator, scaling: Scaling
) -> list[Lane]:
    """The searches that a step of one of the lengths makes better, moved."""
    space = evaluator.task.space
    lower, upper = space.lower / space.unit, space.upper / space.unit
    rows, gaps = space.coordinates.order()
    tried = [
        (lane, np.clip(lane.at + length * radius * way, lower, upper)) for lane, way in steps for length in LENGTHS
    ]
    tried = [(lane, at) for lane, at in tried if np.all(rows @ at >= gaps)]
    if not tried:
        return []
    moved: dict[int, Lane] = {}
    for (lane, at), computed in zip(tried, evaluator.at(np.stack([at for _, at in tried])), strict=True):
        gain = scaling.merit(lane.now.rows, lane.aim) - scaling.merit(computed.rows, lane.aim)
        if np.all(np.isfinite(computed.slopes)) and gain > evaluator.improvement:
            lane.at, lane.now, moved[id(lane)] = at, computed, lane
    return list(moved.values())
