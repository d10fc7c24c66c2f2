"""Limits of a specification, and whether measurements keep them."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import final

import numpy as np

from jaxdamp import _checks
from jaxdamp._documents import read_text
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Contents, Table, plain
from jaxdamp.bench.evaluation.curve import DIRECTIONS, Measurement, at_velocity
from jaxdamp.bench.headers import split_header
from jaxdamp.bench.layout import DELIMITERS, Layout, columns_of, split
from jaxdamp.bench.raw import RawColumn
from jaxdamp.bench.units import conversion, ratio


NUMBERS = ("minimum", "maximum", "velocity")
COLUMNS = ("quantity", *NUMBERS, "setting", "record")


UNITS = {
    "gas force": "N",
    "gas rate": "N/m",
    "friction": "N",
    "rebound/compression ratio": "",
    "mean force": "N",
    "static force": "N",
    "energy per cycle": "J",
    "equivalent damping": "N s/m",
    "hysteresis area": "W",
    "hysteresis width": "N",
} | {
    quantity: unit
    for name in DIRECTIONS
    for quantity, unit in {
        f"{name} force": "N",
        f"mid-stroke {name} force": "N",
        f"{name} velocity": "m/s",
        f"{name} knee velocity": "m/s",
        f"{name} rate": "N s/m",
        f"{name} low-speed rate": "N s/m",
        f"{name} high-speed rate": "N s/m",
        f"{name} bleed rate": "N s/m",
    }.items()
}  # of each quantity that an evaluation may hold

_STATIC = ("gas force", "static force")  # mostly negative, but an offset of the load cell may turn them
_SIGNS = dict.fromkeys(_STATIC, -1.0) | {
    quantity: sign
    for name, sign in DIRECTIONS.items()
    for quantity in (f"{name} force", f"mid-stroke {name} force", f"{name} velocity")
}  # that quantities usually have, as the library counts


@dataclass(frozen=True)
class Limit:
    """The least and the largest value that a quantity may have, with the library's signs and in SI.

    Compression and gas forces are negative: at most 400 N in compression is `minimum=-400.0`.

    Arguments:
        quantity: such as "rebound force" or "gas force".
        minimum: least value; None for none.
        maximum: largest value; None for none.
        velocity: at which [m/s], positive, for forces at stated velocities.
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
        if self.velocity is not None:
            _checks.positive("velocity", self.velocity, "The direction is in the quantity.")
        for name, bound in (("minimum", self.minimum), ("maximum", self.maximum)):
            if bound is not None:
                _checks.finite(name, bound, "Leave it out where there is no limit.")
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

    def _is_turned(self, value: float) -> bool:
        """Whether a value has the usual sign of its quantity, and every bound the other one."""
        sign = _SIGNS.get(self.quantity, 0.0)
        bounds = [bound for bound in (self.minimum, self.maximum) if bound is not None]
        return sign * value > 0.0 and all(sign * bound < 0.0 for bound in bounds)

    def _remedy(self) -> str:
        unit, word = UNITS[self.quantity], "positive" if _SIGNS[self.quantity] > 0.0 else "negative"
        turned = {"minimum": self.maximum, "maximum": self.minimum}
        bounds = (f"{name} {-bound:g} {unit}" for name, bound in turned.items() if bound is not None)
        other = "" if None not in turned.values() else ", or give both bounds"
        return f"A {self.quantity} counts {word}: write {' and '.join(bounds)}{other}"


@final
@dataclass(frozen=True, eq=False, repr=False)
class LimitCheck(AbstractResult):
    """Measurements beside their limits.

    Attributes:
        results: each limit with a measurement that it holds for; None where nothing was measured.
        reach: at which velocities the records give forces, in words.
    """

    results: tuple[tuple[Limit, Measurement | None], ...]
    reach: str = ""

    @classmethod
    def of(cls, measurements: Sequence[Measurement], limits: Iterable[Limit], reach: str = "") -> "LimitCheck":
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
            _refuse_turned(limit, [m.value for m in mine if np.isfinite(m.value)])
            results += [(limit, m) for m in mine] or [(limit, None)]
        if not results:
            _checks.refuse("limits", "hold at least one limit", "empty")
        return cls(tuple(results), reach)

    @property
    def passed(self) -> bool:
        """Whether all limits are kept; one whose quantity was not measured is not."""
        return all(m is not None and limit.kept_by(m.value) for limit, m in self.results)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The limits that are not kept, whose quantity was not measured, or whose sign is not that of the values."""
        said = []
        for (limit, m), row in zip(self.results, self.table().records(), strict=True):
            turned = m is not None and limit._is_turned(m.value)
            if row["verdict"] != "passed" or turned:
                at = "" if row["velocity"] is None else f" at {row['velocity']:.4g} m/s"
                where = row["record"] or ("" if row["setting"] in ("", "*") else f"setting {row['setting']}")
                of = f" of {where}" if where else ""
                why = f": {self.reach}" if at and self.reach and row["verdict"] == "NOT MEASURED" else ""
                if m is not None and turned:
                    why = f"; the limit has another sign than the measured {m.value:.4g} {m.unit}. {limit._remedy()}"
                said.append(f"{row['quantity']}{at}{of}: {row['verdict']}{why}.")
        return tuple(said)

    @property
    def summary(self) -> str:
        """How many limits are kept."""
        passed = sum(m is not None and limit.kept_by(m.value) for limit, m in self.results)
        return f"{passed} of {len(self.results)} limits are kept."

    plot = drawn_by("limit_check", "Each measured value between its limits.")

    def table(self) -> Table:
        """A row for each limit and measurement, with the verdict."""
        columns = (Column("quantity"), Column("velocity", "m/s"), Column("setting"), Column("record"), Column("unit"))
        columns += (Column("minimum"), Column("value"), Column("maximum"), Column("verdict"))
        rows = []
        for limit, m in self.results:
            measured = m is not None and bool(np.isfinite(m.value))
            verdict = ("passed" if m and limit.kept_by(m.value) else "FAILED") if measured else "NOT MEASURED"
            low, high, velocity = (
                None if x is None else float(x) for x in (limit.minimum, limit.maximum, limit.velocity)
            )
            start = (limit.quantity, velocity, m.setting if m else limit.setting, m.record if m else limit.record)
            unit = m.unit if m else UNITS.get(limit.quantity, "")
            rows.append((*start, unit, low, m.cell if m else None, high, verdict))
        return Table(f"Limits: {'all passed' if self.passed else 'not all passed'}", columns, tuple(rows))

    def content(self) -> Contents:
        """Verdict and rows as plain data."""
        return {"passed": self.passed, "results": plain(self.table().records())}

    def __repr__(self) -> str:
        return str(self.table())


def _refuse_turned(limit: Limit, values: Sequence[float]) -> None:
    """Refuse a force or velocity of a direction that no value can exceed, since the bound has the other sign.

    One that fails is left to fail. Gas and static forces may have either sign: of them there is a warning.
    """
    vacuous = values and all(limit._is_turned(value) and limit.kept_by(value) for value in values)
    if vacuous and limit.quantity not in _STATIC:
        name, bound = ("maximum", limit.maximum) if limit.minimum is None else ("minimum", limit.minimum)
        unit = UNITS[limit.quantity]
        is_now = f"{name} {bound:g} {unit} for {values[0]:.4g} {unit} of {limit.quantity}"
        _checks.refuse("limits", "have the sign of what is measured", is_now, f"{limit._remedy()}.")


def read_limits(path: str | os.PathLike[str]) -> tuple[Limit, ...]:
    """Limits from a CSV file with the columns quantity, minimum, maximum and, as needed, velocity, setting, record.

    Values have the library's signs: compression and gas forces are negative; velocities are positive. They have the
    unit in the header of their column, such as `maximum [kN]`, or, without one, are in SI. An empty cell is no limit.
    Columns are separated by commas, semicolons, tabs or vertical bars; decimals may have a comma where that does not
    separate columns.

    Arguments:
        path: of the file.

    Raises:
        ValueError: naming file, line and column; a unit that is none of the quantity.
    """
    path = Path(path)
    lines = [(n, line) for n, line in enumerate(read_text(path, "text").splitlines(), 1) if line.strip()]
    delimiter, units = _columns(path, lines[0][1] if lines else "")
    numbers, names = [n for n, _ in lines[1:]], list(units)
    rows = [cells + [""] * (len(names) - len(cells)) for cells in (split(line, delimiter) for _, line in lines[1:])]
    numeric = tuple(i for i, name in enumerate(names) if name in NUMBERS)
    columns = columns_of(path, numbers, [rows], Layout(delimiter, len(names), numeric, numeric, 0)) if rows else []
    limits = []
    for row, (line, cells) in enumerate(zip(numbers, rows, strict=True)):
        read = {names[i]: columns[i] for i in numeric if cells[i]}
        try:
            limits.append(_limit(dict(zip(names, cells, strict=True)), read, row, units))
        except ValueError as error:
            raise ValueError(f"{path}, line {line}: {error}") from error
    return tuple(limits)


def _limit(cells: Mapping[str, str], columns: Mapping[str, RawColumn], row: int, units: Mapping[str, str]) -> Limit:
    """The limit in a row: its cells, and the columns of which it has numbers."""
    values: dict[str, float | None] = dict.fromkeys(NUMBERS)
    for name, column in columns.items():
        if row in column.faults:
            raise ValueError(f"the {name} is {cells[name]!r}, which is no number.")
        size = _size(units[name], name, cells["quantity"])
        values[name] = float(np.asarray(column.values, float)[row]) * size
    return Limit(cells["quantity"], **values, setting=cells.get("setting") or "*", record=cells.get("record", ""))


def _columns(path: Path, top: str) -> tuple[str, dict[str, str]]:
    """The delimiter of a file of limits, and the names of its columns with their units."""
    for delimiter in (mark for mark in DELIMITERS if mark != " "):
        units = {name.lower(): unit or "" for name, unit in map(split_header, split(top, delimiter))}
        if "quantity" in units:
            break
    else:
        raise ValueError(f"{path}, line 1: there is no column 'quantity'. The columns are {', '.join(COLUMNS)}.")
    for name in units:
        if name not in COLUMNS:
            raise ValueError(f"{path}, line 1: column {name!r} is unknown. The columns are {', '.join(COLUMNS)}.")
    return delimiter, units


def _size(written: str, column: str, quantity: str) -> float:
    """The unit of a column in that of a velocity or of the quantity that a row limits; 1 where it has none."""
    if written in ("", "-"):
        return 1.0
    if column != "velocity":
        _checks.one_of("quantity", quantity, UNITS)
    unit = "m/s" if column == "velocity" else UNITS[quantity]
    role = {"N": "force", "m/s": "velocity"}.get(unit)
    factor = conversion(role, written) if role else None
    size = factor.factor if factor else ratio(written, unit)
    if size is None:
        of = "a velocity" if column == "velocity" else repr(quantity)
        must = f"have a unit of {of} in the header, such as {unit!r}" if unit else f"have no unit for {of}"
        _checks.refuse(column, must, repr(written), "Values of a column without a unit are in SI.")
    return size
