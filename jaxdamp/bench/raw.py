"""One record of a file as it was stored, before anything is known of its columns; all its problems in one message."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import final

import numpy as np

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting


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
    """Collects errors of single things, to raise them together.

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
    def collected(self) -> Iterator[None]:
        """Keep the error of this block, if it has one, and go on behind it."""
        try:
            yield
        except (ValueError, OSError, ImportError) as error:
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
    """Several errors in one message.

    Attributes:
        errors: each of them.
    """

    def __init__(self, errors: Sequence[Exception], remedy: str = "", *settings: Setting) -> None:
        lines = [f"  {number}. {error}" for number, error in enumerate(errors, 1)] + [remedy] * bool(remedy)
        named = [setting for error in errors for setting in getattr(error, "settings", ())]
        super().__init__("\n".join([f"{len(errors)} problems:", *lines]), *named, *settings)
        self.errors = tuple(errors)
