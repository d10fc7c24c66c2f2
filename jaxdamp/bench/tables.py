"""From the text of a file to a table of numbers: delimiter, decimal sign, preamble, header and units row."""

import csv
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting


DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab", " ": "white space"}
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*([eEdD][+-]?\d+)?|\.\d+([eEdD][+-]?\d+)?|nan|inf|infinity)", re.IGNORECASE)
_LOOK_AT = 2000  # lines that decide on the delimiter


@dataclass(frozen=True)
class Table:
    """The numbers of a file, with what its header says about the columns.

    Arguments:
        file: where it was read.
        names: header of each column; empty if the file has none.
        unit_row: the row of units under the header; empty if there is none.
        values: the numbers, rows by columns.
        lines: number of the line of each row, from 1.
        preamble: the lines before the header.
    """

    file: Path
    names: tuple[str, ...]
    unit_row: tuple[str, ...]
    values: Float[np.ndarray, "rows columns"]
    lines: tuple[int, ...]
    preamble: tuple[str, ...]


def read_table(file: Path, delimiter: str | None = None, is_unit: Callable[[str], bool] = lambda text: False) -> Table:
    """Read a text file with columns of numbers.

    The delimiter is the one of comma, semicolon, tab and white space which splits most lines into equal numbers of
    numbers; a decimal comma is understood where the comma is not the delimiter. The header is the last line without a
    number above the first row of numbers; a row of units may stand between the two.

    Raises:
        ValueError: naming file, line and value if the file is empty, has one column only, a wrong delimiter, text
            among the numbers, rows of different lengths or missing values.
    """
    lines = _text_lines(file)
    rows = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    delimiter, count = _delimiter(file, rows, delimiter)
    split = [(number, _split(line, delimiter)) for number, line in rows[:_LOOK_AT]]
    first = next(i for i, (_, cells) in enumerate(split) if len(cells) == count and _all_numbers(cells, delimiter))
    header, unit_row, top = _header(file, split[:first], count, delimiter, is_unit)
    return Table(
        file=file,
        names=header,
        unit_row=unit_row,
        values=_numbers(file, rows[first:], delimiter, count, header),
        lines=tuple(number for number, _ in rows[first:]),
        preamble=tuple(line for _, line in rows[:top]),
    )


def _text_lines(file: Path) -> list[str]:
    raw = file.read_bytes()
    if not raw.strip():
        raise ValueError(f"{file} is empty: export it from the bench again.")
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16").splitlines()
    if b"\0" in raw[:4096]:
        raise ValueError(f"{file} is not a text file: export it from the bench software as CSV.")
    try:
        return raw.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace").splitlines()


def _split(line: str, delimiter: str) -> list[str]:
    """The cells of a line. One empty cell after a closing delimiter does not count."""
    if delimiter == " ":
        return line.split()
    try:
        row = next(csv.reader([line.strip(" ")], delimiter=delimiter, skipinitialspace=True))
    except csv.Error:  # a line longer than any of a record, as in a JSON file
        row = line.split(delimiter)
    cells = [cell.strip() for cell in row]
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def _number(cell: str, delimiter: str) -> float | None:
    """The number in a cell, or None. Without a comma as delimiter, a comma is a decimal sign."""
    cell = cell.replace(",", ".") if delimiter != "," else cell
    return float(cell.lower().replace("d", "e")) if _NUMBER.fullmatch(cell) else None


def _all_numbers(cells: Sequence[str], delimiter: str) -> bool:
    return all(_number(cell, delimiter) is not None for cell in cells)


def _widths(rows: list[tuple[int, str]], delimiter: str) -> tuple[int, int]:
    """How many lines are rows of numbers, and how many columns most of them have."""
    cells = [_split(line, delimiter) for _, line in rows[:_LOOK_AT]]
    counts = Counter(len(row) for row in cells if _all_numbers(row, delimiter))
    count, number = counts.most_common(1)[0] if counts else (0, 0)
    return number, count


def _delimiter(file: Path, rows: list[tuple[int, str]], given: str | None) -> tuple[str, int]:
    """The delimiter and the number of columns."""
    found = {d: _widths(rows, d) for d in DELIMITERS}
    best = max(DELIMITERS, key=lambda d: found[d][0] if found[d][1] > 1 else 0)
    if given is None:
        if found[best][1] > 1:
            return best, found[best][1]
        if max(number for number, _ in found.values()) > 0:
            raise ValueError(
                f"{file} has only one column: a record needs at least the stroke and the force, side by side, "
                "divided by comma, semicolon, tab or white space."
            )
        raise ValueError(
            f"{file} holds no rows of numbers: its first line is {rows[0][1][:80]!r}.{_other_format(rows[0][1])}"
        )
    if len(given) != 1:
        _checks.refuse("delimiter", "be one character", repr(given))
    count = (found.get(given) or _widths(rows, given))[1]
    if count > 1:
        return given, count
    setting = Setting("delimiter", given)
    hint = f" It looks like {best!r} ({DELIMITERS[best]}): leave {setting} out." if found[best][1] > 1 else ""
    raise ArgumentError(f"{file} has no columns divided by {given!r}, the delimiter that was given.{hint}", setting)


def _other_format(first: str) -> str:
    """A sentence on a file that is text, but of another kind."""
    kind = {"{": "JSON", "[": "JSON", "<": "HTML or XML"}.get(first.lstrip()[:1])
    if kind is None:
        return ""
    return f" It looks like {kind}: export the record from the bench software as CSV, one column a channel."


def _header(
    file: Path, above: list[tuple[int, list[str]]], count: int, delimiter: str, is_unit: Callable[[str], bool]
) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Names, units and the number of lines of the preamble, from the lines above the first row of numbers."""
    heads = []
    for i, (_, cells) in enumerate(above):
        cells = _join_units(cells) if delimiter == " " else cells
        if len(cells) == count and all(_number(cell, delimiter) is None for cell in cells):
            heads.append((i, cells))
    if not heads:
        return (), (), len(above)
    top, names = heads[-1]
    units: list[str] = []
    named = [cell.strip("[](){} ") for cell in names]
    if (
        len(heads) > 1
        and heads[-2][0] == top - 1
        and all(not u or u == "-" or is_unit(u) for u in named)
        and any(named)
    ):
        units, (top, names) = named, heads[-2]
    for number, cells in above[top + 1 + bool(units) :]:
        if len(cells) == count:
            _refuse_row(file, number, cells, delimiter, count, names)
    return tuple(names), tuple(units), top


def _join_units(cells: list[str]) -> list[str]:
    """Put "[mm]" behind the name before it when white space divides the columns."""
    joined: list[str] = []
    for cell in cells:
        if joined and cell[0] in "[(":
            joined[-1] += " " + cell
        else:
            joined.append(cell)
    return joined


def _numbers(
    file: Path, rows: list[tuple[int, str]], delimiter: str, count: int, names: tuple[str, ...]
) -> Float[np.ndarray, "rows columns"]:
    """All rows as numbers: the fast way, and row by row only if that fails or a quote or odd exponent needs it."""
    text = [line.replace(",", ".") if delimiter != "," else line for _, line in rows]
    try:
        values = np.loadtxt(text, delimiter=None if delimiter == " " else delimiter, comments=None, ndmin=2)
        if values.shape == (len(rows), count):
            return values
    except ValueError:
        pass
    table = []
    for number, line in rows:
        cells = _split(line, delimiter)
        numbers = [_number(cell, delimiter) for cell in cells]
        if len(cells) != count or any(value is None for value in numbers):
            _refuse_row(file, number, cells, delimiter, count, names)
        table.append(numbers)
    return np.array(table, dtype=np.float64)


def _refuse_row(
    file: Path, number: int, cells: Sequence[str], delimiter: str, count: int, names: Sequence[str]
) -> NoReturn:
    if len(cells) != count:
        raise ValueError(
            f"{file}, line {number}: {len(cells)} values where the file has {count} columns ({cells[:6]}): "
            "mend or remove the line; a record must have no missing values."
        )
    at = next(i for i, cell in enumerate(cells) if _number(cell, delimiter) is None)
    column = f"column {names[at]!r}" if names else f"column {at}"
    what = f"{cells[at]!r} is not a number" if cells[at] else "the value is missing"
    raise ValueError(f"{file}, line {number}, {column}: {what}. Mend or remove the line.")
