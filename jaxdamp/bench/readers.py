"""Readers of files by suffix: text, workbooks, MATLAB, TDMS, MDF4, Parquet. The libraries are the extra `io`."""

import datetime
import importlib
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any, TypeAlias, TypedDict

import numpy as np

from jaxdamp import _checks
from jaxdamp._files import TEXT_SUFFIXES
from jaxdamp.bench.layout import columns_of, header_of, layout_of
from jaxdamp.bench.raw import RawColumn, RawTable
from jaxdamp.bench.text import read_text


_LARGEST_SHEET, _LARGE, _INFLATION = 2**29, 2**26, 100  # bytes of a part of a workbook, and how often it may grow
_MOST_COLUMNS = 64  # of a matrix in a MATLAB file that is taken for channels side by side


def library(module: str, file: Path) -> ModuleType:
    """A library that only this format needs."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(
            f"{file}: {file.suffix} files need the library {module.split('.')[0]!r}. Install it with "
            "pip install 'jaxdamp[io]', or export the record as CSV."
        ) from error


def read_xlsx(file: Path) -> list[RawTable]:
    """Read a workbook: every sheet with rows of numbers is a record."""
    openpyxl = library("openpyxl", file)
    _check_inflation(file)
    book = openpyxl.load_workbook(file, read_only=True, data_only=True)
    try:
        sheets = {sheet.title: list(sheet.iter_rows(values_only=True)) for sheet in book.worksheets}
    finally:
        book.close()
    return _alone([table for name, rows in sheets.items() if (table := _sheet(file, name, rows)) is not None])


def _check_inflation(file: Path) -> None:
    """Refuse a workbook whose parts inflate to more than those of any record."""
    with zipfile.ZipFile(file) as parts:
        for part in parts.infolist():
            swollen = part.file_size > _LARGE and part.file_size > _INFLATION * max(part.compress_size, 1)
            if part.file_size > _LARGEST_SHEET or swollen:
                size = f"{part.file_size / 2**20:.0f} MiB"
                limit = f"{_LARGEST_SHEET // 2**20} MiB, and {_INFLATION} times from {_LARGE // 2**20} MiB on"
                raise ValueError(f"{file}: {part.filename} inflates to {size}; the limit is {limit}. Export it as CSV.")


def _sheet(file: Path, name: str, cells: list[tuple]) -> RawTable | None:
    """The record of a sheet, or None if it holds no rows of numbers. Lines of messages are rows of the sheet."""
    rows = _filled_rows(cells)
    layout = layout_of(rows, ";")
    header = None if layout is None or len(layout.full) < 2 else header_of(rows, layout)
    if layout is None or header is None:
        return None
    stop = max(i for i, (_, row) in enumerate(rows, 1) if layout.is_row(row))
    lines, body = [n for n, _ in rows[header.first : stop]], [row for _, row in rows[header.first : stop]]
    columns = zip(columns_of(file, lines, [body], layout), header.names, header.units, strict=True)
    named = [
        RawColumn(title, column.values, unit, column.faults)
        for column, title, unit in columns
        if title or not all(text == "" for text in np.asarray(column.values))
    ]
    preamble, behind = tuple(";".join(row) for _, row in rows[: header.top]), len(rows) - stop
    notes = (f"{behind} row{'s' * (behind > 1)} of another form behind the numbers left out",) if behind else ()
    return RawTable(file, tuple(named), name, lines, preamble, notes)


def _filled_rows(cells: list[tuple]) -> list[tuple[int, list[str]]]:
    """The rows of a sheet with something in them, as text of one width, with their numbers."""
    width = max((i + 1 for row in cells for i, cell in enumerate(row) if cell is not None), default=0)
    rows = [(n, [_written(cell) for cell in (*row, *[None] * width)[:width]]) for n, row in enumerate(cells, 1)]
    return [(n, row) for n, row in rows if any(row)]


Structure: TypeAlias = dict[str, Any]  # of a MATLAB file: arrays, numbers, texts, lists and structures


def _written(cell: object) -> str:
    """A cell as text that gives back the same number."""
    if cell is None:
        return ""
    if isinstance(cell, bool | int | float):
        return repr(float(cell))
    return cell.isoformat() if isinstance(cell, datetime.date | datetime.time) else str(cell).strip()


def read_mat(file: Path) -> list[RawTable]:
    """Read a MATLAB file, v5 to v7.3: vectors side by side, in the file or in a structure, are a record."""
    content = library("pymatreader", file).read_mat(file)
    return _alone(list(_structures(file, "", {k: v for k, v in content.items() if not k.startswith("__")})))


def _structures(file: Path, name: str, fields: Structure) -> Iterator[RawTable]:
    """The record of a structure, and those of the structures inside it."""
    units = next((fields[key] for key in ("units", "unit") if isinstance(fields.get(key), dict)), {})
    columns, inside = [], {}
    for key, value in fields.items():
        if isinstance(value, dict) and value is not units:
            channel = _channel(key, value)
            columns += channel
            if not channel:
                inside[key] = value
        else:
            columns += _vectors(key, value, units.get(key, ""))
    table = _of_one_length(file, name, columns)
    if table is not None:
        yield table
    for key, value in inside.items():
        for index, element in enumerate(elements := _elements(value)):
            place = f"{key}[{index}]" if len(elements) > 1 else key
            yield from _structures(file, f"{name}.{place}".lstrip("."), element)


def _elements(value: Structure) -> list[Structure]:
    """The elements of an array of structures, which is read as a structure of lists."""
    lists = [item for item in value.values() if isinstance(item, list)]
    if not lists or len(lists) < len(value) or len(set(map(len, lists))) > 1:
        return [value]
    return [{key: item[index] for key, item in value.items()} for index in range(len(lists[0]))]


def _channel(name: str, fields: Structure) -> list[RawColumn]:
    """A structure that is one channel: its samples and the text of its unit."""
    unit = next((fields[key] for key in ("unit", "units", "Unit", "Units") if isinstance(fields.get(key), str)), None)
    vectors = [column for key, value in fields.items() for column in _vectors(key, value, unit or "")]
    return [RawColumn(name, vectors[0].values, unit)] if unit is not None and len(vectors) == 1 else []


def _vectors(name: str, value: object, unit: str) -> list[RawColumn]:
    """The columns of a variable: itself, or those of a matrix of channels side by side."""
    if isinstance(value, list) and len(value) > 1 and all(isinstance(item, str) for item in value):
        return [RawColumn(name, value, unit)]
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biufmM" or value.size < 2:
        return []
    value = np.squeeze(value)
    if value.ndim == 1:
        return [RawColumn(name, value, unit)]
    if value.ndim != 2 or min(value.shape) > _MOST_COLUMNS:
        return []
    value = value if value.shape[0] >= value.shape[1] else value.T
    return [RawColumn(f"{name}[{index}]", column, unit) for index, column in enumerate(value.T)]


def read_tdms(file: Path) -> list[RawTable]:
    """Read a TDMS file: every group is a record. Waveforms without a channel for the time bring their own."""
    content, tables = library("nptdms", file).TdmsFile.read(file), []
    for group in content.groups():
        columns = []
        for channel in group.channels():
            columns.append(RawColumn(channel.name, channel[:], str(channel.properties.get("unit_string", ""))))
            step = channel.properties.get("wf_increment")
            if step and len(channel) and not any(column.name == "time" for column in columns):
                columns.append(RawColumn("time", channel.time_track(), "s"))
        tables.append(_of_one_length(file, group.name, columns))
    return _alone([table for table in tables if table is not None])


def read_mdf(file: Path) -> list[RawTable]:
    """Read an MDF file: channel groups with the same clock are a record together."""
    tables: list[tuple[str, np.ndarray, list[RawColumn]]] = []
    with library("asammdf", file).MDF(file) as content:
        for index, group in enumerate(content.groups):
            clock = np.asarray(content.get_master(index), dtype=np.float64)
            channels = [content.get(group=index, index=i) for i, c in enumerate(group.channels) if c.channel_type == 0]
            columns = [RawColumn(c.name, c.samples, c.unit) for c in channels if c.samples.dtype.kind in "biuf"]
            same = next((t for t in tables if np.array_equal(t[1], clock)), None)
            if same is not None:
                same[2].extend(columns)
            else:
                name = group.channel_group.acq_name or group.channel_group.comment or f"group {index}"
                tables.append((name, clock, columns))
    names = [name for name, _, _ in tables]
    return _alone(
        [
            RawTable(file, (RawColumn("time", clock, "s"), *columns), name if names.count(name) == 1 else f"{name} {i}")
            for i, (name, clock, columns) in enumerate(tables)
        ]
    )


def read_parquet(file: Path) -> list[RawTable]:
    """Read a Parquet file; units may stand in the metadata of its fields, as "unit"."""
    library("pyarrow", file)
    table, columns = library("pyarrow.parquet", file).read_table(file), []
    for field, data in zip(table.schema, table.columns, strict=True):
        unit = (field.metadata or {}).get(b"unit", b"").decode()
        values = data.to_numpy()
        columns.append(RawColumn(field.name, values if values.dtype.kind != "O" else [str(v) for v in values], unit))
    return [RawTable(file, tuple(columns))]


def _of_one_length(file: Path, name: str, columns: list[RawColumn]) -> RawTable | None:
    """The columns of the length that most of them have, and a note on the rest; None if they are not two."""
    lengths = [len(column.values) for column in columns]
    length = max(lengths, key=lambda n: (lengths.count(n), n), default=0)
    same = [column for column, n in zip(columns, lengths, strict=True) if n == length]
    others = [f"{column.name} ({n})" for column, n in zip(columns, lengths, strict=True) if n != length]
    notes = (f"left out, because they do not have {length} samples: {', '.join(others)}",) if others else ()
    return RawTable(file, tuple(same), name, notes=notes) if len(same) > 1 else None


def _alone(tables: list[RawTable]) -> list[RawTable]:
    """A record that is the only one of its file needs no name."""
    if len(tables) != 1:
        return tables
    (only,) = tables
    return [RawTable(only.file, only.columns, "", only.lines, only.preamble, only.notes)]


Reader = Callable[[Path], list[RawTable]]
READERS: Mapping[str, Reader] = MappingProxyType(
    dict.fromkeys(TEXT_SUFFIXES, read_text)
    | {".xlsx": read_xlsx, ".xlsm": read_xlsx, ".mat": read_mat, ".tdms": read_tdms}
    | {".mf4": read_mdf, ".mdf": read_mdf, ".parquet": read_parquet}
)


class Files(TypedDict, total=False):
    """What is said of all files with measured numbers.

    Arguments:
        units: quantity or channel, also "time" and "road", to unit, where the header has none or a wrong one.
        delimiter: the character between columns of text files, if the search fails.
        readers: suffix to function that reads such files, beside or instead of `READERS` (docs/own_reader.md).
    """

    units: Mapping[str, str] | None
    delimiter: str | None
    readers: Mapping[str, Reader] | None


class BenchFiles(Files, total=False):
    """What is said of files of a test bench: keywords of `Files`, and these.

    Arguments:
        columns: quantity to header or number (from 0) of its column, for "time", "stroke", "velocity", "force",
            "temperature" and "command"; None leaves the file's column unused.
        gains: quantity to gain of its sensor, for columns in volts: `{"force": "500 N/V", "stroke": "10 mm/V - 2 mm"}`.
        sampling_rate: samples per second [Hz], for files without a time column.
        stroke_from_velocity: integrate the velocity of files without a stroke, as for laws that need no place of the
            stroke; `BenchRun.stroke_is_integrated` says so.
    """

    columns: Mapping[str, str | int | None] | None
    gains: Mapping[str, str] | None
    sampling_rate: float | int | None
    stroke_from_velocity: bool | None


FILES: Files = {"units": None, "delimiter": None, "readers": None}
BENCH_FILES: BenchFiles = {
    **FILES, "columns": None, "gains": None, "sampling_rate": None, "stroke_from_velocity": None
}  # fmt: skip


def with_own(readers: Mapping[str, Reader] | None) -> dict[str, Reader]:
    """The readers of the library with those of the caller, which win."""
    for suffix, reader in (readers or {}).items():
        if not suffix.startswith(".") or suffix != suffix.lower():
            _checks.refuse("readers", "map suffixes such as '.pvp', in lower case, to functions", repr(suffix))
        if not callable(reader):
            _checks.refuse("readers", "map suffixes to functions", _checks.described(reader))
    return {**READERS, **(readers or {})}


def read_tables(file: Path, readers: Mapping[str, Reader], delimiter: str | None = None) -> list[RawTable]:
    """The records of a file as they are stored. A file with an unknown suffix is read as text.

    Raises:
        ValueError: the file is damaged, of another format, or holds no record.
        ImportError: the library for this format is missing.
    """
    reader = readers.get(file.suffix.lower(), read_text)
    if reader is read_text:
        return read_text(file, delimiter)
    if not file.stat().st_size:
        raise ValueError(f"{file} is empty: export it from the bench again.")
    try:
        tables = reader(file)
    except ImportError:
        raise
    except Exception as error:  # each library has its own classes of errors for damaged files
        if isinstance(error, ValueError) and str(error).startswith(str(file)):
            raise
        raise ValueError(
            f"{file} cannot be read as {file.suffix} ({type(error).__name__}: {error}). It may be damaged or of "
            "another format: export it again, or as CSV."
        ) from error
    if not tables:
        raise ValueError(f"{file} holds no record: no two channels of the same length with numbers. Export it again.")
    return tables
