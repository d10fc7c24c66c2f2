"""The laws of a comparison: each fit with its errors, the one to be recommended, and why, in words."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp import dampers
from jaxdamp._tables import Cell, Column, Table
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, with_command
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.model import is_memoryless
from jaxdamp.identify.predicting import ErrorShares, Score
from jaxdamp.identify.recommending import Recommendation, doubt_of, not_worse, recommendation, why
from jaxdamp.identify.scheduling import ScheduledFit
from jaxdamp.parameters import parameters


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
        reduced: of which law this one is what the records determine, and what is left; empty for a law as given.
        held: paths of the numbers of a reduced law that are held at zero.
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
    reduced: str = ""
    held: tuple[str, ...] = ()

    @property
    def error(self) -> float:
        """RMSE [N] by which laws are ranked: on motion held out, or on the fitted records if none was."""
        return self.rmse if self.held_out_rmse is None else self.held_out_rmse

    @property
    def numbers(self) -> int:
        """Numbers of the law, those held by the fit too, or free numbers of law and machine if these are more."""
        of_law = (p for p in parameters(self.result.law) if p.path not in self.held)
        return max(self.parameters, sum(np.size(p.value) for p in of_law))

    @property
    def doubt(self) -> str:
        """Why its numbers cannot be believed, in words; empty for a converged fit that determines every number."""
        return doubt_of(self.result)

    @property
    def floor(self) -> float:
        """Error [N] below which laws are alike."""
        return EXACT * max(float(np.abs(run.force).max()) for run in self.result.runs)

    @property
    def errors(self) -> tuple[float, ...]:
        """RMSE [N] on each record or part of a record that was held out."""
        return tuple(max(score.rmse, self.floor) for score in self.scores)

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


def cannot_choose(errors: Mapping[str, Sequence[float]], best: str, numbers: Mapping[str, int]) -> list[str]:
    """A sentence on laws that the records cannot tell from the best one by their RMSE [N], if there are any."""
    alike = [best, *not_worse(errors, best)]
    if len(alike) == 1:
        return []
    simplest = min(alike, key=lambda name: numbers[name])
    return [
        f"The records cannot choose between {', '.join(alike[:-1])} and {alike[-1]}: their errors differ by no more "
        f"than they vary from record to record. The simplest of them is {simplest}, with {numbers[simplest]} numbers."
    ]


def verdict(choice: Recommendation[Rung], rungs: Sequence[Rung], held_out: Sequence[BenchRun]) -> tuple[str, ...]:
    """Sentences on the recommended law, why it is this one, and the shares of the errors of the laws."""
    best = choice.rung
    moved = not all(run.of_points for run in best.result.runs)  # a table has no hysteresis to be followed
    static = [rung for rung in rungs if moved and is_memoryless(rung.result.law)]
    sentences = [_error_of(best, rungs, held_out), *why(choice, rungs, made=best.reduced)]
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
    return f"{lead}, {where}, RMSE {best.error:.4g} N, {share:.1f} % of the largest force of {largest:.0f} N{how}."
