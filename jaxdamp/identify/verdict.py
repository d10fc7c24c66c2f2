"""The errors of fitted laws, explained in words."""

from collections.abc import Sequence

from jaxdamp.bench import BenchRun
from jaxdamp.identify.model import is_memoryless
from jaxdamp.identify.rungs import Rung, best_of


HYSTERESIS = 0.05  # share of the squared error above which a law with states is worthwhile
SHAPE = 0.3  # share of the squared error above which another curve is worthwhile


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
    return tuple(sentences)


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
