"""Readers of files by suffix: text, workbooks, MATLAB, TDMS, MDF4, Parquet. The libraries are the extra `io`."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TypedDict

from jaxdamp import _checks
from jaxdamp._files import TEXT_SUFFIXES
from jaxdamp.bench.channel_files import read_mdf, read_parquet, read_tdms
from jaxdamp.bench.matlab import read_mat
from jaxdamp.bench.raw import RawTable
from jaxdamp.bench.text import read_text
from jaxdamp.bench.workbook import read_xlsx


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
    """The records of a file as they are stored. A file with an unknown suffix is read as text."""
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
