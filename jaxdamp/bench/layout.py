"""How rows of text cells are laid out, in blocks under headers, and their columns as numbers with decimal signs."""

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, compress, islice, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxdamp.bench.clock import is_stamp
from jaxdamp.bench.headers import role_of
from jaxdamp.bench.raw import RawColumn, RawTable, apart
from jaxdamp.bench.units import is_unit, is_usual


DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab", " ": "white space", "|": "vertical bar"}
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*(?:[eEdD][+-]?\d+)?|\.\d+(?:[eEdD][+-]?\d+)?|nan|inf|infinity)", re.IGNORECASE)
_NUMBER_OR_NOT = re.compile(rf"^(?:({NUMBER.pattern})|.*)$", re.IGNORECASE | re.MULTILINE)  # of cells, one a line
# A number with a decimal comma or with thousands set apart, in a cell that holds more than a number as it is read.
GROUPED = re.compile(r"[+-]?\d+(?:,\d+|(?:[ '\u2019\u00a0\u202f]\d{3})+)(?:[.,]\d+)*")
PLAINLY = "export the file with decimal points and without a sign for thousands"
_DIGITS = re.compile(r"\d+")
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
    return float(with_point(cell, delimiter).lower().replace("d", "e")) if is_number(cell, delimiter) else None


def is_number(cell: str, delimiter: str) -> bool:
    """Whether a cell holds a number."""
    return NUMBER.fullmatch(with_point(cell, delimiter)) is not None


def with_point(cell: str, delimiter: str) -> str:
    """A cell with a point as decimal sign."""
    return cell.replace(",", ".") if delimiter != "," else cell


@dataclass(frozen=True)
class Layout:
    """How the rows of a record are divided."""

    delimiter: str  # the character between columns
    count: int  # number of columns
    full: tuple[int, ...]  # numbers of the columns that hold a number or a time stamp in nearly every row
    numeric: tuple[int, ...]  # numbers of the columns that hold numbers, some perhaps in few rows
    score: int  # digits of numbers and time stamps in the rows looked at; the delimiter with most of them is right

    def has_value(self, cell: str) -> bool:
        """Whether a cell holds a number or a time stamp."""
        return is_number(cell, self.delimiter) or is_stamp(cell)

    def values_in(self, cells: Sequence[str]) -> int:
        """How many columns of the record hold a number or a time stamp in this row; 0 if its width is another."""
        return sum(self.has_value(cells[i]) for i in self.full) if len(cells) == self.count else 0

    def words(self, cells: list[str]) -> list[str]:
        """The cells of a row of this width that holds words and no number, such as a header; empty for another row."""
        cells = _join_units(cells) if self.delimiter == " " else cells
        is_header = len(cells) == self.count and any(cells) and not any(map(self.has_value, cells))
        return cells if is_header else []

    def is_row(self, cells: Sequence[str]) -> bool:
        """Whether this is a row of the record, with perhaps a value that is wrong."""
        good = self.values_in(cells)
        wrong = [i for i in self.full if good and GROUPED.fullmatch(cells[i]) and not self.has_value(cells[i])]
        return 2 * (good + len(wrong)) > len(self.full) or good + len(wrong) >= 2


def layout_of(rows: Rows, delimiter: str) -> Layout | None:
    """The layout of rows divided at this delimiter, or None if they hold no numbers."""
    cells, numbers, values = _rows_of_one_width(rows, delimiter)
    if not cells:
        return None
    filled = [sum(map(bool, column)) for column in zip(*cells, strict=True)]
    full = np.flatnonzero(values.sum(axis=0) >= _NUMERIC * len(cells))
    numeric = np.flatnonzero(2 * numbers.sum(axis=0) > filled)
    digits = sum(map(len, _DIGITS.findall(" ".join(compress(chain.from_iterable(cells), values.flat)))))
    return (
        Layout(delimiter, len(cells[0]), tuple(full.tolist()), tuple(numeric.tolist()), digits) if len(full) else None
    )


def _rows_of_one_width(rows: Rows, delimiter: str) -> tuple[list[list[str]], np.ndarray, np.ndarray]:
    """The rows with numbers that have the most frequent width, and which of their cells are numbers, and values."""
    chosen = []
    numeric = _are_numbers([cell for _, cells in rows for cell in cells], delimiter)
    for _, cells in rows:
        numbers = [*islice(numeric, len(cells))]
        if any(numbers):
            values = numbers if all(numbers) else [n or is_stamp(cell) for n, cell in zip(numbers, cells, strict=True)]
            if sum(values) >= min(2, len(cells)):
                chosen.append((cells, numbers, values))
    widths = Counter(len(cells) for cells, _, _ in chosen)
    width = widths.most_common(1)[0][0] if widths else 0
    cells, numbers, values = ([row[part] for row in chosen if len(row[0]) == width] for part in range(3))
    return cells, np.array(numbers), np.array(values)


def _are_numbers(cells: Sequence[str], delimiter: str) -> Iterator[bool]:
    """Which of many cells hold a number, found at once: one by one they take as long as all other reading."""
    one_a_line = "\n".join([cell.replace("\n", " ") for cell in cells])
    return map(bool, _NUMBER_OR_NOT.findall(with_point(one_a_line, delimiter)))


class Header(NamedTuple):
    """Names and units of the columns, the number of rows above them, and the number of the first row of numbers."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    top: int
    first: int


def header_of(rows: Rows, layout: Layout) -> Header | None:
    """The last row without a number above the first complete row of numbers, and that of units if one is in between.

    None if there is no such row of numbers.
    """
    complete = (i for i, (_, cells) in enumerate(rows) if layout.values_in(cells) == len(layout.full))
    first = next(complete, None)
    if first is None:
        return None
    words = [(i, cells) for i, (_, row) in enumerate(rows[:first]) if (cells := layout.words(row))]
    end = words[-1][0] + 1 if words else 0
    while first > end and layout.is_row(rows[first - 1][1]):  # rows at the start with a value that is wrong
        first -= 1
    empty = ("",) * layout.count
    if not words:
        return Header(empty, empty, first, first)
    top, names = words[-1]
    units = _units(names)
    if units and len(words) > 1 and words[-2][0] == top - 1:
        above, names = words[-2]
        return Header(tuple(names), units, above, first)
    return Header(tuple(names), empty, top, first)


def _units(cells: Sequence[str]) -> tuple[str, ...]:
    """The units in a row that holds nothing else; empty if it holds something else."""
    bare = [cell.strip("[](){} ") for cell in cells]
    names = (cell for cell, unit in zip(cells, bare, strict=True) if not is_usual(unit) and role_of(cell))
    if not any(bare) or any(names) or not all(unit in ("", "-") or is_unit(unit) for unit in bare):
        return ()
    return tuple("" if unit == "-" else unit for unit in bare)


def _join_units(cells: list[str]) -> list[str]:
    """Put "[mm]" behind the name before it when white space divides the columns."""
    joined: list[str] = []
    for cell in cells:
        if joined and cell[0] in "[(":
            joined[-1] += " " + cell
        else:
            joined.append(cell)
    return joined


# A number with a comma that cannot divide thousands.
PLAIN_COMMA = re.compile(r"(?<![\d,])0\d*,\d|\d,(\d{1,2}|\d{4,})(?!\d)|\d{4},\d|,\d+[eEdD]|\d,(?!\d)|(?<!\d),\d")


def columns_of(
    file: Path, numbers: Sequence[int], chunks: Iterable[Sequence[Sequence[str]]], layout: Layout
) -> list[RawColumn]:
    """The columns of rows of cells: numbers, what stands in their place, and text."""
    signs = _DecimalSigns(file, layout, numbers)
    parts: list[list[np.ndarray]] = [[] for _ in range(layout.count)]
    faults: list[dict[int, str]] = [{} for _ in range(layout.count)]
    start = 0
    for rows in chunks:
        _check_widths(file, numbers, rows, start, layout.count)
        for index, cells in enumerate(zip(*rows, strict=True)):
            if index in layout.numeric:
                signs.check(cells, start)
                values, wrong = _numbers(cells, layout.delimiter)
                faults[index] |= {start + row: text for row, text in wrong.items()}
            else:
                values = np.array(cells, dtype=object)
            parts[index].append(values)
        start += len(rows)
    signs.finish()
    return [RawColumn("", np.concatenate(p), faults=f) for p, f in zip(parts, faults, strict=True)]


def _check_widths(file: Path, numbers: Sequence[int], rows: Sequence[Sequence[str]], start: int, count: int) -> None:
    for row, cells in enumerate(rows, start):
        if len(cells) != count:
            raise ValueError(
                f"{file}, line {numbers[row]}: {len(cells)} values where the file has {count} columns "
                f"({list(cells[:6])}): mend or remove the line; a record must have no missing values."
            )


def _numbers(cells: Sequence[str], delimiter: str) -> tuple[np.ndarray, dict[int, str]]:
    """The numbers in cells, NaN where there is none, and what stands there instead."""
    try:
        if all(map(str.isascii, cells)) and not any("_" in cell for cell in cells):
            return np.array(list(map(float, cells))), {}
    except ValueError:
        pass
    values = [number(cell, delimiter) for cell in cells]
    wrong = {row: cells[row] for row, value in enumerate(values) if value is None}
    return np.array([np.nan if value is None else value for value in values]), wrong


class _DecimalSigns:
    """Refuses a file whose numbers have decimal points and decimal commas."""

    def __init__(self, file: Path, layout: Layout, numbers: Sequence[int]) -> None:
        self.file, self.active, self.numbers = file, layout.delimiter != ",", numbers
        self.first: dict[str, tuple[int, str]] = {}
        self.plain = False  # whether a comma cannot divide thousands

    def check(self, cells: Sequence[str], start: int) -> None:
        """Look at the numbers of a column; `start` is the row of the first."""
        if not self.active:
            return
        self.plain = self.plain or any("," in cell and PLAIN_COMMA.search(cell) for cell in cells)
        for sign in ".,":
            row = next((row for row, cell in enumerate(cells) if sign in cell and NUMBER.match(cell)), None)
            if row is not None:
                self.first.setdefault(sign, (self.numbers[start + row], cells[row]))
        if len(self.first) == 2:
            (line, text), (other, comma) = self.first["."], self.first[","]
            raise ValueError(
                f"{self.file}, line {other}: {comma!r} has a comma, {text!r} in line {line} a point. One of the two "
                "may divide thousands: export the file with one decimal sign and without a sign for thousands."
            )

    def finish(self) -> None:
        """Refuse commas that may all divide thousands."""
        if "," in self.first and not self.plain:
            line, text = self.first[","]
            raise ValueError(
                f"{self.file}, line {line}: the comma in {text!r} may be a decimal sign or divide thousands, and no "
                "other number of the file tells which: export it with decimal points."
            )


Cells = Callable[[int], Sequence[str]]  # the cells of the line or row of a number, from 1


class Block(NamedTuple):
    """A header and its rows of numbers, all by number from 1."""

    behind: int  # last row of numbers of the block before; 0 without one
    header: int  # row of the header
    first: int  # first row of numbers
    end: int  # last row of numbers; of the last block the last row of all


def blocks_of(cells: Cells, count: int, header: int, first: int, like: Sequence[int], layout: Layout) -> list[Block]:
    """The blocks of some lines or rows: one, or one under each that is like the header.

    The numbers below each header must begin again: a header inside one record is a fault of the file. The first row of
    numbers is that of the header if there is none.
    """
    depth = first - header
    ends = [_end(cells, start + depth, stop - 1, layout) for start, stop in pairwise([*like, count + 1])]
    if not depth or not _begin_again(cells, [start + depth for start in like], ends, layout):
        return [Block(0, header, first, count)]
    behind, ends[-1] = [0, *ends[:-1]], count
    return [Block(b, start, start + depth, end) for b, start, end in zip(behind, like, ends, strict=True)]


def _end(cells: Cells, first: int, last: int, layout: Layout) -> int:
    """The number of the last row of numbers among these."""
    while last >= first and not layout.is_row(cells(last)):
        last -= 1
    return last


def _begin_again(cells: Cells, firsts: Sequence[int], ends: Sequence[int], layout: Layout) -> bool:
    """Whether every block has numbers, and begins with a smaller one than that with which the block before ends."""
    if any(end < first for first, end in zip(firsts, ends, strict=True)):
        return False
    last, first = ([_first_number(cells(row), layout) for row in rows] for rows in (ends[:-1], firsts[1:]))
    return all(a is not None and b is not None and a > b for a, b in zip(last, first, strict=True))


def _first_number(cells: Sequence[str], layout: Layout) -> float | None:
    return number(cells[layout.full[0]], layout.delimiter) if layout.full[0] < len(cells) else None


def title(preamble: Sequence[str], block: Block, line: int, layout: Layout) -> str:
    """What stands above the header of a block; the number of its line where nothing does."""
    words = [cell for cell in split(preamble[-1], layout.delimiter) if cell] if preamble else []
    return " ".join(words)[:60] or (f"line {line}" if block.behind else "first")


def named_apart(tables: Sequence[RawTable], whole: str) -> list[RawTable]:
    """The tables of blocks with names of their own; a single one has that of the whole, and needs none in a file."""
    if len(tables) == 1:
        return [replace(tables[0], record=whole)]
    said = f"one of {len(tables)} blocks of the file, each under a header of its own"
    names = apart([f"{whole} {table.record}".strip() for table in tables])
    return [replace(t, record=name, notes=(*t.notes, said)) for t, name in zip(tables, names, strict=True)]
