"""The law to be recommended: the simplest that predicts motion held out as well as any."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp.identify.rungs import Rung, best_of


FEWEST_PARTS = 3  # whose errors show by how much they vary from one to the next
ALIKE = 0.01  # relative difference of errors that is never a reason to prefer a law
NEARLY = 1.1  # times the smallest error, above which a law is never recommended beside another without doubt
EXACT = 1e-4  # of the largest force: smaller errors are all alike


def not_worse(errors: Mapping[str, Sequence[float]], best: str) -> list[str]:
    """Laws whose errors on the same parts do not tell them from the best one, in the order given.

    A law is worse if the mean of the logarithms of the ratios of its errors to those of the best one is above zero by
    more than its standard error, every record or part of a record being one observation (the rule of one standard
    error). Fewer than three cannot show this: then only `ALIKE` counts.

    Arguments:
        errors: RMSE [N] on each record or part of a record by law.
        best: one of these laws.

    >>> not_worse({"a": [10.0, 20.0, 15.0], "b": [11.0, 18.0, 16.0], "c": [20.0, 41.0, 29.0]}, "a")
    ['b']
    """
    alike = []
    for name, own in errors.items():
        ratios = np.log(np.maximum(own, 1e-300) / np.maximum(errors[best], 1e-300))
        n = ratios.size
        spread = float(np.std(ratios, ddof=1) / np.sqrt(n)) if n >= FEWEST_PARTS else 0.0
        if name != best and float(np.mean(ratios)) < max(spread, ALIKE):
            alike.append(name)
    return alike


class Recommendation(NamedTuple):
    """The law to be recommended and those that it was chosen from.

    Attributes:
        rung: the law.
        alike: the laws that predict as well as any, this one among them, from simple to complex.
        doubted: of these, or with a smaller error, those that were left aside because of their `doubt`.
    """

    rung: Rung
    alike: tuple[Rung, ...]
    doubted: tuple[Rung, ...]


def recommendation(rungs: Sequence[Rung]) -> Recommendation:
    """The law with the fewest numbers that predicts motion held out as well as any, within the scatter of the errors.

    As well as any: not worse than the law with the smallest error by the rule of one standard error (`not_worse`), and
    at most 10 % worse over all samples. A law that did not converge, or with numbers at bounds or not identifiable, is
    left aside where another is as good, or else nearly as good (within 10 %). Laws that could not be judged on motion
    held out are recommended only if none could.

    Arguments:
        rungs: the laws, at least one.
    """
    judged = [rung for rung in rungs if rung.held_out_rmse is not None and np.isfinite(rung.error)] or list(rungs)
    largest = max(float(np.abs(run.force).max()) for run in rungs[0].result.runs)
    floor = EXACT * largest
    first = best_of(judged)
    errors = {rung.name: [max(score.rmse, floor) for score in rung.scores] for rung in judged}
    near = [rung for rung in judged if max(rung.error, floor) <= NEARLY * max(first.error, floor)]
    names = {first.name, *not_worse(errors, first.name)}
    alike = sorted((rung for rung in near if rung.name in names), key=lambda rung: (rung.numbers, rung.error))
    for group in (alike, sorted(near, key=lambda rung: (rung.numbers, rung.error))):
        sound = [rung for rung in group if not rung.doubt]
        if sound:
            better = [rung for rung in judged if rung.doubt and (rung in alike or rung.error < sound[0].error)]
            return Recommendation(sound[0], tuple(rung for rung in alike if not rung.doubt), tuple(better))
    return Recommendation(alike[0], tuple(alike), ())
