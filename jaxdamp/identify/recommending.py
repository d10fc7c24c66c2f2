"""The one to be recommended of several laws or vehicles, by their errors on motion that was held out."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Generic, Protocol, TypeVar, runtime_checkable

import numpy as np

from jaxdamp.identify.result import Fit


FEWEST_PARTS = 3  # whose errors show by how much they vary from one to the next
ALIKE = 0.01  # relative difference of errors that is never a reason to prefer a law
NEARLY = 1.1  # times the smallest error, above which a law is never recommended beside another without doubt


@runtime_checkable
class Candidate(Protocol):
    """A law or a vehicle of a comparison."""

    @property
    def name(self) -> str:
        """Of the law or vehicle."""
        ...

    @property
    def result(self) -> Fit:
        """The fit of all records."""
        ...

    @property
    def rmse(self) -> float:
        """On the fitted records."""
        ...

    @property
    def held_out_rmse(self) -> float | None:
        """On motion that it was not fitted to; None where none could be held out."""
        ...

    @property
    def error(self) -> float:
        """By which candidates are ranked."""
        ...

    @property
    def errors(self) -> Sequence[float]:
        """On each part that was held out; those so small that they are rounding errors are alike."""
        ...

    @property
    def floor(self) -> float:
        """Error below which all are alike."""
        ...

    @property
    def numbers(self) -> int:
        """By which simple and complex ones are told apart."""
        ...

    @property
    def doubt(self) -> str:
        """Why its numbers cannot be believed."""
        ...


C = TypeVar("C", bound=Candidate)


def doubt_of(fit: Fit) -> str:
    """Why the numbers of a fit cannot be believed, in words; empty for one that converged and determines them all."""
    weak = sum(e.note == "not identifiable" for e in fit.parameters)
    bound = sum(e.note == "at a bound" for e in fit.parameters)
    parts = ["not converged"] * (not fit.converged)
    parts += [f"{weak} not identifiable"] * bool(weak) + [f"{bound} at a bound"] * bool(bound)
    return ", ".join(parts)


def best_of(rungs: Iterable[C]) -> C:
    """The one with the smallest error on motion held out, or on the fitted records if none was."""
    return min(rungs, key=lambda rung: rung.error)


def not_worse(errors: Mapping[str, Sequence[float]], best: str) -> list[str]:
    """Laws whose errors on the same parts do not tell them from the best one, in the order given.

    A law is worse if the mean of the logarithms of the ratios of its errors to those of the best one is above zero by
    more than its standard error, every record or part of a record being one observation (the rule of one standard
    error). Fewer than three cannot show this: then only `ALIKE` counts.

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


@dataclasses.dataclass(frozen=True)
class Recommendation(Generic[C]):
    """The law or vehicle to be recommended and those that it was chosen from."""

    rung: C
    alike: tuple[C, ...]  # those that predict as well as any, this one among them, from simple to complex
    doubted: tuple[C, ...]  # of these, or with a smaller error, those that were left aside because of their `doubt`


def judged_on_held_out(rungs: Sequence[C]) -> list[C]:
    """Those that were judged on motion held out; all of them if none was."""
    return [rung for rung in rungs if rung.held_out_rmse is not None and np.isfinite(rung.error)] or list(rungs)


def recommendation(rungs: Sequence[C]) -> Recommendation[C]:
    """The law with the fewest numbers that predicts motion held out as well as any, within the scatter of the errors.

    As well as any: not worse than the law with the smallest error by the rule of one standard error (`not_worse`), and
    at most 10 % worse over all samples. A law that did not converge, or with numbers at bounds or not identifiable, is
    left aside where another is as good, or else nearly as good (within 10 %). Laws that could not be judged on motion
    held out are recommended only if none could.
    """
    judged = judged_on_held_out(rungs)
    first, floor = best_of(judged), judged[0].floor
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


def why(choice: Recommendation[C], rungs: Sequence[C], kind: str = "law", made: str = "") -> list[str]:
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
        factor = next_best / best.error if best.error > 0 else np.inf
        words = f"No other {kind} predicts as well: the next error is {factor:.2f} times as large"
        if factor <= 1.0 + ALIKE:
            words = f"With {numbers} numbers it predicts as well as any {kind} whose numbers are all known"
    if best.doubt:
        words += f"; of its numbers, {best.doubt}, and no {kind} without such doubt comes near"
    if made:
        words += f"; it is {made}, what these records determine of it"
    aside = ", ".join(f"{rung.name} ({rung.doubt})" for rung in choice.doubted)
    return [words + f"; left aside: {aside}" * bool(aside) + "."]
