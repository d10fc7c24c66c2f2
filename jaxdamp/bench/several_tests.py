"""Several tests in one table: a column that numbers them, or a time that starts again."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jaxdamp.bench.clock import FEWEST
from jaxdamp.bench.columns import Choice, find_one
from jaxdamp.bench.headers import split_header
from jaxdamp.bench.raw import RawColumn, RawTable


_NAMES = {"test", "test no", "test number", "run", "run no", "run number", "cycle set", "versuch", "messung", "record"}
_NEAR = 0.05  # of the time of a test, from its start, within which the next one starts
_MOST = 500  # tests in a file


def tests_apart(table: RawTable, choice: Choice) -> list[RawTable]:
    """The tests of a table, each a table of its own; the table itself where it holds one.

    A test ends where the time falls back to where it started and, if there is a column of tests, where its number
    changes. Tests by such a column that are too short for a record are left out, and the notes of the others say so.
    """
    numbered = _column_of_tests(table)
    ends = _changes(np.asarray(table.columns[numbered].values)) if numbered is not None else _restarts(table, choice)
    bounds = [0, *ends, len(table)]
    sizes = np.diff(bounds)
    if not ends or len(bounds) > _MOST or (min if numbered is None else max)(sizes) < FEWEST:
        return [table]
    why = "the time starts again" if numbered is None else f"column {table.names[numbered]!r} changes"
    parts, short = [], []
    for number, (start, stop) in enumerate(itertools.pairwise(bounds), 1):
        name = f"test {number}" if numbered is None else f"test {_word(table.columns[numbered].values[start])}"
        if stop - start < FEWEST:
            short.append(f"{name} of the file left out: {stop - start} rows, and a record needs {FEWEST}")
            continue
        part = _part(table, slice(start, stop), numbered)
        note = f"{name} of {len(bounds) - 1} in the file, where {why}"
        parts.append(replace(part, record=f"{table.record} {name}".strip(), notes=(*table.notes, note)))
    names = [part.record for part in parts]
    again = [f"{name} ({number})" if names.count(name) > 1 else name for number, name in enumerate(names, 1)]
    return [replace(p, record=name, notes=(*p.notes, *short)) for p, name in zip(parts, again, strict=True)]


def _column_of_tests(table: RawTable) -> int | None:
    """The column that numbers or names the tests, if each has many rows."""
    for index, column in enumerate(table.columns):
        name = " ".join(split_header(column.name)[0].lower().replace("_", " ").replace(".", "").split())
        if name in _NAMES and not column.faults and 0 < len(_changes(np.asarray(column.values))) < len(table) / FEWEST:
            return index
    return None


def _changes(values: np.ndarray) -> list[int]:
    return (np.flatnonzero(values[1:] != values[:-1]) + 1).tolist()


def _restarts(table: RawTable, choice: Choice) -> list[int]:
    """Where the time falls back to nearly where it started."""
    try:
        index = find_one(table, "time", choice)
    except ValueError:  # it is refused with all else that is wrong
        return []
    if index is None or table.columns[index].is_text or table.columns[index].faults:
        return []
    time = np.asarray(table.columns[index].values)
    back = np.flatnonzero(np.diff(time) < 0.0) + 1
    starts = [0, *back.tolist()]
    for start, following in zip(starts[:-1], back.tolist(), strict=True):
        if abs(time[following] - time[start]) > _NEAR * (time[following - 1] - time[start]):
            return []
    return back.tolist()


def _part(table: RawTable, rows: slice, numbered: int | None) -> RawTable:
    """Some rows of a table, without the column that numbers the tests."""
    columns = []
    for index, column in enumerate(table.columns):
        if index != numbered:
            faults = {row - rows.start: text for row, text in column.faults.items() if rows.start <= row < rows.stop}
            columns.append(RawColumn(column.name, np.asarray(column.values)[rows], column.unit, faults))
    lines: Sequence[int] = table.lines[rows] if len(table.lines) else ()
    return replace(table, columns=tuple(columns), lines=lines)


def _word(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
