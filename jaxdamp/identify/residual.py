"""Shares of the error of a law: shape, hysteresis, noise."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import BenchRun, as_runs
from jaxdamp.identify.model import Model, is_memoryless
from jaxdamp.identify.predicting import predict_by_record, used_samples


class ErrorShares(NamedTuple):
    """Shares of the mean squared error; their sum is 1.

    Attributes:
        shape: share that another curve of force over velocity would remove [-].
        hysteresis: share by which the force differs between the two passes through the same velocity [-].
        rest: noise, and changes from cycle to cycle [-].
    """

    shape: float  # another curve of force over velocity would remove it
    hysteresis: float  # the force differs between the two passes through the same velocity
    rest: float  # noise, and changes from cycle to cycle


@of_known_numbers
def error_shares(
    law: Model | Sequence[Model], runs: BenchRun | Iterable[BenchRun], initial_state: str = "warm_up"
) -> ErrorShares:
    """Split the squared force error of a law over records, record by record, by an analysis of variance.

    The samples of a record are sorted by velocity into bins, and each bin is divided by the half of the stroke: a cycle
    passes every velocity twice, once above and once below mid-stroke. The mean of a bin is the error that another curve
    over velocity could remove (*shape*), the difference of the two halves from it is *hysteresis* (or a dependence on
    the stroke), and the scatter about them is the *rest*. The contribution of the scatter to the means is subtracted.

    `FitResult.error_shares` gives the shares of a fit over its own records.

    Arguments:
        law: a law, fitted or not, or the `model` of a fit; or one for each record.
        runs: one record or several.
        initial_state: how they start, as in `fit`.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Bilinear, Linear
    >>> runs = bench.VirtualDyno(Bilinear(2600.0, 1200.0), force_noise=5.0).run(bench.SineTest(0.01, 2.0))
    >>> error_shares(Linear(1900.0), runs).shape > 0.9
    True
    """
    runs = as_runs(runs, call="error_shares(law, runs)")
    sums = np.zeros(3)
    laws, forces = predict_by_record(law, runs, initial_state)
    for own, run, force in zip(laws, runs, forces, strict=True):
        part = used_samples(own, run, is_memoryless(own), initial_state)
        sums += _sums(run.velocity[part], run.stroke[part], force[part] - run.force[part])
    shape, hysteresis, rest = sums / max(sums.sum(), np.finfo(float).tiny)
    return ErrorShares(float(shape), float(hysteresis), float(rest))


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
