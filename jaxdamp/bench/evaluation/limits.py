"""Limits of a specification, and which measurements keep them."""

import csv
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import final

import numpy as np

from jaxdamp import _checks
from jaxdamp._documents import read_text
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Contents, Table, plain
from jaxdamp.bench.evaluation.measurements import Measurement, at_velocity


COLUMNS = ("quantity", "minimum", "maximum", "velocity", "setting", "record")


@dataclass(frozen=True)
class Limit:
    """The least and the largest value that a quantity may have, with the library's signs and in SI.

    Arguments:
        quantity: such as "rebound force" or "gas force".
        minimum: least value; None for none.
        maximum: largest value; None for none.
        velocity: at which [m/s], for forces at stated velocities.
        setting: name or pattern of the settings that it holds for.
        record: name or pattern of the records; empty for the quantities of a setting.
    """

    quantity: str
    minimum: float | None = None
    maximum: float | None = None
    velocity: float | None = None
    setting: str = "*"
    record: str = ""

    def __post_init__(self) -> None:
        if self.minimum is None and self.maximum is None:
            _checks.refuse("minimum", "be given, or a maximum", None)
        if self.minimum is not None and self.maximum is not None and self.minimum > self.maximum:
            _checks.refuse("minimum", f"be at most the maximum, {self.maximum:g}", self.minimum)

    def holds_for(self, measurement: Measurement) -> bool:
        """Whether it is a limit of this measurement."""
        named = not self.record or fnmatchcase(measurement.record, self.record)
        alike = measurement.quantity == self.quantity and fnmatchcase(measurement.setting, self.setting)
        return alike and at_velocity(measurement, self.velocity) and named

    def kept_by(self, value: float) -> bool:
        """Whether a value lies within the limit; one that is not finite does not."""
        low = self.minimum is None or value >= self.minimum
        return bool(np.isfinite(value)) and low and (self.maximum is None or value <= self.maximum)


@final
@dataclass(frozen=True, eq=False, repr=False)
class LimitCheck(AbstractResult):
    """Measurements beside their limits.

    Attributes:
        results: each limit with a measurement that it holds for; None where nothing was measured.
    """

    results: tuple[tuple[Limit, Measurement | None], ...]

    @classmethod
    def of(cls, measurements: Sequence[Measurement], limits: Iterable[Limit]) -> "LimitCheck":
        """Each limit with the measurements that it holds for; one that was not measured is not kept."""
        results: list[tuple[Limit, Measurement | None]] = []
        quantities = dict.fromkeys(m.quantity for m in measurements)
        for limit in limits:
            mine = [m for m in measurements if limit.holds_for(m)]
            if not mine:
                near = "" if limit.quantity in quantities else _checks.nearest(limit.quantity, quantities)
                if near:
                    hint = f"Did you mean {near!r}?"
                    _checks.refuse("limits", "name quantities that are measured", repr(limit.quantity), hint)
            results += [(limit, m) for m in mine] or [(limit, None)]
        if not results:
            _checks.refuse("limits", "hold at least one limit", "empty")
        return cls(tuple(results))

    @property
    def passed(self) -> bool:
        """Whether all limits are kept; one whose quantity was not measured is not."""
        return all(m is not None and limit.kept_by(m.value) for limit, m in self.results)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The limits that are not kept, or whose quantity was not measured."""
        rows = (row for row in self.table().records() if row["verdict"] != "passed")
        return tuple(f"{row['quantity']} of {row['record'] or row['setting']}: {row['verdict']}." for row in rows)

    @property
    def summary(self) -> str:
        """How many limits are kept."""
        return f"{len(self.results) - len(self.warnings)} of {len(self.results)} limits are kept."

    plot = drawn_by("limit_check", "Each measured value between its limits.")

    def table(self) -> Table:
        """A row for each limit and measurement, with the verdict."""
        columns = (Column("quantity"), Column("velocity", "m/s"), Column("setting"), Column("record"), Column("unit"))
        columns += (Column("minimum"), Column("value"), Column("maximum"), Column("verdict"))
        rows = []
        for limit, m in self.results:
            measured = m is not None and bool(np.isfinite(m.value))
            verdict = ("passed" if m and limit.kept_by(m.value) else "FAILED") if measured else "NOT MEASURED"
            start = (limit.quantity, limit.velocity, m.setting if m else limit.setting, m.record if m else limit.record)
            rows.append((*start, m.unit if m else "", limit.minimum, m.cell if m else None, limit.maximum, verdict))
        return Table(f"Limits: {'all passed' if self.passed else 'not all passed'}", columns, tuple(rows))

    def content(self) -> Contents:
        """Verdict and rows as plain data."""
        return {"passed": self.passed, "results": plain(self.table().records())}

    def __repr__(self) -> str:
        return str(self.table())


def read_limits(path: str | os.PathLike[str]) -> tuple[Limit, ...]:
    """Limits from a CSV file with the columns quantity, minimum, maximum and, as needed, velocity, setting, record.

    Values are in SI with the library's signs: compression and gas forces are negative. An empty cell is no limit.

    Arguments:
        path: of the file.

    Raises:
        ValueError: naming file, line and column.
    """
    path = Path(path)
    rows = csv.DictReader(read_text(path, "text").splitlines(), skipinitialspace=True)
    headers = {header: header.split("[")[0].strip().lower() for header in rows.fieldnames or ()}
    if "quantity" not in headers.values():
        raise ValueError(f"{path}, line 1: there is no column 'quantity'. The columns are {', '.join(COLUMNS)}.")
    for header, name in headers.items():
        if name not in COLUMNS:
            raise ValueError(f"{path}, line 1: column {header!r} is unknown. The columns are {', '.join(COLUMNS)}.")
    limits = []
    for row in rows:
        where, cells = (
            f"{path}, line {rows.line_num}",
            {headers[key]: (text or "").strip() for key, text in row.items() if key},
        )
        low, high, velocity = (_number(cells.get(name, ""), name, where) for name in ("minimum", "maximum", "velocity"))
        words = (cells.get("setting") or "*", cells.get("record", ""))
        try:
            limits.append(Limit(cells["quantity"], low, high, velocity, *words))
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from error
    return tuple(limits)


def _number(text: str, column: str, where: str) -> float | None:
    if not text:
        return None
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{where}: the {column} is {text!r}, which is no number.") from None
