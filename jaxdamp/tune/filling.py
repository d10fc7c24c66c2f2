"""Further designs of a front, interpolated between its points."""

import itertools
from collections.abc import Sequence

import numpy as np

from jaxdamp.tune.front import non_dominated, shares_of
from jaxdamp.tune.limits import Limit, limit_ends, margins
from jaxdamp.tune.side_by_side import BatchEvaluator
from jaxdamp.tune.tracing import lattice


def with_designs_between(
    evaluator: BatchEvaluator,
    designs: np.ndarray,
    numbers: dict[str, np.ndarray],
    limits: Sequence[Limit],
    count: int,
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The designs of a front with others between them, as far as no other one beats them and they keep all limits.

    Arguments:
        evaluator: simulates the designs.
        designs: of the front, more than objectives.
        numbers: of these designs, by name.
        limits: of numbers.
        count: number of designs to interpolate.
    """
    from scipy.interpolate import RBFInterpolator

    space, names = evaluator.task.space, evaluator.task.objective.names
    shares = shares_of(np.stack([numbers[name] for name in names], axis=1))
    flat = (shares - shares.mean(axis=1, keepdims=True))[:, :-1]  # the plane through the ends, seen along its normal
    ends = flat[np.argmin(shares, axis=0)]
    size = np.where(space.upper - space.lower < np.inf, space.upper - space.lower, 1.0)
    inside = RBFInterpolator(flat, designs / size, kernel="cubic")(np.array(lattice(len(ends), count)) @ ends)
    new = np.clip(inside * size, space.lower, space.upper)
    of_new = evaluator.numbers_at(new, evaluator.ride)
    ordered = np.array([p.domain.ordered and p.path == q.path for p, q in itertools.pairwise(space.free.owners)], bool)
    allowed = np.all(np.isfinite(list(of_new.values())), axis=0) & np.all(
        np.diff(new, axis=1)[:, ordered] > 0.0, axis=1
    )
    allowed &= np.all(margins(limit_ends(limits), of_new) >= 0.0, axis=0)
    designs = np.concatenate([designs, new[allowed]])
    numbers = {name: np.concatenate([values, of_new[name][allowed]]) for name, values in numbers.items()}
    objectives = np.stack([numbers[name] for name in names], axis=1)
    best = np.flatnonzero(non_dominated(objectives))
    best = best[np.lexsort(objectives[best].T[::-1])]
    return designs[best], {name: values[best] for name, values in numbers.items()}
