"""From the tables of a file to those of its records: tests set apart, channels of several clocks brought onto one."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jaxdamp._checks import ArgumentError
from jaxdamp.bench.clock import FEWEST, check_numbers, check_order, gaps
from jaxdamp.bench.columns import Choice, column_of, find_one, is_record, lacking
from jaxdamp.bench.headers import split_header
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.raw import RawColumn, RawTable, apart, in_words


_ONE_GROUP = "Export the channels of a record on one clock, in one group."
_SLOW = ("temperature", "command")  # of which straight lines between few samples are good enough


class _Clock(NamedTuple):
    """The instants [s] of a table, and the number of their column."""

    instants: Samples
    column: int


def one_record(parts: Sequence[RawTable], choice: Choice) -> list[RawTable]:
    """The tables of one name as a record: that with stroke and force, or these from two of them on one clock.

    Temperature and command of the others are brought onto its clock, and a note names what is left out. There are
    several records if several tables have stroke and force.
    """
    if len(parts) == 1:
        return [*parts]
    name = parts[0].record
    tables = on_one_clock([replace(part, record=_label(part)) for part in parts], choice)
    complete = [table for table in tables if not lacking(table, choice)]
    complete = [table for table in complete if len(table) >= FEWEST] or complete
    if not complete:
        _refuse_apart(parts[0].where, tables, choice)
    main = complete or tables[:1]
    others = [table for table in tables if table not in main]
    if len(main) == 1:
        main[0], others = _with_slow(main[0], others, choice)
    notes = _left_out(main[0], others)
    names = apart([name] * len(main))
    return [replace(t, record=n, notes=(*t.notes, *notes)) for t, n in zip(main, names, strict=True)]


def main_tables(tables: Sequence[RawTable]) -> list[RawTable]:
    """Of the tables of one name the first one, which has most channels, with a note on those of other channels."""
    main = []
    for name in dict.fromkeys(table.record for table in tables):
        first, *others = [table for table in tables if table.record == name]
        parts = [table for table in others if not {*_names(table)} & {*_names(first)}]
        main.append(replace(first, notes=(*first.notes, *_left_out(first, parts))))
        main += [table for table in others if table not in parts]
    return main


def _left_out(table: RawTable, others: Sequence[RawTable]) -> list[str]:
    """A note on the channels of tables that are no part of a record."""
    channels = ", ".join(f"{name} ({len(other)})" for other in others for name in _names(other))
    note = f"left out, because they do not have the {len(table)} samples or the clock of the others: {channels}"
    return [note] * bool(others)


def _with_slow(table: RawTable, others: Sequence[RawTable], choice: Choice) -> tuple[RawTable, list[RawTable]]:
    """A record with temperature and command of other tables on its clock, and the tables of which nothing is used."""
    unused = []
    for other in others:
        longer = _with_channels(table, other, choice)
        table, left = (table, [other]) if longer is None else (longer, [])
        unused += left
    return table, unused


def _with_channels(table: RawTable, other: RawTable, choice: Choice) -> RawTable | None:
    """A record with temperature and command of another table, where this has a clock that covers that of the record."""
    clock, slow = _clock(table, choice), _clock(other, choice)
    roles = [role for role in _SLOW if is_record(other, choice, (role,)) and not is_record(table, choice, (role,))]
    indices = [index for role in roles if (index := _one(other, role, choice)) is not None]
    channels = [column for column in map(other.columns.__getitem__, indices) if not column.is_text]
    if not channels or clock is None or slow is None or not _covers(slow.instants, clock.instants):
        return None
    names = " and ".join(repr(column.name) for column in channels)
    left_out = [column.name for column in other.columns if column not in (*channels, other.columns[slow.column])]
    rate = 1.0 / np.median(np.diff(slow.instants))
    note = f"{names} brought from a clock of {rate:.4g} Hz onto that of the record by straight lines"
    note += f"; not used of that clock: {', '.join(left_out)}" * bool(left_out)
    brought = _straight(slow.instants, clock.instants, channels)
    return replace(table, columns=(*table.columns, *brought), notes=(*table.notes, note))


def _straight(clock: Samples, instants: Samples, columns: Sequence[RawColumn]) -> list[RawColumn]:
    """Channels at other instants than their own, by straight lines."""
    return [RawColumn(c.name, np.interp(instants, clock, np.asarray(c.values, np.float64)), c.unit) for c in columns]


def _covers(clock: Samples, instants: Samples) -> bool:
    """Whether a clock runs without gap over these instants, but for a step at either end."""
    steps = np.diff(clock)
    if np.any(steps <= 0.0) or gaps(clock).size:
        return False
    step = float(np.median(steps))
    return bool(clock[0] - step <= instants[0] and instants[-1] <= clock[-1] + step)


def _refuse_apart(where: str, tables: Sequence[RawTable], choice: Choice) -> None:
    """Refuse a record whose stroke and force cannot be brought together, as nothing tells when they were taken."""
    lengths = {
        role: [len(table) for table in tables if role not in lacking(table, choice)] for role in ("stroke", "force")
    }
    if all(lengths.values()):
        counts = " and ".join(f"the {role} has {' or '.join(map(str, n))} samples" for role, n in lengths.items())
        raise ArgumentError(f"{where}: {counts}, and not both have a time. {_ONE_GROUP}")


def on_one_clock(tables: Sequence[RawTable], choice: Choice) -> list[RawTable]:
    """The tables of a file; those that hold only the stroke and only the force as one, on the clock with more samples.

    The other channels are interpolated by cubics over the time that both clocks cover. Files with a table that has
    both, and tables without a time, stay as they are.
    """
    motion = "velocity" if choice.stroke_from_velocity else "stroke"
    moved, loaded = ([table for table in tables if is_record(table, choice, (r,))] for r in (motion, "force"))
    together = [*moved, *loaded]
    clocks = [clock for table in together if (clock := _clock(table, choice)) is not None]
    if not (moved and loaded) or {*moved} & {*loaded} or len(clocks) < len(together):
        return list(tables)
    names = f"the {motion} in {_records(moved)} and the force in {_records(loaded)}"
    if len(together) > 2:
        raise ArgumentError(
            f"{together[0].file}: which groups of different clocks belong together is not clear: {names}. {_ONE_GROUP}"
        )
    _refuse_text(together, (motion, "force"), choice)
    instants, note = _common_instants(together, [clock.instants for clock in clocks], names)
    return [_together(together, clocks, instants, note), *(table for table in tables if table not in together)]


def _refuse_text(tables: Sequence[RawTable], roles: Sequence[str], choice: Choice) -> None:
    """Refuse text in a channel of its table, which cannot be brought onto another clock."""
    for table, role in zip(tables, roles, strict=True):
        index = find_one(table, role, choice)
        if index is not None and table.columns[index].is_text:
            column_of(table, role, index, choice)


def _together(tables: Sequence[RawTable], clocks: Sequence[_Clock], instants: Samples, note: str) -> RawTable:
    """The channels of tables at the same instants."""
    columns, notes = [RawColumn("time", instants, "s")], []
    for table, clock in zip(tables, clocks, strict=True):
        notes += [said for said in table.notes if said not in notes]
        others = [column for index, column in enumerate(table.columns) if index != clock.column]
        columns += [_at(instants, clock.instants, column) for column in others if not column.is_text]
        texts = ", ".join(repr(column.name) for column in others if column.is_text)
        notes += [f"left out, because text has no values between its samples: {texts}"] * bool(texts)
    return RawTable(tables[0].file, tuple(columns), notes=(*notes, note))


def _common_instants(tables: Sequence[RawTable], clocks: Sequence[Samples], names: str) -> tuple[Samples, str]:
    """The instants of the finest clock that all clocks cover, and a note."""
    for table, clock in zip(tables, clocks, strict=True):
        check_numbers(clock, "time", table.where, table.place)
        check_order(clock, table.where, table.place)
        if gaps(clock).size:
            raise ArgumentError(f"{table.where}: the clock has gaps, over which nothing is interpolated. {_ONE_GROUP}")
    start, stop = max(clock[0] for clock in clocks), min(clock[-1] for clock in clocks)
    finest = max(clocks, key=lambda clock: len(clock) / (clock[-1] - clock[0]))
    common = finest[(finest >= start) & (finest <= stop)]
    if len(common) < FEWEST:
        raise ArgumentError(f"{tables[0].file}: the clocks of {names} hardly overlap. {_ONE_GROUP}")
    return common, (
        f"{names}, on different clocks: brought onto that of {1 / np.median(np.diff(finest)):.4g} Hz by cubics, "
        f"from {start:.4g} to {stop:.4g} s, which both cover"
    )


def _records(tables: Sequence[RawTable]) -> str:
    return ", ".join(repr(table.record) for table in tables)


def _names(table: RawTable) -> list[str]:
    """The channels of a table but for its clock."""
    return [column.name for column in table.columns if (column.name, column.unit) != ("time", "s")]


def _label(table: RawTable) -> str:
    """The name of a table among others of its record: its first channels."""
    names = _names(table)
    return f"{table.record} {', '.join(names[:3])}{', …' * (len(names) > 3)}".strip()


def _one(table: RawTable, role: str, choice: Choice) -> int | None:
    """The number of the column of a quantity; None without one, and where it is doubtful."""
    try:
        return find_one(table, role, choice)
    except ArgumentError:
        return None


def _clock(table: RawTable, choice: Choice) -> _Clock | None:
    """The instants of a table by its time; None without one in numbers with a unit."""
    index = _one(table, "time", choice)
    if index is None or len(table) < 2 or table.columns[index].faults:
        return None
    try:
        conversion = column_of(table, "time", index, choice).conversion
    except ArgumentError:
        return None
    return None if conversion is None else _Clock(conversion(np.asarray(table.columns[index].values)), index)


def _at(common: np.ndarray, clock: np.ndarray, column: RawColumn) -> RawColumn:
    """A channel at the instants of another clock; missing there where one of the samples around is missing."""
    from scipy.interpolate import CubicSpline  # takes a second to import, and few files need it

    values = np.asarray(column.values, np.float64)
    inside = (clock >= common[0]) & (clock <= common[-1])
    if np.array_equal(clock[inside], common):
        return RawColumn(column.name, values[inside], column.unit)
    good = np.isfinite(values)
    if np.count_nonzero(good) < 2:
        return RawColumn(column.name, np.full(len(common), np.nan), column.unit)
    holes = ~np.isfinite(np.interp(common, clock, values))
    smooth = CubicSpline(clock[good], values[good])(common)
    return RawColumn(column.name, np.where(holes, np.nan, smooth), column.unit)


_TEST_NAMES = {
    "test",
    "test no",
    "test number",
    "run",
    "run no",
    "run number",
    "cycle set",
    "versuch",
    "messung",
    "record",
}
_NEAR_START = 0.05  # of the time of a test, from its start, within which the next one starts
_MOST_TESTS = 500  # tests in a file


def tests_apart(table: RawTable, choice: Choice) -> list[RawTable]:
    """The tests of a table, each a table of its own; the table itself where it holds one.

    A test ends where the time falls back to where it started and, if there is a column of tests, where its number
    changes. Tests by such a column that are too short for a record are left out, and the notes of the others say so.
    """
    numbered = _column_of_tests(table)
    ends = _changes(np.asarray(table.columns[numbered].values)) if numbered is not None else _restarts(table, choice)
    bounds = [0, *ends, len(table)]
    sizes = np.diff(bounds)
    if not ends or len(bounds) > _MOST_TESTS or (min if numbered is None else max)(sizes) < FEWEST:
        return [table]
    why = "the time starts again" if numbered is None else f"column {table.names[numbered]!r} changes"
    parts, short = [], []
    for number, (start, stop) in enumerate(itertools.pairwise(bounds), 1):
        name = f"test {number}" if numbered is None else f"test {in_words(table.columns[numbered].values[start])}"
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
        if (
            name in _TEST_NAMES
            and not column.faults
            and 0 < len(_changes(np.asarray(column.values))) < len(table) / FEWEST
        ):
            return index
    return None


def _changes(values: np.ndarray) -> list[int]:
    return (np.flatnonzero(values[1:] != values[:-1]) + 1).tolist()


def _restarts(table: RawTable, choice: Choice) -> list[int]:
    """Where the time falls back to nearly where it started."""
    index = _one(table, "time", choice)
    if index is None or table.columns[index].is_text or table.columns[index].faults:
        return []
    time = np.asarray(table.columns[index].values)
    back = np.flatnonzero(np.diff(time) < 0.0) + 1
    starts = [0, *back.tolist()]
    for start, following in zip(starts[:-1], back.tolist(), strict=True):
        if abs(time[following] - time[start]) > _NEAR_START * (time[following - 1] - time[start]):
            return []
    return back.tolist()


def _part(table: RawTable, rows: slice, numbered: int | None) -> RawTable:
    """Some rows of a table, without the column that numbers the tests."""
    columns = (column._rows(rows) for index, column in enumerate(table.columns) if index != numbered)
    return replace(table, columns=tuple(columns), lines=table.lines[rows])
