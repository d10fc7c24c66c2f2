"""What the error of a law is made of: shape, hysteresis, noise."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.bench import BenchRun
from jaxdamp.identify import FitResult
from jaxdamp.identify.traces import used_samples


class Shares(NamedTuple):
    """Parts of the mean squared error; together 1."""

    shape: float  # another curve of force over velocity would remove it
    hysteresis: float  # the force differs between the two ways through the same velocity
    rest: float  # noise, and what changes from cycle to cycle


def residual_shares(result: FitResult, runs: Sequence[BenchRun] | None = None) -> Shares:
    """Split the squared error of a fitted law, record by record, by an analysis of variance.

    The samples of a record are sorted by velocity into bins, and each bin by the half of the stroke they were taken
    in: a cycle passes every velocity twice, once above and once below mid-stroke. The mean of a bin is what another
    curve over velocity could remove (*shape*), the distance of the two halves from it is *hysteresis* (or a force that
    depends on the stroke), the scatter about them is the *rest*. What the means owe to the scatter is taken off.

    Arguments:
        result: a fit.
        runs: other records than those of the fit.
    """
    runs = result.runs if runs is None else tuple(runs)
    sums = np.zeros(3)
    for run, force in zip(runs, result.predict(runs), strict=True):
        part = used_samples(result.law, run)
        sums += _sums(run.velocity[part], run.stroke[part], force[part] - run.force[part])
    shape, hysteresis, rest = sums / max(sums.sum(), np.finfo(float).tiny)
    return Shares(float(shape), float(hysteresis), float(rest))


def _sums(
    velocity: Float[np.ndarray, " samples"], stroke: Float[np.ndarray, " samples"], error: Float[np.ndarray, " samples"]
) -> Float[np.ndarray, "3"]:
    """Sums of squares of one record: shape, hysteresis, rest."""
    count = len(error)
    bins = int(np.clip(count // 16, 1, 30))
    number = np.empty(count, dtype=int)
    number[np.argsort(velocity, kind="stable")] = np.arange(count) * bins // count
    above = stroke > 0.5 * (stroke.max() + stroke.min())
    cells = 2 * number + above
    by_bin = _group_squares(number, error, bins)
    by_cell = _group_squares(cells, error, 2 * bins)
    total = float(error @ error)
    scatter = (total - by_cell) / max(count - 2 * bins, 1)
    shape = max(by_bin - bins * scatter, 0.0)
    hysteresis = max(by_cell - by_bin - bins * scatter, 0.0)
    return np.array([shape, hysteresis, max(total - shape - hysteresis, 0.0)])


def _group_squares(number: np.ndarray, error: np.ndarray, groups: int) -> float:
    """Σ n m² over groups of n samples with mean m."""
    n = np.bincount(number, minlength=groups)
    sums = np.bincount(number, weights=error, minlength=groups)
    return float(np.sum(sums[n > 0] ** 2 / n[n > 0]))
