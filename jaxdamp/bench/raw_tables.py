"""What readers of several formats share: their libraries, and channels put together to tables by length and clock."""

import importlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from jaxdamp.bench.headers import role_of
from jaxdamp.bench.raw import RawColumn, RawTable


Untyped: TypeAlias = Any  # an object of a library that states no types


def library(module: str, file: Path) -> ModuleType:
    """A library that only this format needs."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(
            f"{file}: {file.suffix} files need the library {module.split('.')[0]!r}. Install it with "
            "pip install 'jaxdamp[io]', or export the record as CSV."
        ) from error


class Clock(NamedTuple):
    """The uniform instants of a channel: the first one and the step, both in seconds."""

    start: float
    step: float


def tables_by_clock(
    file: Path,
    record: str,
    columns: Sequence[RawColumn],
    clocks: Sequence[Clock | None] = (),
    notes: Sequence[str] = (),
) -> list[RawTable]:
    """The channels of a record as tables of its name, one for each number of samples and clock; none if no two fit.

    The table with most channels is the first, the others are to be brought onto its clock (`one_clock`). Channels
    without a clock have that of the others of their length, if it is only one, and a channel of the time wins over it.
    """
    tables = [
        RawTable(file, tuple(group), record, notes=tuple(notes))
        for group in _groups(columns, [*clocks] or [None] * len(columns))
    ]
    tables.sort(key=lambda table: (len(table.columns), len(table)), reverse=True)
    return tables if tables and len(tables[0].columns) > 1 else []


def _groups(columns: Sequence[RawColumn], clocks: Sequence[Clock | None]) -> list[list[RawColumn]]:
    """The channels of each number of samples and clock, with the instants of the clock."""
    lengths = [len(column.values) for column in columns]
    timed = {n for n, column in zip(lengths, columns, strict=True) if _is_time(column)}
    known = {count: {c for n, c in zip(lengths, clocks, strict=True) if n == count and c} for count in lengths}
    groups: dict[tuple[int, Clock | None], list[RawColumn]] = {}
    for column, count, clock in zip(columns, lengths, clocks, strict=True):
        if count in timed:
            clock = None
        elif len(known[count]) == 1:
            (clock,) = known[count]
        groups.setdefault((count, clock), []).append(column)
    for (count, clock), group in groups.items():
        if clock is not None:
            group.insert(1, RawColumn("time", clock.start + clock.step * np.arange(count), "s"))
    return list(groups.values())


def _is_time(column: RawColumn) -> bool:
    """Whether a channel holds the instants of others: it is named so, and increases."""
    rises = column.is_text or bool(np.all(np.diff(np.asarray(column.values)) > 0))
    return rises and role_of(column.name, column.unit) == "time"


def alone(tables: list[RawTable]) -> list[RawTable]:
    """The tables of a file; the record that is the only one of its file needs no name."""
    return [replace(table, record="") for table in tables] if len({table.record for table in tables}) == 1 else tables


def apart(names: Sequence[str]) -> list[str]:
    """Names with a number behind those that are there several times.

    >>> apart(["cold", "warm", "warm"])
    ['cold', 'warm 2', 'warm 3']
    """
    return [f"{name} {number}".strip() if names.count(name) > 1 else name for number, name in enumerate(names, 1)]
