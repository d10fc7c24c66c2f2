"""How rows of text cells are laid out: delimiter, preamble, header, units, rows of numbers and lines behind them."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from jaxdamp.bench.stamps import is_stamp
from jaxdamp.bench.units import is_unit


DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab", " ": "white space", "|": "vertical bar"}
NUMBER = re.compile(r"[+-]?(\d+\.?\d*([eEdD][+-]?\d+)?|\.\d+([eEdD][+-]?\d+)?|nan|inf|infinity)", re.IGNORECASE)
_NUMERIC = 0.9  # share of numbers that makes a column one of the record rather than one with gaps
Rows = Sequence[tuple[int, list[str]]]  # number of the line, from 1, and its cells


def split(line: str, delimiter: str) -> list[str]:
    """The cells of a line. One empty cell after a closing delimiter does not count."""
    if delimiter == " ":
        return line.split()
    row = line.split(delimiter)
    if " " not in line and '"' not in line and delimiter != "|":
        return row[:-1] if len(row) > 1 and not row[-1] else row
    if '"' in line:
        try:
            row = next(csv.reader([line.strip(" ")], delimiter=delimiter, skipinitialspace=True))
        except csv.Error:  # a line longer than any of a record, as in a JSON file
            pass
    cells = [cell.strip() for cell in row]
    if delimiter == "|" and len(cells) > 2 and not cells[0]:  # bars around the whole table
        cells = cells[1:]
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def number(cell: str, delimiter: str) -> float | None:
    """The number in a cell, or None. Without a comma as delimiter, a comma is a decimal sign."""
    cell = cell.replace(",", ".") if delimiter != "," else cell
    return float(cell.lower().replace("d", "e")) if NUMBER.fullmatch(cell) else None


@dataclass(frozen=True)
class Layout:
    """How the rows of a record are divided.

    Arguments:
        delimiter: the character between columns.
        count: number of columns.
        full: numbers of the columns that hold a number or a time stamp in nearly every row.
        numeric: numbers of the columns that hold numbers, some perhaps in few rows.
        score: digits of numbers and time stamps in the rows looked at; the delimiter with most of them is right.
    """

    delimiter: str
    count: int
    full: tuple[int, ...]
    numeric: tuple[int, ...]
    score: int

    def has_value(self, cell: str) -> bool:
        """Whether a cell holds a number or a time stamp."""
        return number(cell, self.delimiter) is not None or is_stamp(cell)

    def values_in(self, cells: Sequence[str]) -> int:
        """How many columns of the record hold a number or a time stamp in this row; 0 if its width is another."""
        return sum(self.has_value(cells[i]) for i in self.full) if len(cells) == self.count else 0

    def is_row(self, cells: Sequence[str]) -> bool:
        """Whether this is a row of the record, with perhaps a value that is wrong."""
        return 2 * self.values_in(cells) > len(self.full) or self.values_in(cells) >= 2


def layout_of(rows: Rows, delimiter: str) -> Layout | None:
    """The layout of rows divided at this delimiter, or None if they hold no numbers."""
    kept = []
    for _, cells in rows:
        numbers = [number(cell, delimiter) is not None for cell in cells]
        values = [yes or is_stamp(cell) for yes, cell in zip(numbers, cells, strict=True)]
        if any(numbers) and sum(values) >= min(2, len(cells)):
            kept.append((cells, numbers, values))
    if not kept:
        return None
    count = Counter(len(cells) for cells, _, _ in kept).most_common(1)[0][0]
    kept = [row for row in kept if len(row[0]) == count]
    columns = range(count)
    full = tuple(i for i in columns if sum(values[i] for _, _, values in kept) >= _NUMERIC * len(kept))
    filled = [sum(bool(cells[i]) for cells, _, _ in kept) for i in columns]
    numeric = tuple(i for i in columns if 2 * sum(numbers[i] for _, numbers, _ in kept) > filled[i])
    digits = (
        sum(map(str.isdigit, cell)) for cells, _, values in kept for cell, yes in zip(cells, values, strict=True) if yes
    )
    return Layout(delimiter, count, full, numeric, sum(digits)) if full else None


class Header(NamedTuple):
    """Names and units of the columns, the number of rows above them, and the number of the first row of numbers."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    top: int
    first: int


def header_of(rows: Rows, layout: Layout) -> Header | None:
    """The header above the first row of numbers, or None if there is no such row.

    The header is the last row without a number above the first complete row of numbers; a row of units may stand
    between the two.
    """
    complete = (i for i, (_, cells) in enumerate(rows) if layout.values_in(cells) == len(layout.full))
    first = next(complete, None)
    if first is None:
        return None
    heads = []
    for i, (_, cells) in enumerate(rows[:first]):
        cells = _join_units(cells) if layout.delimiter == " " else cells
        if len(cells) == layout.count and any(cells) and not any(map(layout.has_value, cells)):
            heads.append((i, cells))
    names, units, top, end = [""] * layout.count, [""] * layout.count, first, 0
    if heads:
        (top, names), end = heads[-1], heads[-1][0] + 1
        named = [cell.strip("[](){} ") for cell in names]
        above = len(heads) > 1 and heads[-2][0] == top - 1
        if above and any(named) and all(not u or u == "-" or is_unit(u) for u in named):
            units, (top, names) = ["" if u == "-" else u for u in named], heads[-2]
    while first > end and layout.is_row(rows[first - 1][1]):  # rows at the start with a value that is wrong
        first -= 1
    return Header(tuple(names), tuple(units), top if heads else first, first)


def _join_units(cells: list[str]) -> list[str]:
    """Put "[mm]" behind the name before it when white space divides the columns."""
    joined: list[str] = []
    for cell in cells:
        if joined and cell[0] in "[(":
            joined[-1] += " " + cell
        else:
            joined.append(cell)
    return joined
