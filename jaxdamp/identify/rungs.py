"""The laws of a comparison: each fit with its errors."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp._tables import Cell, Column, Table
from jaxdamp.dampers import AbstractDamper, with_command
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.residual import ErrorShares
from jaxdamp.identify.scheduling import ScheduledFit
from jaxdamp.identify.scoring import Score
from jaxdamp.parameters import parameters


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
