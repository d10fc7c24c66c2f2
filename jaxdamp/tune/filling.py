"""Further designs of a front, interpolated between its points."""

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np

from jaxdamp.tune.front import ParetoFront, non_dominated
from jaxdamp.tune.result import V
from jaxdamp.tune.tracing import lattice


def filled(
    front: ParetoFront[V], values_at: Callable[[np.ndarray], np.ndarray], order: Sequence[str], count: int
) -> ParetoFront[V]:
    """A front with designs between its points, as far as no other one beats them and they keep all limits.

    Arguments:
        front: with more points than objectives.
        values_at: metrics of designs, simulated.
        order: names of these metrics.
        count: number of designs to interpolate.
    """
    from scipy.interpolate import RBFInterpolator

    shares = front.shares
    flat = (shares - shares.mean(axis=1, keepdims=True))[:, :-1]  # the plane through the ends, seen along its normal
    ends = flat[np.argmin(shares, axis=0)]
    lower, upper = (np.array([getattr(p, side) for p in front.parameters]) for side in ("lower", "upper"))
    size = np.where(upper - lower < np.inf, upper - lower, 1.0)
    inside = RBFInterpolator(flat, front.designs / size, kernel="cubic")(np.array(lattice(len(ends), count)) @ ends)
    designs = np.clip(inside * size, lower, upper)
    table = values_at(designs)
    found = {name: table[:, order.index(name)] for name in front.values}
    owners = front.free.owners
    ordered = np.array([p.domain.ordered and p.path == q.path for p, q in itertools.pairwise(owners)], bool)
    allowed = np.all(np.isfinite(table), axis=1) & np.all(np.diff(designs, axis=1)[:, ordered] > 0.0, axis=1)
    for name, top in front.limits.items():
        allowed &= found[name] <= top
    designs = np.concatenate([front.designs, designs[allowed]])
    values = {name: np.concatenate([old, found[name][allowed]]) for name, old in front.values.items()}
    objectives = np.stack([values[name] for name in front.names], axis=1)
    best = np.flatnonzero(non_dominated(objectives))
    best = best[np.lexsort(objectives[best].T[::-1])]
    return dataclasses.replace(
        front, designs=designs[best], values={name: column[best] for name, column in values.items()}, interpolated=count
    )
