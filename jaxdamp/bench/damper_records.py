"""The records of many dampers, read when they are asked for: of a folder tree, a table of files, or by a function."""

import csv
import functools
import hashlib
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import final

from jaxdamp import _checks
from jaxdamp._files import FOLDER_SUFFIXES, natural_key
from jaxdamp.bench.manifest import NAME, find_manifest
from jaxdamp.bench.raw import library
from jaxdamp.bench.read import read
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.sets import BenchSet, as_runs


COLUMNS = ("damper", "file")  # of a table of files


@final
class DamperRecords(Mapping[str, tuple[BenchRun, ...]]):
    """The records of many dampers by name, of which none is held: they are read or made each time they are asked for.

    Arguments:
        read: a function from a key to the records of a damper. Other processes get one at the top of a module.
        keys: one for each damper: a number, a path, anything that `read` takes.
        names: of the dampers; the keys as texts if they are left out.
        stamps: a text for each damper that changes whenever its records change, as those of `bench.read_dampers` do.

    Raises:
        ValueError: names that are empty or there twice; not as many names or stamps as keys.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Linear
    >>> def made(i):
    ...     return bench.VirtualDyno(Linear(1000.0 + i)).run(bench.SineTest(0.01, 2.0))
    >>> many = bench.DamperRecords(made, range(20_000))
    >>> len(many), f"{many['3'][0].force.max():.0f} N"
    (20000, '126 N')
    """

    def __init__(
        self,
        read: Callable[..., BenchRun | Iterable[BenchRun]],
        keys: Iterable[object],
        names: Iterable[str] | None = None,
        stamps: Iterable[str] | None = None,
    ) -> None:
        if not callable(read):
            remedy = "The call is `DamperRecords(function, range(20_000))`."
            _checks.refuse("read", "be a function that gives the records of a damper", _checks.described(read), remedy)
        keys = list(keys)
        texts = {"names": list(map(str, keys if names is None else names))}
        texts["stamps"] = [""] * len(keys) if stamps is None else list(stamps)
        for argument, each in texts.items():
            if len(each) != len(keys):
                _checks.refuse(argument, f"have one text for each of {len(keys)} dampers", f"{len(each)} texts")
        self._read = read
        self._dampers = dict(zip(texts["names"], zip(keys, texts["stamps"], strict=True), strict=True))
        if len(self._dampers) < len(keys) or "" in self._dampers:
            name, times = Counter(texts["names"]).most_common(1)[0]
            _checks.refuse("names", "be different and not empty", f"{times} times {name!r}" if times > 1 else "''")

    def __getitem__(self, name: str) -> tuple[BenchRun, ...]:
        """The records of a damper, read now."""
        return as_runs(self._read(self._dampers[name][0]), f"dampers[{name!r}]")

    def __iter__(self) -> Iterator[str]:
        return iter(self._dampers)

    def __contains__(self, name: object) -> bool:
        return name in self._dampers

    def __len__(self) -> int:
        return len(self._dampers)

    def __repr__(self) -> str:
        return f"DamperRecords of {len(self)} dampers"

    def stamp(self, name: str) -> str:
        """The text that changes whenever the records of a damper change; empty if nothing was stated."""
        return self._dampers[name][1]

    def process(self, **steps: object) -> "DamperRecords":
        """The records with steps done, as by `BenchSet.process`, each time they are read.

        Arguments:
            steps: of `BenchRun.process`, such as `moving=True`.
        """
        if not steps:
            return self
        keys, stamps = zip(*self._dampers.values(), strict=True)
        read = functools.partial(_processed, self._read, steps)
        return DamperRecords(read, keys, self._dampers, [f"{stamp} {_said(steps)}".strip() for stamp in stamps])

    def part(self, names: Iterable[str]) -> "DamperRecords":
        """Some of the dampers."""
        names = list(names)
        keys, stamps = zip(*(self._dampers[name] for name in names), strict=True) if names else ((), ())
        return DamperRecords(self._read, keys, names, stamps)


def _processed(read: Callable[..., object], steps: Mapping[str, object], key: object) -> BenchSet:
    process: Callable[..., BenchSet] = BenchSet(as_runs(read(key))).process
    return process(**steps)


def read_dampers(paths: str | os.PathLike[str], *, each: str, **options: object) -> DamperRecords:
    """The records of a production line: a folder tree or a table of files, of which each damper is read when needed.

    Hidden folders and files are left out. A `jaxdamp.toml` at the top says how all records are read, unless the folder
    of a damper has its own. A file counts as changed if its size or its time of change is another, and all do if they
    are read in another way.

    Arguments:
        paths: a folder, with all folders in it, in natural order; or a table (.csv or .parquet) with the columns
            "damper" and "file" and a row for each file, relative to the folder of the table, in the order of its rows.
        each: what is a damper: every "folder" with records, by its path, every "file", by its path without suffix,
            or, of a table, every "name" in it.
        options: how the records are read, as in `bench.read`, such as `sign="compression-positive"`.

    Returns:
        The dampers, as `identify.fit_many` takes them.

    Raises:
        FileNotFoundError: no such folder or table, or one without records.
        ValueError: `each` does not suit the paths; a table without its columns.

    >>> import tempfile
    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Linear
    >>> line = Path(tempfile.mkdtemp())
    >>> for number in (2, 10):
    ...     runs = bench.VirtualDyno(Linear(1000.0 + number)).run(bench.SineTest(0.01, 2.0))
    ...     _ = runs.write(line / "monday" / f"damper {number}")
    >>> list(bench.read_dampers(line, each="folder"))
    ['monday/damper 2', 'monday/damper 10']
    """
    top = Path(paths).expanduser().absolute()
    kinds = ("folder", "file") if top.is_dir() else ("name",)
    _checks.one_of("each", each, kinds)
    if not top.exists():
        raise FileNotFoundError(f"There is no folder or table {os.fspath(paths)!r}.")
    files = _of_tree(top, each) if top.is_dir() else _of_table(top)
    if not files:
        raise FileNotFoundError(f"{top} holds no *.csv or other file of records.")
    common = (top if top.is_dir() else top.parent) / NAME
    given, said = options.get("manifest", True), _said(options)
    manifest_here = find_manifest(given, [top]) if isinstance(given, str | os.PathLike) else None
    manifest_here = (
        None if manifest_here is None else manifest_here.absolute()
    )  # also read where the working directory is another one
    manifests = [manifest_here or (_manifest(some[0].parent, common) if given else None) for some in files.values()]
    keys = list(zip(files.values(), manifests, strict=True))
    stamps = [f"{_stamp(some if at is None else [*some, at])} {said}".strip() for some, at in keys]
    return DamperRecords(functools.partial(_read_damper, options), keys, files, stamps)


def _read_damper(options: Mapping[str, object], key: tuple[list[Path], Path | None]) -> Iterable[BenchRun]:
    """The records of the files of a damper, as their manifest says."""
    files, manifest = key
    reading: Callable[..., BenchSet] = read
    return reading(files, **{**options, "manifest": False if manifest is None else manifest})


def _of_tree(top: Path, each: str) -> dict[str, list[Path]]:
    """The files of each damper by its name, in natural order."""
    dampers: dict[str, list[Path]] = {}
    for folder, inside, names in os.walk(top):
        inside[:] = [name for name in inside if not name.startswith(".") and not name.endswith(".zarr")]
        for name in names:
            file = Path(folder, name)
            if file.suffix.lower() in FOLDER_SUFFIXES and not name.startswith((".", "~$")):
                damper = file.parent if each == "folder" else file.with_suffix("")
                inner = damper.relative_to(top)
                dampers.setdefault(inner.as_posix() if inner.parts else top.name, []).append(file)
    twice = [name for name, files in dampers.items() if each == "file" and len(files) > 1]
    if twice:
        must = "hold files with different names, where each is a damper"
        _checks.refuse("paths", must, ", ".join(map(str, dampers[twice[0]])), "Rename one of them.")
    ordered = sorted(dampers, key=natural_key)
    return {name: sorted(dampers[name], key=lambda file: natural_key(file.name)) for name in ordered}


def _of_table(file: Path) -> dict[str, list[Path]]:
    """The files of each damper by its name, in the order of a table."""
    if file.suffix.lower() == ".parquet":
        rows = library("pyarrow.parquet", file).read_table(file).to_pylist()
    else:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            rows = list(csv.DictReader(stream))
    dampers: dict[str, list[Path]] = {}
    for number, row in enumerate(rows, 1):
        missing = [name for name in COLUMNS if not row.get(name)]
        if missing:
            columns = ", ".join(map(repr, row))
            words = f"{file}, row {number}: no {missing[0]!r}; its columns are {columns}."
            raise ValueError(f"{words} Name them 'damper' and 'file', with commas between them.")
        dampers.setdefault(str(row["damper"]), []).append(file.parent / str(row["file"]))
    return dampers


def _manifest(folder: Path, common: Path) -> Path | None:
    """How the records of a damper are read: as the manifest in their folder says, or the one at the top."""
    return next((file for file in (folder / NAME, common) if file.is_file()), None)


def _said(options: Mapping[str, object]) -> str:
    """Keywords in words that are the same in every process and in any order; empty if there are none."""
    return re.sub(r" at 0x\w+", "", str(dict(sorted(options.items())))) if options else ""


def _stamp(files: Iterable[Path]) -> str:
    """A text that changes with the name, the size or the time of change of a file."""
    digest = hashlib.sha256()
    for file in files:
        about = file.stat() if file.is_file() else None  # what is missing is said when the damper is read
        digest.update(f"{file.name} {about and (about.st_size, about.st_mtime_ns)}\n".encode())
    return digest.hexdigest()[:16]
