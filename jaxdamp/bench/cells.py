"""Columns of text cells as numbers: decimal signs, missing values and text in their place."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from jaxdamp.bench.layout import NUMBER, Layout, number
from jaxdamp.bench.raw import RawColumn


# A number with a comma that cannot divide thousands.
PLAIN_COMMA = re.compile(r"(?<![\d,])0\d*,\d|\d,(\d{1,2}|\d{4,})(?!\d)|\d{4},\d|,\d+[eEdD]|\d,(?!\d)|(?<!\d),\d")


def columns_of(
    file: Path, numbers: Sequence[int], chunks: Iterable[Sequence[Sequence[str]]], layout: Layout
) -> list[RawColumn]:
    """The columns of rows of cells: numbers, what stands in their place, and text.

    Arguments:
        file: for messages.
        numbers: number of the line of each row.
        chunks: the rows, some at a time.
        layout: which columns hold numbers.

    Raises:
        ValueError: a row of another width, or two decimal signs.
    """
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
