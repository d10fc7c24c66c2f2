"""Several records of a test bench."""

import copy
import itertools
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, final, overload

from jaxdamp import _checks
from jaxdamp._tables import Contents
from jaxdamp._types import Figure
from jaxdamp.bench.runs import BenchRun


Selection = str | Iterable[str] | Callable[[BenchRun], bool]


@final
@dataclass(frozen=True, repr=False, eq=False)
class BenchSet:
    """Records in order, found by number or by name.

    Arguments:
        runs: the records.
        left_out: a sentence on each file that was to be read too, but could not (`read(skip_bad=True)`).

    >>> import numpy as np
    >>> time = np.arange(1000) / 1000
    >>> wave = np.sin(6 * np.pi * time)
    >>> runs = BenchSet([BenchRun.from_arrays(f"{a} mm", time, 1e-3 * a * wave, 100 * a * wave) for a in (5, 10, 20)])
    >>> runs.names
    ('5 mm', '10 mm', '20 mm')
    >>> runs["10 mm"].name, runs[-1].name, len(runs[1:]), len(runs.select("?0 mm"))
    ('10 mm', '20 mm', 2, 2)
    >>> runs.where(lambda run: abs(run.amplitude - 0.010) < 1e-4).names
    ('10 mm',)
    """

    runs: tuple[BenchRun, ...]
    left_out: tuple[str, ...]

    def __init__(self, runs: Iterable[BenchRun] = (), left_out: Iterable[str] = ()) -> None:
        runs = _records(runs, "runs")
        names = [run.name for run in runs]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            _checks.refuse("runs", "have different names", f"twice {', '.join(map(repr, twice))}")
        object.__setattr__(self, "runs", runs)
        object.__setattr__(self, "left_out", tuple(left_out))

    @property
    def names(self) -> tuple[str, ...]:
        """The names in order."""
        return tuple(run.name for run in self.runs)

    def __len__(self) -> int:
        return len(self.runs)

    def __iter__(self) -> Iterator[BenchRun]:
        return iter(self.runs)

    def __contains__(self, name: object) -> bool:
        return name in self.names or name in self.runs

    @overload
    def __getitem__(self, key: int | str) -> BenchRun: ...
    @overload
    def __getitem__(self, key: slice) -> "BenchSet": ...
    def __getitem__(self, key: int | str | slice) -> "BenchRun | BenchSet":
        """One record by number or name, or a part of the set by a slice."""
        if isinstance(key, slice):
            return BenchSet(self.runs[key])
        if isinstance(key, str):
            return self.runs[self._index(key)]
        if not -len(self) <= key < len(self):
            raise IndexError(f"There are {len(self)} records, so there is no number {key}.")
        return self.runs[key]

    def __add__(self, other: "BenchSet") -> "BenchSet":
        """Both sets, one behind the other."""
        return BenchSet(self.runs + other.runs, self.left_out + other.left_out)

    def _index(self, name: str) -> int:
        if name in self.names:
            return self.names.index(name)
        near = get_close_matches(name, self.names, 3, cutoff=0.4)
        hint = f"Did you mean {' or '.join(map(repr, near))}?" if near else f"There are {', '.join(self.names[:8])}."
        raise KeyError(f"No record is called {name!r}. {hint}")

    def _chosen(self, what: Selection) -> list[bool]:
        if callable(what):
            return [bool(what(run)) for run in self.runs]
        patterns = [what] if isinstance(what, str) else list(what)
        for pattern in patterns:
            if not any(name == pattern or fnmatchcase(name, pattern) for name in self.names):
                self._index(pattern)
        return [any(name == p or fnmatchcase(name, p) for p in patterns) for name in self.names]

    def select(self, what: Selection) -> "BenchSet":
        """The records that a function accepts, or whose name is given or fits a pattern such as "5mm_*".

        Raises:
            KeyError: no record has the name or fits the pattern.
        """
        return BenchSet(run for run, yes in zip(self.runs, self._chosen(what), strict=True) if yes)

    def where(self, predicate: Callable[[BenchRun], bool]) -> "BenchSet":
        """The records that a function accepts: `runs.where(lambda run: run.peak_velocity < 0.5)`."""
        return self.select(predicate)

    def without(self, what: Selection) -> "BenchSet":
        """All records but those that `select` would give."""
        return BenchSet(run for run, yes in zip(self.runs, self._chosen(what), strict=True) if not yes)

    def process(self, **steps: Any) -> "BenchSet":
        """Every record with further steps of processing, see `BenchRun.process`."""
        return BenchSet((run.process(**steps) for run in self.runs), self.left_out)

    def plot(self) -> Figure:
        """Loops of the records over velocity and stroke, and their channels over time (`plots.records`)."""
        from jaxdamp import plots

        return plots.records(self)

    def table(self) -> list[Contents]:
        """One row of figures in SI per record: a list that `pandas.DataFrame` takes as it is."""
        return [run.summary() for run in self.runs]

    def describe(self) -> str:
        """All records and what was done to their data, in words."""
        missing = [f"left out: {sentence}" for sentence in self.left_out]
        return "\n\n".join([run.describe() for run in self.runs] + missing)

    def write(self, folder: str | os.PathLike[str]) -> tuple[Path, ...]:
        """Write every record to `<folder>/<name>.csv`, making the folder if need be. `read(folder)` reads them."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / f"{_file_name(run.name)}.csv" for run in self.runs]
        if len(set(files)) < len(files):
            _checks.refuse("runs", "have names that make different files", ", ".join(self.names))
        return tuple(run.to_csv(file) for run, file in zip(self.runs, files, strict=True))

    def __repr__(self) -> str:
        if not self.runs:
            return "BenchSet(empty)"
        width = max(4, *(len(name) for name in self.names))
        lines = [
            f"BenchSet of {len(self)} record{'s' if len(self) > 1 else ''}",
            f"  {'name':<{width}}  {'Hz':>7}  {'mm':>7}  {'m/s':>7}  {'N':>17}  {'J/cycle':>8}  {'cycles':>6}",
        ]
        for run in self.runs:
            force = f"{run.force.min():.0f} … {run.force.max():.0f}"
            lines.append(
                f"  {run.name:<{width}}  {run.frequency:>7.4g}  {1e3 * run.amplitude:>7.4g}  "
                f"{run.peak_velocity:>7.3g}  {force:>17}  {run.work_per_cycle:>8.4g}  {run.cycles:>6}"
            )
        if self.left_out:
            lines.append(f"  left out {len(self.left_out)}: see left_out")
        return "\n".join(lines)


def _file_name(name: str) -> str:
    """The name with what file systems do not like replaced."""
    return "".join("_" if c in '/\\:*?"<>|' or ord(c) < 32 else c for c in name).strip(" .") or "record"


def as_runs(runs: object, argument: str = "runs", call: str = "") -> tuple[BenchRun, ...]:
    """One record or many as a tuple.

    Arguments:
        runs: a record, or any collection of records.
        argument: its name in messages.
        call: how the function is called, for arguments in the wrong order.

    Returns:
        The records; of several with one name, the others have it with a number, and a note that says so.

    Raises:
        ValueError: anything that is no record.
    """
    records = _records(runs, argument, call)
    taken = {run.name for run in records}
    return records if len(taken) == len(records) else tuple(_numbered(records, taken))


def _numbered(runs: Sequence[BenchRun], taken: set[str]) -> Iterator[BenchRun]:
    """The records with different names, of which some are taken already."""
    seen = set[str]()
    for run in runs:
        if run.name not in seen:
            seen.add(run.name)
            yield run
            continue
        name = next(name for k in itertools.count(2) if (name := f"{run.name} ({k})") not in taken)
        taken.add(name)
        other = copy.copy(run)  # which keeps how it was processed
        object.__setattr__(other, "name", name)
        object.__setattr__(other, "notes", (*run.notes, f"called {name!r}, as another record is called {run.name!r}"))
        yield other


def _records(runs: object, argument: str, call: str = "") -> tuple[BenchRun, ...]:
    remedy = "Read files with `bench.read(paths)`; `BenchRun.from_arrays` makes a record of arrays."
    remedy = f"The call is `{call}`. {remedy}" if call else remedy
    if isinstance(runs, BenchRun):
        return (runs,)
    if isinstance(runs, str | os.PathLike | Mapping) or not isinstance(runs, Iterable):
        _checks.refuse(argument, "be a record or records", _checks.described(runs), remedy)
    runs = tuple(runs)
    for index, run in enumerate(runs):
        _checks.instance(f"{argument}[{index}]", run, BenchRun, "be a record", remedy)
    return runs
