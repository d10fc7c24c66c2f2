"""Which column of a table is which quantity, and in which unit."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting
from jaxdamp.bench.clock import is_stamp
from jaxdamp.bench.headers import NOT_MEASURED, ROLES, role_of, signal_unit, split_header, tail_unit, words_in
from jaxdamp.bench.layout import GROUPED, PLAINLY
from jaxdamp.bench.raw import Problems, RawColumn, RawTable
from jaxdamp.bench.units import USUAL, Conversion, conversion, gain_conversion, named_conversion, ratio


REQUIRED = ("stroke", "force")
_OF_MATRIX = re.compile(r"(.*)\[\d+\]")  # the place of a column in a matrix


@dataclass(frozen=True)
class Column:
    """One quantity of a table: where it stands, what its header says and how to bring it to SI.

    The conversion is None for time stamps, which are read as text.
    """

    role: str
    index: int
    header: str
    conversion: Conversion | None

    @property
    def unit(self) -> str:
        """The unit of the file."""
        return "time stamps" if self.conversion is None else self.conversion.unit


@dataclass(frozen=True)
class Choice:
    """What the caller says about the columns, as `BenchFiles` describes it; units win over those of headers."""

    columns: Mapping[str, str | int | None] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    gains: Mapping[str, str] = field(default_factory=dict)
    stroke_from_velocity: bool = False

    def __post_init__(self) -> None:
        for name in ("columns", "units", "gains"):
            _checks.instance(name, getattr(self, name), Mapping, "be a mapping of quantities", "Write a dictionary.")
            for role in getattr(self, name):
                _checks.one_of(name, role, ROLES)

    def asks_for(self, role: str) -> bool:
        """Whether the caller wants this quantity, so that it must not be left out."""
        named = self.columns.get(role) is not None or role in self.units or role in self.gains
        return named or (role == "velocity" and self.stroke_from_velocity)


def find_columns(table: RawTable, choice: Choice) -> tuple[dict[str, Column], tuple[str, ...]]:
    """Assign the columns of a table to time, stroke, velocity, force, temperature and command.

    A quantity that a record can do without, velocity, temperature or command, is left out where its column is
    doubtful, and a note says so, unless the caller asked for it. All that is wrong is refused together.
    """
    if not choice.columns and not (table.is_named and _tells_apart(table)):
        _refuse_unnamed(table)
    columns, notes, problems = {}, [], Problems()
    for role in ROLES:
        with problems.collected(table.where):
            try:
                index, more = _index(table, role, choice)
                column = None if index is None else column_of(table, role, index, choice)
            except ArgumentError as error:
                if role in REQUIRED or role == "time" or choice.asks_for(role):
                    columns[role] = None  # there is one, but it is at fault
                    raise
                notes.append(f"{role} left out: {error}")
                continue
            notes += more
            if column is not None:
                columns[role] = column
    integrated = choice.stroke_from_velocity and "stroke" not in columns
    for role in ("velocity", "force") if integrated else REQUIRED:
        with problems.collected(table.where):
            if role not in columns:
                _refuse_missing(table, role, columns)
    problems.raise_any()
    return columns, tuple(notes)


def _refuse_unnamed(table: RawTable) -> NoReturn:
    """Refuse a table whose columns have no names."""
    why = "holds a matrix" if table.is_named else "has no header row"
    numbers = Setting("columns", {"time": 0, "stroke": 1, "force": 2})
    units = Setting("units", {"time": "s", "stroke": "mm", "force": "N"})
    said = f"{table.where} {why}, so its columns have no names: pass their numbers and units, for example"
    raise ArgumentError(f"{said} {numbers}, {units}.", numbers, units)


def _tells_apart(table: RawTable) -> bool:
    """Whether the names of the columns are more than places in a matrix."""
    places = [_OF_MATRIX.fullmatch(column.name) for column in table.columns]
    return not all(places) or len({place[1] for place in places if place}) == len(places)


def is_record(table: RawTable, choice: Choice, roles: Sequence[str] = REQUIRED) -> bool:
    """Whether a table has one of these quantities, or its columns have no names to tell."""
    if not table.is_named:
        return len(table.columns) > 1
    return any(
        _places(table, choice.columns[role]) if role in choice.columns else _candidates(table, role, choice)
        for role in roles
    )


def lacking(table: RawTable, choice: Choice) -> list[str]:
    """The quantities that a record needs and a table has not, a stroke or what it is integrated from first."""
    strokes = ("stroke", "velocity") if choice.stroke_from_velocity else ("stroke",)
    return [roles[0] for roles in (strokes, ("force",)) if not is_record(table, choice, roles)]


def find_one(table: RawTable, role: str, choice: Choice) -> int | None:
    """The number of the column of a quantity; None where there is none or the caller leaves it out."""
    return _index(table, role, choice)[0]


def given_column(table: RawTable, role: str, wanted: str | int, argument: str = "columns") -> int:
    """The number of the column that the caller names for a quantity, by its header or number, in an argument."""

    def said(value: str | int) -> Setting:
        return Setting(argument, {role: value} if argument == "columns" else value)

    names, given = ", ".join(map(repr, table.names)), said(wanted)
    if isinstance(wanted, int):
        if not 0 <= wanted < len(table.columns):
            raise ArgumentError(f"{given}: {table.where} has columns 0 to {len(table.columns) - 1} ({names}).", given)
        return wanted
    hits = _places(table, wanted)
    if len(hits) == 1:
        return hits[0]
    if hits:
        number = said(hits[0])
        same = f"{table.where} has {len(hits)} columns of that name"
        raise ArgumentError(f"{given}: {same}. Give the number: {number}.", given, number)
    near = _checks.nearest(wanted, [*table.names, *(split_header(name)[0] for name in table.names)])
    hint = f" Did you mean {near!r}?" if near else ""
    raise ArgumentError(f"{given}: {table.where} has no column {wanted!r}; it has {names}.{hint}", given)


def _places(table: RawTable, wanted: str | int | None) -> list[int]:
    """The columns that a number or a header, with or without its unit, names."""
    if not isinstance(wanted, str):
        return [] if wanted is None or not 0 <= wanted < len(table.columns) else [wanted]
    exact = [index for index, name in enumerate(table.names) if name == wanted]
    bare = wanted.strip().lower()
    return exact or [index for index, name in enumerate(table.names) if split_header(name)[0].lower() == bare]


def _candidates(table: RawTable, role: str, choice: Choice) -> list[int]:
    """The columns that their names say to be this quantity and that are not given to another."""
    taken = {place for wanted in choice.columns.values() for place in _places(table, wanted)}
    columns = enumerate(table.columns)
    return [i for i, column in columns if i not in taken and role_of(column.name, column.unit) == role]


def _index(table: RawTable, role: str, choice: Choice) -> tuple[int | None, list[str]]:
    """The number of the column of a quantity, and a note where its unit decided between several."""
    if role in choice.columns:
        wanted = choice.columns[role]
        return (None if wanted is None else given_column(table, role, wanted)), []
    return _named(table, role, choice)


def _named(table: RawTable, role: str, choice: Choice) -> tuple[int | None, list[str]]:
    hits, stamped = _candidates(table, role, choice), []
    if role == "time":
        stamped = [i for i, column in enumerate(table.columns) if column.is_text and _is_clock(column)]
        hits = hits or stamped
    if len(hits) < 2:
        return next(iter(hits), None), []
    fitting = [i for i in hits if i in stamped or _fits(table.columns[i], role, choice)]
    names = [table.names[i] for i in hits]
    if len(fitting) == 1:
        others = " and ".join(repr(table.names[i]) for i in hits if i != fitting[0])
        return fitting[0], [f"{role} from {table.names[fitting[0]]!r} rather than {others}, by their units"]
    choose = Setting("columns", {role: names[0] if names.count(names[0]) == 1 else hits[0]})
    raise ArgumentError(
        f"{table.where}: the columns {' and '.join(map(repr, names))} could all be the {role}. Choose one: {choose}.",
        choose,
    )


def _fits(column: RawColumn, role: str, choice: Choice) -> bool:
    """Whether a column has a unit of this quantity, or of the signal that its gain takes."""
    name, written = split_header(column.name)
    unit = column.unit or written
    if role in choice.gains:
        return unit is None or conversion(role, unit) is None
    if column.is_text:
        return False
    return (conversion(role, unit) if unit else tail_unit(name, role)) is not None


def _is_clock(column: RawColumn) -> bool:
    """Whether a column of text holds times of day."""
    texts = np.asarray(column.values)[:3]
    return len(texts) > 0 and all(":" in str(text) and is_stamp(str(text)) for text in texts)


def _refuse_text(where: str, cells: np.ndarray) -> NoReturn:
    """Refuse a column without numbers."""
    text = str(cells[0])
    if not any(map(str, cells)):
        raise ArgumentError(f"{where} is empty: name another column, or export the record with its values.")
    how = f": {PLAINLY}" if GROUPED.fullmatch(text) else ""
    raise ArgumentError(f"{where} holds text ({text!r}), not numbers{how}.")


def column_of(table: RawTable, role: str, index: int, choice: Choice) -> Column:
    """The column of this number as a quantity, with the unit that the header or the caller names."""
    column, header = table.columns[index], table.names[index]
    where = f"{table.where}, column {header!r}"
    if column.is_text:
        if role == "time":
            return Column(role, index, header, None)
        _refuse_text(f"{where} ({role})", np.asarray(column.values))
    name, written = split_header(column.name)
    tail = None if column.unit or written else tail_unit(name, role)
    stated = column.unit or written or ""
    if role in choice.gains:
        unit = choice.units.get(role) or stated or signal_unit(name)
        return Column(role, index, header, gain_conversion(role, choice.gains[role], unit, where))
    if role in choice.units or stated:
        return Column(role, index, header, named_conversion(role, choice.units.get(role, stated), where))
    if tail:
        return Column(role, index, header, tail[1])
    signal = signal_unit(name)
    if signal:
        named_conversion(role, signal, where)  # refuses it, with the gain as the remedy
    example = Setting("units", {role: USUAL[role][0]})
    raise ArgumentError(
        f"{where} ({role}) names no unit, and none is assumed. Pass it, for example {example}, or put it into the "
        f'header: "{name} [{USUAL[role][0]}]".',
        example,
    )


def numbers_of(table: RawTable, index: int) -> Float[np.ndarray, " points"]:
    """A column as it stands, NaN where a cell is empty; text in it is refused."""
    raw = table.columns[index]
    wrong = {row: text for row, text in raw.faults.items() if text}
    if wrong:
        row, text = min(wrong.items())
        where = f"{table.where}, {table.place(row)}, column {table.names[index]!r}"
        raise ValueError(f"{where}: {text!r} is not a number. Mend or remove the line.")
    return np.asarray(raw.values, np.float64)


def in_si(table: RawTable, index: int, role: str, choice: Choice) -> tuple[Float[np.ndarray, " points"], str]:
    """A column in SI, NaN where a cell is empty; and its unit."""
    numbers = numbers_of(table, index)
    column = column_of(table, role, index, choice)
    assert column.conversion is not None
    return column.conversion(numbers), column.unit


def _refuse_missing(table: RawTable, role: str, columns: Mapping[str, Column | None]) -> NoReturn:
    """Refuse a table without a stroke or a force; propose a column that is no other quantity."""
    said = f"{table.where} has no column for the {role}: its columns are {', '.join(map(repr, table.names))}"
    settings = (Setting("stroke_from_velocity", True),) if role == "stroke" and columns.get("velocity") else ()
    other = f" Or integrate the velocity, if the law needs no place of the stroke: {settings[0]}." if settings else ""
    if settings and "time" not in columns:
        other = f" Points of a force-velocity curve are no record but a law: dampers.Table (docs/reading.md).{other}"
    taken = {column.index for column in columns.values() if column is not None}
    left = [i for i, column in enumerate(table.columns) if i not in taken and not column.is_text]
    free = [i for i in left if not _is_other(table.columns[i], role)]
    if not free:
        needed = f"A record needs the {role}: export the file again with it."
        raise ArgumentError(f"{said}, all of them other quantities. {needed}{other}", *settings)
    choice = Setting("columns", {role: table.columns[free[0]].name or free[0]})
    raise ArgumentError(f"{said}. Name it, for example {choice}.{other}", choice, *settings)


def _is_other(column: RawColumn, role: str) -> bool:
    """Whether the header or the unit of a column says that it is another quantity."""
    if not column.name:
        return False
    name, written = split_header(column.name)
    said = role_of(column.name, column.unit)
    unit = column.unit or written or ""
    foreign = bool(unit) and conversion(role, unit) is None and ratio(unit, "V") is None
    return foreign or (said is not None and said != role) or bool(NOT_MEASURED.intersection(words_in(name)))
