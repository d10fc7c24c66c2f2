"""The laws of a comparison: each fit with its errors, the one to be recommended, and why, in words."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

import numpy as np

from jaxdamp import dampers
from jaxdamp._tables import Column, Table
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, with_command
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.model import is_memoryless
from jaxdamp.identify.predicting import Score
from jaxdamp.identify.result import Fit
from jaxdamp.identify.scheduling import ScheduledFit
from jaxdamp.parameters import parameters


if TYPE_CHECKING:
    from jaxdamp.identify.vehicle_comparing import VehicleRung

    R = TypeVar("R", bound="Rung | VehicleRung")
else:
    R = TypeVar("R")  # a check of types at run time knows no class that is not loaded

EXACT = 1e-4  # of the largest force: smaller errors are all alike
HYSTERESIS = 0.05  # share of the squared error above which a law with states is worthwhile
SHAPE = 0.3  # share of the squared error above which another curve is worthwhile
CURVES = {"piecewise_linear": dampers.PiecewiseLinear, "table": dampers.Table}  # laws that follow any curve, by name
FEWEST_PARTS = 3  # whose errors show by how much they vary from one to the next
ALIKE = 0.01  # relative difference of errors that is never a reason to prefer a law
NEARLY = 1.1  # times the smallest error, above which a law is never recommended beside another without doubt


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
    def is_exact(self) -> bool:
        """Whether its error is below `floor`: what is left is rounding, with which nothing can be compared."""
        return self.error <= self.floor

    @property
    def error_in_words(self) -> str:
        """Its error [N], or that it is below `floor`."""
        return f"RMSE less than {self.floor:.2g} N" if self.is_exact else f"RMSE {self.error:.4g} N"

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


def doubt_of(fit: Fit) -> str:
    """Why the numbers of a fit cannot be believed, in words; empty for one that converged and determines them all."""
    weak = sum(e.note == "not identifiable" for e in fit.parameters)
    bound = sum(e.note == "at a bound" for e in fit.parameters)
    parts = ["not converged"] * (not fit.converged)
    parts += [f"{weak} not identifiable"] * bool(weak) + [f"{bound} at a bound"] * bool(bound)
    return ", ".join(parts)


def not_worse(errors: Mapping[str, Sequence[float]], best: str) -> list[str]:
    """Laws whose errors on the same parts do not tell them from the best one, in the order given.

    A law is worse if the mean of the logarithms of the ratios of its errors to those of the best one is above zero by
    more than its standard error, every record or part of a record being one observation (the rule of one standard
    error). Fewer than three cannot show this: then only `ALIKE` counts.

    >>> not_worse({"a": [10.0, 20.0, 15.0], "b": [11.0, 18.0, 16.0], "c": [20.0, 41.0, 29.0]}, "a")
    ['b']
    """
    alike = []
    for name, of_rung in errors.items():
        ratios = np.log(np.maximum(of_rung, 1e-300) / np.maximum(errors[best], 1e-300))
        n = ratios.size
        spread = float(np.std(ratios, ddof=1) / np.sqrt(n)) if n >= FEWEST_PARTS else 0.0
        if name != best and float(np.mean(ratios)) < max(spread, ALIKE):
            alike.append(name)
    return alike


@dataclasses.dataclass(frozen=True)
class Recommendation(Generic[R]):
    """The law or vehicle to be recommended and those that it was chosen from."""

    rung: R
    alike: tuple[R, ...]  # those that predict as well as any, this one among them, from simple to complex
    doubted: tuple[R, ...]  # of these, or with a smaller error, those that were left aside because of their `doubt`


def judged_on_held_out(rungs: Sequence[R]) -> list[R]:
    """Those that were judged on motion held out; all of them if none was."""
    return [rung for rung in rungs if rung.held_out_rmse is not None and np.isfinite(rung.error)] or list(rungs)


def recommendation(rungs: Sequence[R]) -> Recommendation[R]:
    """The law with the fewest numbers that predicts motion held out as well as any, within the scatter of the errors.

    As well as any: not worse than the law with the smallest error by the rule of one standard error (`not_worse`), and
    at most 10 % worse over all samples. A law that did not converge, or with numbers at bounds or not identifiable, is
    left aside where another is as good, or else nearly as good (within 10 %). Laws that could not be judged on motion
    held out are recommended only if none could.
    """
    judged = judged_on_held_out(rungs)
    first, floor = min(judged, key=lambda rung: rung.error), judged[0].floor
    errors = {rung.name: rung.errors for rung in judged}
    near = [rung for rung in judged if max(rung.error, floor) <= NEARLY * max(first.error, floor)]
    names = {first.name, *not_worse(errors, first.name)}
    alike = sorted((rung for rung in near if rung.name in names), key=lambda rung: (rung.numbers, rung.error))
    for group in (alike, sorted(near, key=lambda rung: (rung.numbers, rung.error))):
        sound = [rung for rung in group if not rung.doubt]
        if sound:
            better = [rung for rung in judged if rung.doubt and (rung in alike or rung.error < sound[0].error)]
            return Recommendation(sound[0], tuple(rung for rung in alike if not rung.doubt), tuple(better))
    return Recommendation(alike[0], tuple(alike), ())


def why(choice: Recommendation[R], rungs: Sequence[R], kind: str = "law", made: str = "") -> list[str]:
    """One sentence on why it is this law or vehicle, of several; and how it was made from another, in words."""
    best, numbers = choice.rung, choice.rung.numbers
    *others, last = [rung.name for rung in choice.alike] or [""]
    if len(rungs) == 1:
        return []
    if others:
        names = f"{', '.join(others)} and {last}"
        words = f"With {numbers} numbers it is the simplest of {names}, which predict alike within the scatter"
    else:
        next_best = min((rung.error for rung in rungs if rung is not best), default=best.error)
        least = max(best.error, best.floor)
        factor = max(next_best, best.floor) / least if least > 0 else np.inf
        exact = best.error <= best.floor
        size = "it leaves no error to compare with" if exact else f"the next error is {factor:.2f} times as large"
        words = f"No other {kind} predicts as well: {size}"
        if factor <= 1.0 + ALIKE:
            words = f"With {numbers} numbers it predicts as well as any {kind} whose numbers are all known"
    if best.doubt:
        words += f"; of its numbers, {best.doubt}, and no {kind} without such doubt comes near"
    if made:
        part = "with fewer numbers in doubt" if best.doubt else "what these records determine of it"
        words += f"; it is {made}, {part}"
    aside = ", ".join(f"{rung.name} ({rung.doubt})" for rung in choice.doubted)
    return [words + f"; left aside: {aside}" * bool(aside) + "."]


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
    rung = best if is_memoryless(best.result.law) or not static else recommendation(static).rung
    reasons = [*why(choice, rungs, made=best.reduced), *_late(best, rung)]
    sentences = [_error_of(best, rungs, held_out), *[" ".join(reasons)] * bool(reasons)]
    if static and not rung.is_exact:
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
            factor = rung.error / max(best.error, best.floor)
            sentences.append(f"{best.name} has a {factor:.1f} times smaller error.")
    return (*sentences, *_remaining(best, rungs))


def _late(best: Rung, static: Rung) -> list[str]:
    """A sentence where the memory of the recommended law may be a delay of the channel, as that without shows."""
    delay = static.result.left_out.delay
    if static is best or delay is None:
        return []
    late = 1e3 * delay
    way = "late" if late > 0 else "early"
    return [
        f"By {static.name}, the force channel may be {abs(late):.2g} ms {way}, which {best.name} imitates:"
        ' compare beside a "delay" of the machine (`rig`).'
    ]


def _remaining(best: Rung, rungs: Sequence[Rung]) -> list[str]:
    """Sentences on hysteresis and shape that the recommended law has not followed."""
    if best.is_exact:
        return []
    sentences, remaining = list[str](), best.result.error_shares
    if not is_memoryless(best.result.law) and remaining.hysteresis >= HYSTERESIS:
        sentences.append(f"{100 * remaining.hysteresis:.0f} % of the squared error of {best.name} is still hysteresis.")
    if remaining.shape >= SHAPE:
        part = 100 * remaining.shape
        missing = [name for name, law in CURVES.items() if not any(isinstance(r.result.law, law) for r in rungs)]
        follow = "follows" if len(missing) == 1 else "follow"
        remedy = (
            f"try {' or '.join(missing)}, which {follow} any curve" if missing else "no law tried follows it better"
        )
        sentences.append(f"{part:.0f} % of the squared error of {best.name} is shape, of the curve: {remedy}.")
    return sentences


def _error_of(best: Rung, rungs: Sequence[Rung], held_out: Sequence[BenchRun]) -> str:
    percent = best.fit_percent if best.held_out_fit_percent is None else best.held_out_fit_percent
    largest = max(float(abs(run.force).max()) for run in held_out or best.result.runs)
    share = f"{100 * best.floor / largest:.2g}" if best.is_exact else f"{100 * best.error / largest:.1f}"
    lead = f"Recommended: {best.name}" if len(rungs) > 1 else f"Error of {best.name}"
    where = (
        f"held-out fit {percent:.1f} %" if best.judged_on else f"fit {percent:.1f} % on the records it was fitted to"
    )
    how = f" ({best.judged_on})" if best.judged_on else "; nothing could be held out"
    return f"{lead}, {where}, {best.error_in_words}, {share} % of the largest force of {largest:.0f} N{how}."
