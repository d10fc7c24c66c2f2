"""Reader of workbooks: the rows of each sheet as cells of text, laid out like those of a text file."""

import datetime
import zipfile
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import TypeAlias

import numpy as np

from jaxdamp.bench.layout import Block, Header, Layout, blocks_of, columns_of, header_of, layout_of, named_apart, title
from jaxdamp.bench.raw import RawColumn, RawTable, alone, library


_LARGEST_SHEET, _LARGE, _INFLATION = 2**29, 2**26, 100  # bytes of a part of a workbook, and how often it may grow
_UNCOMPUTED = "formula without a stored value; save the workbook in Excel"
Rows: TypeAlias = list[tuple[int, list[str]]]  # number of the row, from 1, and its cells
Sheets: TypeAlias = dict[str, list[tuple]]


def read_xlsx(file: Path) -> list[RawTable]:
    """Read a workbook: every sheet with rows of numbers is a record, or several, each under a header of its own."""
    openpyxl = library("openpyxl", file)
    _check_inflation(file)
    cells = _cells(file, openpyxl, computed=True)
    tables = _tables(file, cells)
    if not tables or any(_lacks_values(column) for table in tables for column in table.columns):
        cells = _with_formulas(cells, _cells(file, openpyxl, computed=False))
        tables = _tables(file, cells)
    if not tables and any(_UNCOMPUTED in row for rows in cells.values() for row in rows):
        raise ValueError(f"{file} holds no record, but a {_UNCOMPUTED}, or export it as CSV.")
    return alone(tables)


def _cells(file: Path, openpyxl: ModuleType, computed: bool) -> Sheets:
    """The rows of each sheet: with values, or with formulas where there are some."""
    book = openpyxl.load_workbook(file, read_only=True, data_only=computed)
    try:
        for sheet in book.worksheets:
            sheet.reset_dimensions()  # what is written there may be too small, and rows beyond it would be missing
        return {sheet.title: list(sheet.iter_rows(values_only=True)) for sheet in book.worksheets}
    finally:
        book.close()


def _check_inflation(file: Path) -> None:
    """Refuse a workbook whose parts inflate to more than those of any record."""
    with zipfile.ZipFile(file) as parts:
        for part in parts.infolist():
            swollen = part.file_size > _LARGE and part.file_size > _INFLATION * max(part.compress_size, 1)
            if part.file_size > _LARGEST_SHEET or swollen:
                size = f"{part.file_size / 2**20:.0f} MiB"
                limit = f"{_LARGEST_SHEET // 2**20} MiB, and {_INFLATION} times from {_LARGE // 2**20} MiB on"
                raise ValueError(f"{file}: {part.filename} inflates to {size}; the limit is {limit}. Export it as CSV.")


def _lacks_values(column: RawColumn) -> bool:
    return "" in column.faults.values() or (column.is_text and "" in np.asarray(column.values))


def _with_formulas(values: Sheets, formulas: Sheets) -> Sheets:
    """The sheets with a remark in the cells whose formula has no value."""

    def filled(row: tuple, other: tuple) -> tuple:
        pairs = zip(row, other, strict=True)
        return tuple(_UNCOMPUTED if a is None and b is not None else a for a, b in pairs)

    return {name: list(map(filled, rows, formulas[name])) for name, rows in values.items()}


def _tables(file: Path, sheets: Sheets) -> list[RawTable]:
    return [table for name, cells in sheets.items() for table in _sheet(file, name, _filled_rows(cells))]


def _sheet(file: Path, name: str, rows: Rows) -> list[RawTable]:
    """The records of a sheet, none if it holds no rows of numbers. Lines of messages are rows of the sheet."""
    layout = layout_of(rows, ";")
    header = None if layout is None or len(layout.full) < 2 else header_of(rows, layout)
    if layout is None or header is None:
        return []
    like = [number for number, (_, row) in enumerate(rows, 1) if row == rows[header.top][1]]
    blocks = blocks_of(lambda number: rows[number - 1][1], len(rows), header.top + 1, header.first + 1, like, layout)
    return named_apart([_block(file, rows, block, layout, header) for block in blocks], name)


def _block(file: Path, rows: Rows, block: Block, layout: Layout, header: Header) -> RawTable:
    """The record of a block of rows, named by what stands above it."""
    within = rows[block.first - 1 : block.end]
    stop = max(number for number, (_, row) in enumerate(within, 1) if layout.is_row(row))
    lines, body = [n for n, _ in within[:stop]], [row for _, row in within[:stop]]
    columns = zip(columns_of(file, lines, [body], layout), header.names, header.units, strict=True)
    named = [
        RawColumn(text, column.values, unit, column.faults)
        for column, text, unit in columns
        if text or not all(cell == "" for cell in np.asarray(column.values))
    ]
    preamble, behind = tuple(";".join(row) for _, row in rows[block.behind : block.header - 1]), len(within) - stop
    notes = (f"{behind} row{'s' * (behind > 1)} of another form behind the numbers left out",) if behind else ()
    record = title(preamble, block, rows[block.header - 1][0], layout)
    return RawTable(file, tuple(named), record, lines, preamble, notes)


def _filled_rows(cells: Sequence[tuple]) -> Rows:
    """The rows of a sheet with something in them, as text of one width, with their numbers."""
    width = max((i + 1 for row in cells for i, cell in enumerate(row) if cell is not None), default=0)
    rows = [(n, [_written(cell) for cell in (*row, *[None] * width)[:width]]) for n, row in enumerate(cells, 1)]
    return [(n, row) for n, row in rows if any(row)]


def _written(cell: object) -> str:
    """A cell as text that gives back the same number."""
    if cell is None:
        return ""
    if isinstance(cell, bool | int | float):
        return repr(float(cell))
    return cell.isoformat() if isinstance(cell, datetime.date | datetime.time) else str(cell).strip()
