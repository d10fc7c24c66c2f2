"""Robust losses and priors of many dampers side by side, by the rounds of `criteria.solve_by`."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp.identify.criteria import HALF, LOSSES, ROUNDS, SETTLED, noise_factor
from jaxdamp.identify.dependence import Dependence
from jaxdamp.identify.lanes import Lanes
from jaxdamp.identify.noise import CORRELATED, correlation_time
from jaxdamp.identify.problem import ROUNDING
from jaxdamp.solve import SearchLanes


class Fitted(NamedTuple):
    """The ends of all dampers, one lane each, and the lanes with the weights of the last round."""

    lanes: Lanes  # with the final weights
    end: SearchLanes  # of each damper
    factor: Float[np.ndarray, " dampers"]  # on the noise that weighted residuals show, because of a robust loss
    share_left_out: Float[np.ndarray, " dampers"]  # of its samples, with less than half weight by a robust loss


def noise_level(weighted: list[np.ndarray], free: float | int) -> float:
    """Standard deviation of the weighted residual of a damper, larger where it is correlated."""
    size = sum(residual.size for residual in weighted)
    squares = sum(float(residual @ residual) for residual in weighted) / max(size - free, 1)
    alike = correlation_time(weighted)
    return float(np.sqrt(squares * (alike if alike > CORRELATED else 1.0)))


def by_rounds(
    plain: Lanes,
    end: SearchLanes,
    loss: str,
    solve: Callable[[Lanes, Float[np.ndarray, "lanes free"]], SearchLanes],
    depends: Dependence | None = None,
) -> Fitted:
    """Least squares again with new weights, until each damper moves no more; each ends by itself."""
    count, free = end.y.shape
    lanes, factor, share = plain, np.ones(count), np.zeros(count)
    roots, levels = [np.ones(np.shape(group.batch.weight)) for group in plain.groups], plain.levels()
    y, gram, status, steps = end.y.copy(), end.aux.copy(), list(end.status), end.steps.copy()
    still = np.isfinite(gram[:, -1, -1]) & (gram[:, -1, -1] > ROUNDING**2)
    for _ in range(ROUNDS if loss != "squares" or plain.priors is not None else 0):
        weighted, noise = lanes.residuals(y), np.ones(count)
        for i in np.flatnonzero(still):
            used = [_own(plain, int(i), group) for group in range(len(roots))]
            noise[i] = factor[i] * noise_level(
                [weighted[g][k][at] for g, own in enumerate(used) for k, at in own], free
            )
            raw = [weighted[g][k][at] / roots[g][k][at] for g, own in enumerate(used) for k, at in own]
            together = np.concatenate(raw)
            spread = 1.4826 * float(np.median(np.abs(together))) if loss != "squares" else 1.0
            still[i] = spread > 0
            if still[i]:
                weight = LOSSES[loss].weight(together / spread)
                factor[i], share[i] = noise_factor(LOSSES[loss], together / spread), np.mean(weight < HALF)
                _put(roots, used, np.sqrt(weight))
        moving = np.flatnonzero(still | (depends is not None))
        if not np.any(still):
            break
        priors = lanes.priors and lanes.priors._replace(noise=np.where(still, noise, lanes.priors.noise))
        groups = tuple(
            group._replace(batch=group.batch.reweighted(root.ravel()))
            for group, root in zip(plain.groups, roots, strict=True)
        )
        lanes = plain._replace(groups=groups, priors=priors)
        found = solve(lanes._replace(damper=moving), y[moving])
        length = np.sqrt(np.maximum(np.diagonal(found.aux, axis1=1, axis2=2)[:, :-1], 0.0))
        if depends is None:
            steps_made = np.abs(found.y - y[moving]) * length * levels[moving, None]
            settled = np.all(steps_made < SETTLED * noise[moving, None], axis=1)
        else:
            step = np.abs(depends.start(found.y) - depends.start(y)) * length[0]
            settled = np.full(count, np.all(step < SETTLED * np.mean(noise / levels)))
        y[moving], gram[moving] = found.y, found.aux
        steps[moving] += found.steps
        for i, own in zip(moving, found.status, strict=True):
            status[i] = own
        still[moving[settled]] = False
    return Fitted(lanes, SearchLanes(y, gram, status, steps), factor, share)


def _own(lanes: Lanes, damper: int, group: int) -> list[tuple[int, Bool[np.ndarray, " time"]]]:
    """The rows of a group that belong to a damper, with their samples that count."""
    batch, owner = lanes.groups[group].batch, lanes.groups[group].damper
    return [(int(k), np.asarray(batch.weight[k]) > 0) for k in np.flatnonzero(owner == damper)]


def _put(roots: list[np.ndarray], used: list[list[tuple[int, np.ndarray]]], values: np.ndarray) -> None:
    """Put values at the samples of a damper."""
    begin = 0
    for root, own in zip(roots, used, strict=True):
        for k, at in own:
            size = int(np.count_nonzero(at))
            root[k, at] = values[begin : begin + size]
            begin += size
