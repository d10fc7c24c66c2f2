"""Tables of results: columns with units, rows of words and numbers; as text, HTML, CSV and plain data."""

import csv
import dataclasses
import html
import io
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from jaxdamp import _checks
from jaxdamp._display import Display, display, plus_minus
from jaxdamp._words import path_words, said, typeset


Cell = str | float | int | None
Contents: TypeAlias = dict[str, Any]  # numbers, texts, lists and dictionaries of such, ready for JSON


class Shown(float):
    """A number with the text that a reader is shown; files keep all its digits.

    >>> number = Shown(14361.2734, "14361")
    >>> f"{number:.4g}", str(number)
    ('14361', '14361.2734')
    """

    text: str

    def __new__(cls, value: float, text: str) -> "Shown":
        """The number, and its text."""
        self = super().__new__(cls, value)
        self.text = text
        return self

    def __reduce__(self) -> tuple[type["Shown"], tuple[float, str]]:
        return Shown, (float(self), self.text)  # of a copy

    def __format__(self, spec: str) -> str:
        return self.text


class Column(NamedTuple):
    """A column: its name, its unit, and how a number in it is written for reading.

    Attributes:
        name: of the column.
        unit: as it is printed; empty for none.
        spec: format of a number in it, such as ".3g".
    """

    name: str
    unit: str = ""
    spec: str = ".4g"

    @property
    def heading(self) -> str:
        """Name with unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def text(self, cell: Cell) -> str:
        """A cell for reading; nothing where there is no value."""
        if cell is None:
            return ""
        return display().words(cell) if isinstance(cell, str) else _written(cell, self.spec)


def _written(number: float, spec: str) -> str:
    """A number in a format, but without a power of ten from 0.001 to 99 999, and without a sign of zero.

    >>> [_written(number, ".4g") for number in (11187.4, -1032.4, 0.00123, 8.818e-05, -0.0)] + [_written(-0.04, ".1f")]
    ['11187', '-1032', '0.00123', '8.818e-05', '0', '0.0']
    """
    text = format(number, spec)
    if "e" in text and not isinstance(number, Shown | int) and 1e-3 <= abs(number) < 1e5:
        text = f"{number:.0f}" if abs(number) >= 1e3 else np.format_float_positional(float(text), trim="-")
    return text[1:] if re.fullmatch(r"[-+]0(\.0*)?", text) else text


@dataclass(frozen=True, repr=False)
class Table:
    """A table with a title, columns with units, and rows of words and numbers. Notebooks show it as HTML.

    Its text, HTML and CSV have the units and the sign of `_display.display()`, its plain data those of the library.

    Attributes:
        title: of the table.
        columns: names, units and formats.
        rows: a cell for each column.

    >>> table = Table("Laws", (Column("law"), Column("RMSE", "N", ".1f")), (("linear", 88.93), ("besinger", 45.02)))
    >>> print(table)
    Laws
    law       RMSE [N]
    linear        88.9
    besinger      45.0
    >>> print(table.to_csv().splitlines())
    ['law,RMSE [N]', 'linear,88.93', 'besinger,45.02']
    >>> table.records()[1]
    {'law': 'besinger', 'RMSE': 45.02}
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def shown(self) -> "Table":
        """The table in the units and the sign that are shown.

        A number has the unit of its column or, where that has none, of the cell of its row in the column "unit".
        """
        present = display()
        if present.plain:
            return self
        columns = tuple(c._replace(name=present.text(c.name), unit=_unit_shown(present, c.unit)) for c in self.columns)
        return Table(present.text(self.title), columns, tuple(self._row_shown(present, row) for row in self.rows))

    def _row_shown(self, present: Display, row: tuple[Cell, ...]) -> tuple[Cell, ...]:
        by_name = dict(zip((column.name for column in self.columns), row, strict=True))
        unit, quantity = str(by_name.get("unit", "")), str(next(filter(None, map(by_name.get, _QUANTITIES)), ""))
        factors = [_factor(present, column, unit, quantity) for column in self.columns]
        cells = [
            _unit_shown(present, str(cell)) if column.name == "unit" else _scaled(cell, factor)
            for column, cell, factor in zip(self.columns, row, factors, strict=True)
        ]
        turned = present.turned(tuple(column.name for column in self.columns))
        return tuple(cells[to if factors[to] < 0.0 else at] for at, to in enumerate(turned))

    def texts(self) -> list[tuple[str, ...]]:
        """The rows for reading."""
        shown = self.shown()
        return [tuple(c.text(cell) for c, cell in zip(shown.columns, row, strict=True)) for row in shown.rows]

    def headings(self) -> list[str]:
        """The names of the columns with the units that are shown."""
        return [column.heading for column in self.shown().columns]

    def only(self, rows: Collection[str] | None = None, columns: Collection[str] | None = None) -> "Table":
        """The rows whose first cell is one of these, and the columns of these names."""
        places = [i for i, column in enumerate(self.columns) if columns is None or column.name in columns]
        chosen = (row for row in self.rows if rows is None or row[0] in rows)
        cells = tuple(tuple(row[i] for i in places) for row in chosen)
        return dataclasses.replace(self, columns=tuple(self.columns[i] for i in places), rows=cells)

    def first(self, most: int) -> "Table":
        """The first rows of a long table, which its title then says.

        >>> print(Table("Points", (Column("x"),), ((1.0,), (2.0,), (3.0,))).first(2))
        Points; the first 2 of 3 rows
        x
        1
        2
        """
        if len(self.rows) <= most:
            return self
        return Table(f"{self.title}; the first {most} of {len(self.rows)} rows", self.columns, self.rows[:most])

    def records(self) -> list[dict[str, Cell]]:
        """The rows as dictionaries by the names of the columns: a list that `pandas.DataFrame` takes as it is."""
        return [dict(zip((c.name for c in self.columns), row, strict=True)) for row in self.rows]

    def to_dict(self) -> Contents:
        """Title, columns with units, and rows, ready for JSON; numbers that are not finite are None."""
        columns = [{"name": column.name, "unit": column.unit} for column in self.columns]
        return {"title": self.title, "columns": columns, "rows": plain(self.rows)}

    def is_number(self, column: int) -> bool:
        """Whether a column holds numbers, to be set to the right."""
        return any(isinstance(row[column], float | int) for row in self.rows)

    def to_text(self) -> str:
        """The rows for reading, in columns of equal width."""
        lines = [tuple(self.headings()), *self.texts()]
        widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
        sides = [">" if self.is_number(i) else "<" for i in range(len(self.columns))]
        padded = (
            "  ".join(f"{text:{side}{width}}" for text, side, width in zip(line, sides, widths, strict=True))
            for line in lines
        )
        return "\n".join([display().text(self.title), *(line.rstrip() for line in padded)])

    def to_csv(self) -> str:
        """All digits, with headings that carry the units."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.headings())
        writer.writerows([_plain_cell(cell) for cell in row] for row in self.shown().rows)
        return out.getvalue()

    def to_html(self, *, words: bool = False) -> str:
        """The rows for reading, as HTML.

        Arguments:
            words: metrics, laws and parameters as people say them, with their names in the library where a mouse rests.
        """
        sides = [' class="number"' if self.is_number(i) else "" for i in range(len(self.columns))]
        cells = zip(self.headings(), sides, strict=True)
        head = "".join(
            f'<th scope="col"{side}>{html.escape(said(heading) if words else heading)}</th>' for heading, side in cells
        )
        named = [words and c.name in _NAMES and not self.is_number(i) for i, c in enumerate(self.columns)]
        lines = []
        for row in self.texts():
            parts = [_html_cell(*part, words=words) for part in zip(row, sides, named, strict=True)]
            lines.append(f"<tr>{''.join(parts)}</tr>")
        title = display().text(self.title)
        caption = f"<caption>{html.escape(said(title) if words else title)}</caption>"
        return "\n".join([f"<table>{caption}", f"<thead><tr>{head}</tr></thead><tbody>", *lines, "</tbody></table>"])

    _repr_html_ = to_html
    __repr__ = to_text


_NAMES = ("law", "metric", "parameter", "what")  # columns with names of the library


def _html_cell(text: str, side: str, named: bool, *, words: bool) -> str:
    """A cell as HTML."""
    said = path_words(text) if named else typeset(text) if words else text
    title = f' title="{html.escape(text)}"' if said != text and named else ""
    return f"<td{side}{title}>{html.escape(said)}</td>"


_COUNTS = ("count", "cycles", "wheels", "ratio", "times", "(value − true)/se")  # columns whose numbers have no unit
_SPREADS = ("scatter", "uncertainty", "standard error", "change")  # and those without a sign
_QUANTITIES = ("quantity", "metric", "finding")  # columns that say what the numbers of a row are
_BAND = ("from", "to")  # of a force; times and distances have no direction


def _factor(present: Display, column: Column, unit: str, quantity: str) -> float:
    """What a number is shown times, of a row with this unit and quantity, if it states them."""
    unit_of_column = column.unit or ("" if column.name in _COUNTS else unit)
    if unit_of_column in ("", "–", "%"):
        return 1.0
    signed = present.signed(column.name if column.unit else quantity) and column.name not in _SPREADS
    signed |= column.unit == "N" and column.name in _BAND
    signed &= not (quantity and column.name == "velocity")  # it is positive, the direction is in the quantity
    return present.of(unit_of_column.replace("²", "^2"), signed=signed).factor


def _unit_shown(present: Display, unit: str) -> str:
    return typeset_unit(present.of(unit.replace("²", "^2")).unit, "")


def _scaled(cell: Cell, factor: float) -> Cell:
    """A number of a table times a factor; the text of a `Shown` keeps what its digits say."""
    if factor == 1.0 or not isinstance(cell, float):
        return cell
    value = cell * factor + 0.0
    if not isinstance(cell, Shown):
        return value
    _, sign, error = cell.text.partition(" ± ")
    if sign:
        return Shown(value, plus_minus(value, float(error) * abs(factor)))
    figures = max(3, len(re.sub(r"^-?0*\.?0*|\.|e.*", "", cell.text)))
    return Shown(value, f"{value:.{figures}g}" if np.isfinite(value) else cell.text)


def typeset_unit(unit: str, none: str = "") -> str:
    """A unit as it is printed: "m/s²" for "m/s^2", and `none` where there is no unit."""
    return unit.replace("^2", "²") or none


def percent_change(before: float, after: float) -> float | None:
    """Relative change [%]; none from zero."""
    return 100.0 * (after / before - 1.0) if before else None


class Compared(NamedTuple):
    """A row of a comparison: one quantity under several conditions."""

    name: str
    unit: str
    values: Sequence[Cell]  # one for each condition
    change: float | None  # from the first to the last [%]
    more: tuple[Cell, ...] = ()


def comparison_table(
    title: str, quantity: str, conditions: Sequence[str], rows: Iterable[Compared], more: tuple[Column, ...] = ()
) -> Table:
    """Quantities under several conditions, such as before and after, with the change from the first to the last.

    Arguments:
        title: of the table.
        quantity: heading of the names.
        conditions: heading of each value. Of a single condition there is no change.
        rows: the quantities.
        more: further columns.
    """
    several = len(conditions) > 1
    change = (Column("change", "%", "+.1f"),) if several else ()
    columns = (Column(quantity), Column("unit"), *map(Column, conditions), *change, *more)
    cells = (
        (row.name, typeset_unit(row.unit, "–"), *row.values, *((row.change,) if several else ()), *row.more)
        for row in rows
    )
    return Table(title, columns, tuple(cells))


def plain(value: object) -> Any:
    """Numbers, words, lists, records and dictionaries as JSON has them; numbers that are not finite become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if as_dict := getattr(value, "_asdict", None):
        return plain(as_dict())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return float(value) if np.isfinite(value) else None
    _checks.untraced("value", value)
    array = np.asarray(value)
    if array.dtype.kind not in "biufU":
        raise TypeError(
            f"A {type(value).__name__} is no number, word, list or dictionary, which plain data are made of."
        )
    return plain(array.tolist())


def with_unit(value: object, unit: str) -> Contents:
    """A number or an array with its unit, as plain data."""
    return {"value": plain(value), "unit": unit}


def with_tied(note: str, tied: Sequence[str]) -> str:
    """The remark on a number: its note, and the names of the numbers that are tied to it."""
    return "; ".join([note] * bool(note) + [f"= {', '.join(tied)}"] * bool(tied))


def _plain_cell(cell: object) -> object:
    """A cell of a CSV file; texts that a spreadsheet would compute as a formula begin with an apostrophe."""
    if not isinstance(cell, str):
        return "" if cell is None else cell
    said = display().words(cell)
    return f"'{said}" if said.startswith(("=", "+", "-", "@", "\t", "\r")) else said
