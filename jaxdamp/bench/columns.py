"""Which column of a table is which quantity, and in which unit."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import NoReturn

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting
from jaxdamp.bench.tables import Table
from jaxdamp.bench.units import SI, USUAL, Conversion, conversion, named_conversion


ROLES = tuple(SI)
_WORDS = {
    "time": ("time", "zeit", "elapsed", "clock", "t"),
    "stroke": (
        "stroke",
        "displacement",
        "disp",
        "position",
        "pos",
        "travel",
        "weg",
        "hub",
        "lvdt",
        "extension",
        "x",
        "s",
    ),
    "velocity": ("velocity", "vel", "geschwindigkeit", "xdot", "speed", "v"),
    "force": ("force", "load", "kraft", "frc", "loadcell", "f"),
    "temperature": ("temperature", "temp", "temperatur", "thermocouple", "t"),
}
_NOT_MEASURED = {"setpoint", "command", "cmd", "demand", "target", "soll", "reference", "ref", "error"}


@dataclass(frozen=True)
class Column:
    """One quantity of a table: where it stands, what its header says and how to bring it to SI."""

    role: str
    index: int
    header: str
    conversion: Conversion


def split_header(header: str) -> tuple[str, str | None]:
    """Name and unit in a header that sets the unit apart: in brackets, behind a comma or behind a slash.

    >>> split_header("Displacement, in"), split_header("force [N]"), split_header("v/(m/s)"), split_header("x_mm")
    (('Displacement', 'in'), ('force', 'N'), ('v', 'm/s'), ('x_mm', None))
    """
    bracket = re.fullmatch(r"(.*?)\s*/?\s*[\[({<]\s*([^\[\](){}<>]*?)\s*[\])}>]", header)
    if bracket:
        return bracket[1].strip(), bracket[2] or None
    for mark in (r"\s*,\s*", r"\s+/\s+", r"/"):
        parts = re.split(mark, header, maxsplit=1)
        if len(parts) == 2 and all(parts) and not (mark == "/" and re.search(r"[_\s]", parts[0])):
            return parts[0].strip(), parts[1].strip()
    return header.strip(), None


def _tail_unit(name: str, role: str) -> tuple[str, Conversion] | None:
    """The unit behind an underscore or a space, the longest that is one: "v_mm_s" is mm/s."""
    pieces = re.split(r"[_\s]+", name)
    for start in range(1, len(pieces)):
        found = conversion(role, "_".join(pieces[start:]))
        if found is not None:
            return "_".join(pieces[:start]), found
    return None


def _words(name: str) -> list[str]:
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return [word.lower() for word in re.split(r"[^A-Za-zÀ-ÿ]+", apart) if word]


def role_of(header: str, unit: str = "") -> str | None:
    """The quantity that a header names; its unit decides between several ("T_degC" is no time).

    Whole words count more than single letters, and the last word more than those before it, as in "load cell
    temperature". Columns of set points are none.
    """
    name, written = split_header(header)
    written = unit or written
    words = _words(name)
    if _NOT_MEASURED.intersection(words):
        return None
    long = [role for word in reversed(words) for role in ROLES if len(word) > 1 and word in _WORDS[role]]
    short = [role for role in ROLES if words and words[0] in _WORDS[role] and len(words[0]) == 1]
    fitting = [
        role for role in long + short if (conversion(role, written) if written else _tail_unit(name, role)) is not None
    ]
    if fitting:
        return fitting[0]
    return (long + (short if len(words) <= 2 else []) or [None])[0]


def find_columns(
    table: Table,
    columns: Mapping[str, str | int | None] | None = None,
    units: Mapping[str, str] | None = None,
) -> dict[str, Column]:
    """Assign the columns of a table to time, stroke, velocity, force and temperature.

    Arguments:
        table: the table read from a file.
        columns: quantity to header or number of the column (from 0); None means that the file's column is not used.
        units: quantity to unit; wins over the header.

    Raises:
        ValueError: a quantity is missing or named by two columns, or a unit is missing or unknown.
    """
    columns, units = dict(columns or {}), dict(units or {})
    for role in columns:
        _checks.one_of("columns", role, ROLES)
    for role in units:
        _checks.one_of("units", role, ROLES)
    if not table.names and not columns:
        numbers = Setting("columns", {"time": 0, "stroke": 1, "force": 2})
        names = Setting("units", {"time": "s", "stroke": "mm", "force": "N"})
        raise ArgumentError(
            f"{table.file} has no header row, so its columns have no names: pass their numbers and units, for example "
            f"{numbers}, {names}.",
            numbers,
            names,
        )
    found = {}
    for role in ROLES:
        index = _given(table, role, columns[role]) if role in columns else _named(table, role, columns)
        if index is not None:
            found[role] = _with_unit(table, role, index, units)
    for role in ("stroke", "force"):
        if role not in found:
            _refuse_missing(table, role, found)
    return found


def _label(table: Table, index: int) -> str:
    return table.names[index] if table.names else f"number {index}"


def _given(table: Table, role: str, wanted: str | int | None) -> int | None:
    if wanted is None:
        return None
    count = table.values.shape[1]
    if isinstance(wanted, int):
        if not 0 <= wanted < count:
            given = Setting("columns", {role: wanted})
            raise ArgumentError(f"{given}: {table.file} has columns 0 to {count - 1}.", given)
        return wanted
    given = Setting("columns", {role: wanted})
    hits = [i for i, name in enumerate(table.names) if name == wanted]
    hits = hits or [i for i, name in enumerate(table.names) if split_header(name)[0].lower() == wanted.strip().lower()]
    if len(hits) == 1:
        return hits[0]
    if hits:
        raise ArgumentError(f"{given} fits columns {hits} of {table.file}: pass the number of one of them.", given)
    near = get_close_matches(wanted, table.names, 1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    names = ", ".join(map(repr, table.names)) or "no header"
    raise ArgumentError(f"{given}: {table.file} has {names}.{hint}", given)


def _named(table: Table, role: str, columns: Mapping[str, str | int | None]) -> int | None:
    taken = {_given(table, r, wanted) for r, wanted in columns.items()}
    unit_row = table.unit_row or ("",) * len(table.names)
    hits = [
        i
        for i, (name, unit) in enumerate(zip(table.names, unit_row, strict=True))
        if i not in taken and role_of(name, unit) == role
    ]
    if len(hits) > 1:
        names = [table.names[i] for i in hits]
        choice = Setting("columns", {role: names[0]})
        raise ArgumentError(
            f"{table.file}: the columns {' and '.join(map(repr, names))} could all be the {role}. Choose one: "
            f"{choice}.",
            choice,
        )
    return hits[0] if hits else None


def _with_unit(table: Table, role: str, index: int, units: Mapping[str, str]) -> Column:
    header = _label(table, index)
    where = f"{table.file}, column {header!r}"
    if role in units:
        return Column(role, index, header, named_conversion(role, units[role], where))
    if table.unit_row and table.unit_row[index]:
        return Column(role, index, header, named_conversion(role, table.unit_row[index], where))
    name, written = split_header(header) if table.names else (header, None)
    if written:
        return Column(role, index, header, named_conversion(role, written, where))
    tail = _tail_unit(name, role)
    if tail:
        return Column(role, index, header, tail[1])
    example = Setting("units", {role: USUAL[role][0]})
    raise ArgumentError(
        f"{where} ({role}) names no unit, and none is assumed. Pass it, for example {example}, or put it into the "
        f'header: "{name} [{USUAL[role][0]}]".',
        example,
    )


def _refuse_missing(table: Table, role: str, found: Mapping[str, Column]) -> NoReturn:
    """Refuse a table without a stroke or a force; propose a column that is no other quantity."""
    names = ", ".join(map(repr, table.names)) or f"{table.values.shape[1]} columns without names"
    taken = {column.index for column in found.values()}
    left = [i for i in range(table.values.shape[1]) if i not in taken]
    free = [i for i in left if not table.names or not _is_other(table, i, role)]
    if not free:
        raise ArgumentError(
            f"{table.file} has no column for the {role}: its columns are {names}, all of them other quantities. A "
            f"record needs the {role}: export the file again with it."
        )
    choice = Setting("columns", {role: table.names[free[0]] if table.names else free[0]})
    raise ArgumentError(
        f"{table.file} has no column for the {role}: its columns are {names}. Name it, for example {choice}.", choice
    )


def _is_other(table: Table, index: int, role: str) -> bool:
    """Whether the header or the unit of a column says that it is another quantity."""
    unit = table.unit_row[index] if table.unit_row else ""
    header = table.names[index]
    name, written = split_header(header)
    said = role_of(header, unit)
    unit = unit or written or ""
    foreign = bool(unit) and conversion(role, unit) is None
    return foreign or (said is not None and said != role) or bool(_NOT_MEASURED.intersection(_words(name)))
