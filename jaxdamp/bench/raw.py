"""Records of a file as they were stored, before anything is known of their columns; all problems in one message."""

import importlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, TypeAlias, final

import numpy as np

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting
from jaxdamp.bench.headers import role_of


@final
@dataclass(frozen=True, eq=False)
class RawColumn:
    """One channel as a file stores it.

    Arguments:
        name: its header; empty if the file has none.
        values: numbers, text (such as time stamps) or dates, one a sample. Numbers become float64, dates seconds from
            the first one.
        unit: as the file states it; empty if it stands in the name, or nowhere.
        faults: sample to the text that stands there instead of a number, for which `values` has NaN.

    >>> RawColumn("Load", [1, 2, 3], "kN").values
    array([1., 2., 3.])
    """

    name: str
    values: np.ndarray | Sequence[object]
    unit: str = ""
    faults: Mapping[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        values = np.asarray(self.values)
        if values.ndim != 1:
            _checks.refuse(f"values of column {self.name!r}", "be one number a sample", _checks.described(values))
        if values.dtype.kind in "mM":
            values = (values - values[:1]) / np.timedelta64(1, "s")
            object.__setattr__(self, "unit", "s")
        elif values.dtype.kind in "OUS":
            values = values.astype(object)
        elif values.dtype.kind in "biuf":
            values = values.astype(np.float64)
        else:
            _checks.refuse(f"values of column {self.name!r}", "be numbers, text or dates", _checks.described(values))
        object.__setattr__(self, "values", values)

    def _rows(self, rows: slice) -> "RawColumn":
        """Some of the samples."""
        start, stop, _ = rows.indices(len(self.values))
        faults = {row - start: text for row, text in self.faults.items() if start <= row < stop}
        return replace(self, values=self.values[rows], faults=faults)

    @property
    def is_text(self) -> bool:
        """Whether it holds text, such as time stamps, instead of numbers."""
        return np.asarray(self.values).dtype.kind == "O"


@final
@dataclass(frozen=True, eq=False)
class RawTable:
    """One record of a file: its columns, of equal length. What a reader of files returns, one table a record.

    Arguments:
        file: where it was read.
        columns: the channels in the order of the file.
        record: name of the record inside the file (its sheet or group); empty if the file holds one only. Tables of
            one name are one record whose channels have clocks of their own.
        lines: number of the line or row of the file for each sample, for messages; empty for binary files.
        preamble: the lines before the header.
        notes: sentences on what was left out.

    Raises:
        ValueError: columns of different lengths.
    """

    file: Path
    columns: tuple[RawColumn, ...]
    record: str = ""
    lines: Sequence[int] = ()
    preamble: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", tuple(self.columns))
        lengths = {column.name: len(column.values) for column in self.columns}
        if len(set(lengths.values())) > 1:
            _checks.refuse("columns", "have the same number of samples", str(lengths))

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.columns[0].values) if self.columns else 0

    @property
    def where(self) -> str:
        """The file and the record in it, for messages."""
        return f"{self.file}, record {self.record!r}" if self.record else str(self.file)

    def place(self, sample: int) -> str:
        """Where a sample stands in the file, for messages: its line, or its number from 1."""
        return f"line {self.lines[sample]}" if len(self.lines) else f"sample {sample + 1}"

    @property
    def is_named(self) -> bool:
        """Whether the file names its columns."""
        return any(column.name for column in self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """The headers; "column 2" where there is none."""
        return tuple(column.name or f"column {index}" for index, column in enumerate(self.columns))


class Problems:
    """Collects errors of single things, to raise them together; what is wrong alike in several files is said once.

    >>> problems = Problems()
    >>> for text in ("one", "two"):
    ...     with problems.collected():
    ...         raise ValueError(text)
    >>> problems.raise_any()
    Traceback (most recent call last):
    ...
    jaxdamp.bench.raw.Several: 2 problems:
      1. one
      2. two
    """

    def __init__(self) -> None:
        self.errors: list[Exception] = []

    @contextmanager
    def collected(self, where: str = "") -> Iterator[None]:
        """Keep the error of this block on a file or a table, if it has one, and go on behind it."""
        try:
            yield
        except (ValueError, OSError, ImportError) as error:
            if isinstance(error, ArgumentError):
                error.where = error.where or where
            self.errors.append(error)

    def raise_any(self, remedy: str = "", *settings: Setting) -> None:
        """Raise what was collected: a single error as it is, several as one; and what else could be done."""
        errors = [each for error in self.errors for each in (error.errors if isinstance(error, Several) else [error])]
        if len(errors) > 1:
            raise Several(errors, remedy, *settings)
        for error in errors:
            if remedy and isinstance(error, ValueError):
                raise ArgumentError(f"{error} {remedy}", *getattr(error, "settings", ()), *settings) from error
            raise error


class Several(ArgumentError):
    """Several errors in one message."""

    def __init__(self, errors: Sequence[Exception], remedy: str = "", *settings: Setting) -> None:
        said = _said(errors)
        lines = [f"  {number}. {text}" for number, text in enumerate(said, 1)]
        named = [setting for error in errors for setting in getattr(error, "settings", ())]
        text = "\n".join([f"{len(said)} problems:", *lines]) if len(said) > 1 else said[0]
        super().__init__("\n".join([text, *[remedy] * bool(remedy)]), *named, *settings)
        self.errors = tuple(errors)


def _said(errors: Sequence[Exception]) -> list[str]:
    """What errors say, those that differ in the file only as one."""
    places: dict[str, list[str]] = {}
    for error in errors:
        where = error.where if isinstance(error, ArgumentError) and str(error).startswith(error.where) else ""
        places.setdefault(str(error).removeprefix(where), []).append(where)
    said = []
    for text, (first, *more) in places.items():
        others = ", ".join(filter(None, more))
        said.append(f"{first}{text}" + f" The same in {others}." * bool(others))
    return said


Untyped: TypeAlias = Any  # an object of a library that states no types


def library(module: str, file: Path) -> ModuleType:
    """A library that only this format needs."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(
            f"{file}: {file.suffix} files need the library {module.split('.')[0]!r}. Install it with "
            "pip install 'jaxdamp[io]', or export the record as CSV."
        ) from error


def in_words(value: object) -> str:
    """A value of a column that is a number or a name."""
    return f"{value:g}" if isinstance(value, float) else str(value)


class Clock(NamedTuple):
    """The uniform instants of a channel: the first one and the step, both in seconds."""

    start: float
    step: float


def tables_by_clock(
    file: Path,
    record: str,
    columns: Sequence[RawColumn],
    clocks: Sequence[Clock | None] = (),
    notes: Sequence[str] = (),
) -> list[RawTable]:
    """The channels of a record as tables of its name, one for each number of samples and clock; none if no two fit.

    The table with most channels is the first, the others are to be brought onto its clock (`record_tables`). Channels
    without a clock have that of the others of their length, if it is only one, and a channel of the time wins over it.
    """
    tables = [
        RawTable(file, tuple(group), record, notes=tuple(notes))
        for group in _groups(columns, [*clocks] or [None] * len(columns))
    ]
    tables.sort(key=lambda table: (len(table.columns), len(table)), reverse=True)
    return tables if tables and len(tables[0].columns) > 1 else []


def _groups(columns: Sequence[RawColumn], clocks: Sequence[Clock | None]) -> list[list[RawColumn]]:
    """The channels of each number of samples and clock, with the instants of the clock."""
    lengths = [len(column.values) for column in columns]
    timed = {n for n, column in zip(lengths, columns, strict=True) if _is_time(column)}
    clocks_of = {count: {c for n, c in zip(lengths, clocks, strict=True) if n == count and c} for count in lengths}
    groups: dict[tuple[int, Clock | None], list[RawColumn]] = {}
    for column, count, clock in zip(columns, lengths, clocks, strict=True):
        if count in timed:
            clock = None
        elif len(clocks_of[count]) == 1:
            (clock,) = clocks_of[count]
        groups.setdefault((count, clock), []).append(column)
    for (count, clock), group in groups.items():
        if clock is not None:
            group.insert(1, RawColumn("time", clock.start + clock.step * np.arange(count), "s"))
    return list(groups.values())


def _is_time(column: RawColumn) -> bool:
    """Whether a channel holds the instants of others: it is named so, and increases."""
    rises = column.is_text or bool(np.all(np.diff(np.asarray(column.values)) > 0))
    return rises and role_of(column.name, column.unit) == "time"


def alone(tables: list[RawTable]) -> list[RawTable]:
    """The tables of a file; the record that is the only one of its file needs no name."""
    return [replace(table, record="") for table in tables] if len({table.record for table in tables}) == 1 else tables


def apart(names: Sequence[str]) -> list[str]:
    """Names with a number behind those that are there several times.

    >>> apart(["cold", "warm", "warm"])
    ['cold', 'warm 2', 'warm 3']
    """
    return [f"{name} {number}".strip() if names.count(name) > 1 else name for number, name in enumerate(names, 1)]
