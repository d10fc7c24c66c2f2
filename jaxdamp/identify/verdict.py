"""The errors of fitted laws, explained in words."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import stdtrit

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify.model import is_memoryless
from jaxdamp.identify.rungs import Rung, best_of
from jaxdamp.parameters import parameters


HYSTERESIS = 0.05  # share of the squared error above which a law with states is worthwhile
SHAPE = 0.3  # share of the squared error above which another curve is worthwhile

FEWEST_RECORDS = 3  # whose errors show by how much they vary from record to record
ALIKE = 0.01  # relative difference of errors that is never a reason to prefer a law


def not_worse(errors: Mapping[str, Sequence[float]], best: str) -> list[str]:
    """Laws whose errors on the same records do not tell them from the best one, in the order given.

    A law is worse if the logarithms of the ratios of its errors to those of the best one have a mean that is above
    zero by more than chance: by Student's t at 95 %, two-sided, every record being one observation. Fewer than three
    records cannot show this: then only `ALIKE` counts.

    Arguments:
        errors: RMSE [N] on each record by law.
        best: one of these laws.

    >>> not_worse({"a": [10.0, 20.0, 15.0], "b": [11.0, 18.0, 16.0], "c": [20.0, 41.0, 29.0]}, "a")
    ['b']
    """
    alike = []
    for name, own in errors.items():
        ratios = np.log(np.maximum(own, 1e-300) / np.maximum(errors[best], 1e-300))
        n = ratios.size
        spread = float(stdtrit(n - 1, 0.975) * np.std(ratios, ddof=1) / np.sqrt(n)) if n >= FEWEST_RECORDS else 0.0
        if name != best and float(np.mean(ratios)) < max(spread, ALIKE):
            alike.append(name)
    return alike


def cannot_choose(errors: Mapping[str, Sequence[float]], best: str, numbers: Mapping[str, int]) -> list[str]:
    """A sentence on laws that the records cannot tell from the best one, if there are any.

    Arguments:
        errors: RMSE [N] on each record by law.
        best: the law with the smallest error.
        numbers: of free parameters of each law.
    """
    alike = [best, *not_worse(errors, best)]
    if len(alike) == 1:
        return []
    simplest = min(alike, key=lambda name: numbers[name])
    return [
        f"The records cannot choose between {', '.join(alike[:-1])} and {alike[-1]}: their errors differ by no more "
        f"than they vary from record to record. The simplest of them is {simplest}, with {numbers[simplest]} numbers."
    ]


def verdict(rungs: Sequence[Rung], held_out: Sequence[BenchRun]) -> tuple[str, ...]:
    """Sentences on the error of the best law and on the shares of the errors of the laws.

    Arguments:
        rungs: the fitted laws, at least one.
        held_out: the records that they were scored on, if any.
    """
    best = best_of(rungs)
    static = [rung for rung in rungs if is_memoryless(rung.result.law)]
    sentences = [_error_of(best, rungs, held_out)]
    if static:
        rung = best_of(static)
        part = rung.result.error_shares.hysteresis
        lead = "It is a law of velocity alone" if rung is best else f"The best law of velocity alone is {rung.name}"
        if part >= HYSTERESIS:
            sentences.append(
                f"{lead}: {100 * part:.0f} % of its squared error is hysteresis (at one velocity the force differs"
                " between the two halves of the stroke), which no such law can follow."
            )
        else:
            sentences.append(f"{lead}; hysteresis is only {100 * part:.0f} % of its squared error.")
        if rung is best and part >= HYSTERESIS and len(static) == len(rungs):
            sentences.append("Try a law with hysteresis, such as besinger_lag or besinger_series_spring.")
        elif rung is not best:
            factor = rung.error / best.error
            sentences.append(f"{best.name} has a {factor:.1f} times smaller error.")
    remaining = best.result.error_shares
    if not is_memoryless(best.result.law) and remaining.hysteresis >= HYSTERESIS:
        sentences.append(f"{100 * remaining.hysteresis:.0f} % of the squared error of {best.name} is still hysteresis.")
    if remaining.shape >= SHAPE:
        part = 100 * remaining.shape
        sentences.append(f"{part:.0f} % of the squared error of {best.name} is shape: another curve would fit better.")
    errors = {rung.name: [score.rmse for score in rung.scores] for rung in rungs}
    numbers = {rung.name: max(rung.parameters, _numbers_of(rung.result.law)) for rung in rungs}  # some may be frozen
    sentences += cannot_choose(errors, best.name, numbers)
    return tuple(sentences)


def _numbers_of(law: AbstractDamper) -> int:
    return sum(np.size(p.value) for p in parameters(law))


def _error_of(best: Rung, rungs: Sequence[Rung], held_out: Sequence[BenchRun]) -> str:
    where, runs = ("held-out", held_out) if held_out else ("fitted", best.result.runs)
    percent = best.fit_percent if best.held_out_fit_percent is None else best.held_out_fit_percent
    largest = max(float(abs(run.force).max()) for run in runs)
    share = 100 * best.error / largest
    lead = "Smallest error" if len(rungs) > 1 else "Error"
    return (
        f"{lead} on the {where} records: {best.name}, RMSE {best.error:.1f} N, {share:.1f} % of their largest force"
        f" of {largest:.0f} N (fit {percent:.1f} %)."
    )
