"""Which reader reads which file: one registry by suffix."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from jaxdamp import _checks
from jaxdamp._files import FOLDER_SUFFIXES, TEXT_SUFFIXES
from jaxdamp.bench.formats import read_mat, read_mdf, read_parquet, read_tdms, read_xlsx
from jaxdamp.bench.raw import RawTable
from jaxdamp.bench.text import read_text


Reader = Callable[[Path], list[RawTable]]
READERS: Mapping[str, Reader] = MappingProxyType(
    dict.fromkeys(TEXT_SUFFIXES, read_text)
    | {".xlsx": read_xlsx, ".xlsm": read_xlsx, ".mat": read_mat, ".tdms": read_tdms}
    | {".mf4": read_mdf, ".mdf": read_mdf, ".parquet": read_parquet}
)


def with_own(readers: Mapping[str, Reader] | None) -> dict[str, Reader]:
    """The readers of the library with those of the caller, which win."""
    for suffix, reader in (readers or {}).items():
        if not suffix.startswith(".") or suffix != suffix.lower():
            _checks.refuse("readers", "map suffixes such as '.pvp', in lower case, to functions", repr(suffix))
        if not callable(reader):
            _checks.refuse("readers", "map suffixes to functions", _checks.described(reader))
    return {**READERS, **(readers or {})}


def folder_suffixes(own: Mapping[str, Reader] | None) -> set[str]:
    """The suffixes of the files that a folder stands for: all but those of text files that may be notes."""
    return {*FOLDER_SUFFIXES, *(own or {})}


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
