"""The errors of fitted laws, explained in words."""

from collections.abc import Mapping, Sequence

import numpy as np

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import PiecewiseLinear, Table
from jaxdamp.identify.model import is_memoryless
from jaxdamp.identify.recommending import Recommendation, not_worse, recommendation
from jaxdamp.identify.rungs import Rung


HYSTERESIS = 0.05  # share of the squared error above which a law with states is worthwhile
SHAPE = 0.3  # share of the squared error above which another curve is worthwhile
CURVES = {"piecewise_linear": PiecewiseLinear, "table": Table}  # laws that follow any curve, by name


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


def verdict(choice: Recommendation, rungs: Sequence[Rung], held_out: Sequence[BenchRun]) -> tuple[str, ...]:
    """Sentences on the recommended law, why it is this one, and the shares of the errors of the laws.

    Arguments:
        choice: the recommendation.
        rungs: the fitted laws, at least one.
        held_out: the records that they were scored on, if any were given.
    """
    best = choice.rung
    static = [rung for rung in rungs if is_memoryless(rung.result.law)]
    sentences = [_error_of(best, rungs, held_out), *_why(choice, rungs)]
    if static:
        rung = best if is_memoryless(best.result.law) else recommendation(static).rung
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
        missing = [name for name, law in CURVES.items() if not any(isinstance(r.result.law, law) for r in rungs)]
        remedy = f"try {' or '.join(missing)}, which follow any curve" if missing else "no law tried follows it better"
        sentences.append(f"{part:.0f} % of the squared error of {best.name} is shape, of the curve: {remedy}.")
    return tuple(sentences)


def _error_of(best: Rung, rungs: Sequence[Rung], held_out: Sequence[BenchRun]) -> str:
    percent = best.fit_percent if best.held_out_fit_percent is None else best.held_out_fit_percent
    largest = max(float(abs(run.force).max()) for run in held_out or best.result.runs)
    share = 100 * best.error / largest
    lead = f"Recommended: {best.name}" if len(rungs) > 1 else f"Error of {best.name}"
    where = (
        f"held-out fit {percent:.1f} %" if best.judged_on else f"fit {percent:.1f} % on the records it was fitted to"
    )
    how = f" ({best.judged_on})" if best.judged_on else "; nothing could be held out"
    return f"{lead}, {where}, RMSE {best.error:.1f} N, {share:.1f} % of the largest force of {largest:.0f} N{how}."


def _why(choice: Recommendation, rungs: Sequence[Rung]) -> list[str]:
    """One sentence on why it is this law, of several."""
    best, numbers = choice.rung, choice.rung.numbers
    *others, last = [rung.name for rung in choice.alike] or [""]
    if len(rungs) == 1:
        return []
    if others:
        names = f"{', '.join(others)} and {last}"
        why = f"With {numbers} numbers it is the simplest of {names}, which predict alike within the scatter"
    else:
        next_best = min((rung.error for rung in rungs if rung is not best), default=best.error)
        factor = next_best / best.error if best.error > 0 else np.inf
        why = f"No other law predicts as well: the next error is {factor:.2f} times as large"
        why = (
            why if factor > 1 else f"With {numbers} numbers it predicts as well as any law whose numbers are all known"
        )
    if best.doubt:
        why += f"; of its numbers, {best.doubt}, and no law without such doubt comes near"
    aside = ", ".join(f"{rung.name} ({rung.doubt})" for rung in choice.doubted)
    return [why + f"; left aside: {aside}" * bool(aside) + "."]
