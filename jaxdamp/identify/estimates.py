"""Fitted parameters with their uncertainty, and their display."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp._display import rounded
from jaxdamp._tables import Cell, Column, Shown, Table, with_tied
from jaxdamp.parameters import Module, free_parameters


WIDER = 1.5  # times a standard error, from which the error with what the law misses is shown beside it


class Estimate(NamedTuple):
    """One fitted number.

    The standard error takes all other free numbers as unknown, also those that ended at an edge of their range, and is
    computed without any edges.

    Attributes:
        name: path of the number.
        value: fitted value, in the unit.
        unit: in SI.
        standard_error: in the unit.
        interval: ends of the 95 % interval, cut at the edges of the range, in the unit.
        meaning: of the number, in words.
        note: empty, "not identifiable" or "at a bound".
        reason: why it is not identifiable.
        tied: the numbers that have the same value.
        bias: by the noise of stroke and velocity, in the unit; None if it was not estimated.
        spread: standard error with what the law misses, in the unit: by how much the number changes from one part of
            the records to another; None where the residual is noise.
    """

    name: str
    value: float
    unit: str
    standard_error: float
    interval: tuple[float, float]  # 95 %, cut at the edges of the range
    meaning: str
    note: str  # "", "not identifiable" or "at a bound"
    reason: str = ""  # why it is not identifiable
    tied: tuple[str, ...] = ()  # the numbers that have the same value
    bias: float | None = None  # by the noise of stroke and velocity, if this noise was stated
    spread: float | None = None  # with what the law misses

    @property
    def remark(self) -> str:
        """The note with its reason, and the names of the numbers tied to this one."""
        return with_tied(": ".join(filter(None, [self.note, self.reason])), self.tied)


class Minimum(NamedTuple):
    """A set of parameters at which the sum of squares has a minimum."""

    values: dict[str, float]  # of the free numbers, in their units
    chi_square: float  # sum of squares over the variance of the noise, above that of the best minimum
    starts: int  # number of starts that ended here


def describe(minima: Sequence[Minimum], starts: int) -> str:
    """The ends of several starts, in words."""
    best, *others = minima
    parts = [f"{best.starts} ended here"]
    parts += [f"{m.starts} in another minimum, chi-square {m.chi_square:.3g} higher" for m in others]
    left = starts - sum(m.starts for m in minima)
    return f"{starts} starts: " + "; ".join([*parts, *[f"{left} given up as worse"] * bool(left)])


def parameter_table(title: str, estimates: Sequence[Estimate], truth: Module | None = None) -> Table:
    """Fitted values with standard errors, and the true values by name if the true law (on its rig) is known."""
    columns = [Column("parameter"), Column("unit"), Column("value", spec=".5g"), Column("standard error", spec=".2g")]
    biased = any(e.bias is not None for e in estimates)
    columns += [Column("bias by input noise", spec="+.2g")] * biased
    spread = any(e.spread is not None and e.spread > WIDER * e.standard_error for e in estimates)
    columns += [Column("with what the law misses", spec=".2g")] * spread
    columns += [Column("true", spec=".5g"), Column("(value − true)/se", spec="+.1f")] * (truth is not None)
    columns += [Column("95 % from", spec=".5g"), Column("to", spec=".5g"), Column("note"), Column("meaning")]
    of_truth = None if truth is None else free_parameters(truth)
    true_values = dict(zip(of_truth.names, np.asarray(of_truth.values).tolist(), strict=True)) if of_truth else {}
    rows: list[tuple[Cell, ...]] = []
    for e in estimates:
        value, error = rounded(e.value, e.standard_error)
        row: tuple[Cell, ...] = (e.name, e.unit or "–", Shown(e.value, value), Shown(e.standard_error, error))
        row += (e.bias,) * biased + (e.spread,) * spread
        if truth is not None:
            true = true_values.get(e.name)
            row += (true, None if true is None else (e.value - true) / e.standard_error)
        low, high = (Shown(end, rounded(end, e.standard_error)[0]) for end in e.interval)
        rows.append((*row, low, high, e.remark, e.meaning))
    return Table(title, tuple(columns), tuple(rows))
