"""Tables of results: columns with units, rows of words and numbers; as text, HTML, CSV and plain data."""

import csv
import dataclasses
import html
import io
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from jaxdamp import _checks
from jaxdamp._cells import (
    QUANTITIES,
    Cell as Cell,
    Column as Column,
    Shown as Shown,
    Units,
    factor_of,
    is_along_a_road,
    scaled,
    typeset_unit as typeset_unit,
    unit_shown,
)
from jaxdamp._display import display
from jaxdamp._words import path_words, said, typeset


Contents: TypeAlias = dict[str, Any]  # numbers, texts, lists and dictionaries of such, ready for JSON


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

    def shown(self, *, read: bool = False) -> "Table":
        """The table in the units and the sign that are shown.

        A number has the unit of its column or, where that has none, of the cell of its row in the column "unit".

        Arguments:
            read: by people, in the units of `Display.read`; distances along a road are in m for everybody.
        """
        present = display()
        if present.plain and not read:
            return self
        shown = present.read if read else present.of
        columns = tuple(
            c if is_along_a_road(c) else c._replace(name=present.text(c.name), unit=unit_shown(shown, c.unit))
            for c in self.columns
        )
        return Table(present.text(self.title), columns, tuple(self._row_shown(shown, row) for row in self.rows))

    def _row_shown(self, shown: Units, row: tuple[Cell, ...]) -> tuple[Cell, ...]:
        by_name = dict(zip((column.name for column in self.columns), row, strict=True))
        unit, quantity = str(by_name.get("unit", "")), str(next(filter(None, map(by_name.get, QUANTITIES)), ""))
        factors = [factor_of(shown, column, unit, quantity) for column in self.columns]
        cells = [
            unit_shown(shown, str(cell)) if column.name == "unit" else scaled(cell, factor)
            for column, cell, factor in zip(self.columns, row, factors, strict=True)
        ]
        turned = display().turned(tuple(column.name for column in self.columns))
        return tuple(cells[to if factors[to] < 0.0 else at] for at, to in enumerate(turned))

    def texts(self) -> list[tuple[str, ...]]:
        """The rows for reading."""
        shown = self.shown(read=True)
        return [tuple(c.text(cell) for c, cell in zip(shown.columns, row, strict=True)) for row in shown.rows]

    def headings(self) -> list[str]:
        """The names of the columns with the units in which people read them."""
        return [column.heading for column in self.shown(read=True).columns]

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
        shown = self.shown()
        writer.writerow([column.heading for column in shown.columns])
        writer.writerows([_plain_cell(cell) for cell in row] for row in shown.rows)
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


MANY_DIGITS = 1e5  # percent, from which a change has two digits
_NAMES = ("law", "metric", "parameter", "channel", "what")  # columns with names of the library


def _html_cell(text: str, side: str, named: bool, *, words: bool) -> str:
    """A cell as HTML."""
    said = path_words(text) if named else typeset(text) if words else text
    title = f' title="{html.escape(text)}"' if said != text and named else ""
    return f"<td{side}{title}>{html.escape(said)}</td>"


def percent_change(before: float, after: float) -> float | None:
    """Relative change [%]; none from zero."""
    return 100.0 * (after / before - 1.0) if before else None


def percentage(change: float, half_width: float = math.nan) -> str:
    """A change [%] in words, with half the width of its interval [%] if it has one.

    >>> percentage(-15.61, 0.62), percentage(3.4e9), percentage(-0.01)
    ('-15.6 ± 0.6 %', '+3.4e+09 %', '0.0 %')
    """
    spec = ".1f" if abs(change) < MANY_DIGITS else ".2g"
    error = f" ± {half_width:{spec}}" if math.isfinite(half_width) else ""
    text = f"{change:+{spec}}"
    return f"{text if float(text) else text[1:]}{error} %"  # nothing has no sign


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
