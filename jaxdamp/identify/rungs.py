"""The laws of a comparison: each fit with its errors, the one to be recommended, and why, in words."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp import dampers
from jaxdamp._tables import Cell, Column, Table
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, with_command
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.model import is_memoryless
from jaxdamp.identify.predicting import ErrorShares, Score
from jaxdamp.identify.scheduling import ScheduledFit
from jaxdamp.parameters import parameters


FEWEST_PARTS = 3  # whose errors show by how much they vary from one to the next
ALIKE = 0.01  # relative difference of errors that is never a reason to prefer a law
NEARLY = 1.1  # times the smallest error, above which a law is never recommended beside another without doubt
EXACT = 1e-4  # of the largest force: smaller errors are all alike
HYSTERESIS = 0.05  # share of the squared error above which a law with states is worthwhile
SHAPE = 0.3  # share of the squared error above which another curve is worthwhile
CURVES = {"piecewise_linear": dampers.PiecewiseLinear, "table": dampers.Table}  # laws that follow any curve, by name


class Rung(NamedTuple):
    """One law of a comparison.

    Attributes:
        name: of the law.
        parameters: number of free parameters.
        fit_percent: on the fitted records [%].
        rmse: on the fitted records [N].
        held_out_fit_percent: on motion that it was not fitted to [%]; None where none could be held out.
        held_out_rmse: on the same [N].
        result: the fit of all records.
        scores: on each record or part of a record that was held out, or on the fitted records if none was.
        by_setting: the fit whose parameters are functions of the command, where there is one.
        judged_on: what was held out, in words; empty if nothing was.
    """

    name: str
    parameters: int
    fit_percent: float
    rmse: float  # N
    held_out_fit_percent: float | None
    held_out_rmse: float | None  # N
    result: FitResult
    scores: tuple[Score, ...]
    by_setting: ScheduledFit | None = None
    judged_on: str = ""

    @property
    def error(self) -> float:
        """RMSE [N] by which laws are ranked: on motion held out, or on the fitted records if none was."""
        return self.rmse if self.held_out_rmse is None else self.held_out_rmse

    @property
    def numbers(self) -> int:
        """Numbers of the law, those held by the fit too, or free numbers of law and machine if these are more."""
        return max(self.parameters, sum(np.size(p.value) for p in parameters(self.result.law)))

    @property
    def doubt(self) -> str:
        """Why its numbers cannot be believed, in words; empty for a converged fit that determines every number."""
        weak = sum(e.note == "not identifiable" for e in self.result.parameters)
        bound = sum(e.note == "at a bound" for e in self.result.parameters)
        parts = ["not converged"] * (not self.result.converged)
        parts += [f"{weak} not identifiable"] * bool(weak) + [f"{bound} at a bound"] * bool(bound)
        return ", ".join(parts)

    def scores_table(self) -> Table:
        """The error on each record or part of a record that was held out."""
        columns = (Column("held out"), Column("fit", "%", ".1f"), Column("RMSE", "N", ".1f"))
        rows = tuple((score.name, score.fit_percent, score.rmse) for score in self.scores)
        return Table(f"Errors of {self.name}: {self.judged_on}", columns, rows)

    def laws(self) -> dict[str, AbstractDamper]:
        """The law by its name; one that depends on the command at each, by a name of its own."""
        law = self.result.law
        settings = self.by_setting.alone if self.by_setting else ()
        return {f"{self.name} at {setting:g}": with_command(law, setting) for setting in settings} or {self.name: law}


class Failure(NamedTuple):
    """A law of a comparison that has no fit.

    Attributes:
        name: of the law.
        reason: in words.
    """

    name: str
    reason: str  # in words


def best_of(rungs: Iterable[Rung]) -> Rung:
    """The law with the smallest error on motion held out, or on the fitted records if none was."""
    return min(rungs, key=lambda rung: rung.error)


def ladder_table(rungs: Sequence[Rung], failed: Sequence[Failure] = (), recommended: str = "") -> Table:
    """Each law with its errors and their shares; then the laws that failed."""
    held = any(rung.held_out_rmse is not None for rung in rungs)
    columns = [Column("law"), Column("free", spec="d"), Column("fit", "%", ".1f"), Column("RMSE", "N", ".1f")]
    columns += [Column("held-out fit", "%", ".1f"), Column("held-out RMSE", "N", ".1f")] * held
    columns += [Column(name, "%", ".0f") for name in ErrorShares._fields]
    columns += [Column("note")]
    rows: list[tuple[Cell, ...]] = []
    for rung in rungs:
        scores = (rung.name, rung.parameters, rung.fit_percent, rung.rmse)
        scores += (rung.held_out_fit_percent, rung.held_out_rmse) if held else ()
        note = ", ".join(filter(None, ["recommended" * (rung.name == recommended), rung.doubt]))
        rows.append((*scores, *(100 * share for share in rung.result.error_shares), note))
    rows += [(failure.name, *[None] * (len(columns) - 2), "failed") for failure in failed]
    return Table("Laws (shape, hysteresis and rest are shares of the squared error)", tuple(columns), tuple(rows))


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
    return (*sentences, *_remaining(best, rungs))


def _remaining(best: Rung, rungs: Sequence[Rung]) -> list[str]:
    """Sentences on hysteresis and shape that the recommended law has not followed."""
    sentences, remaining = list[str](), best.result.error_shares
    if not is_memoryless(best.result.law) and remaining.hysteresis >= HYSTERESIS:
        sentences.append(f"{100 * remaining.hysteresis:.0f} % of the squared error of {best.name} is still hysteresis.")
    if remaining.shape >= SHAPE:
        part = 100 * remaining.shape
        missing = [name for name, law in CURVES.items() if not any(isinstance(r.result.law, law) for r in rungs)]
        remedy = f"try {' or '.join(missing)}, which follow any curve" if missing else "no law tried follows it better"
        sentences.append(f"{part:.0f} % of the squared error of {best.name} is shape, of the curve: {remedy}.")
    return sentences


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
