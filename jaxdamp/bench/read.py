"""Files in, records in SI and one sign convention out: of a bench, or of a vehicle on a road or a rig."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import TypeVar, Unpack

from jaxdamp import _checks
from jaxdamp._checks import Setting
from jaxdamp._files import FOLDER_SUFFIXES, find_files
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Contents
from jaxdamp.bench import sign as signs
from jaxdamp.bench.bench_tables import Interpretation, bench_runs
from jaxdamp.bench.clock import FEWEST
from jaxdamp.bench.columns import Choice, is_record, lacking
from jaxdamp.bench.manifest import BENCH_KEYS, RIDE_KEYS, Paths, with_manifest
from jaxdamp.bench.raw import Problems, RawTable
from jaxdamp.bench.readers import BENCH_FILES, FILES, BenchFiles, Files, read_tables, with_own
from jaxdamp.bench.record_tables import main_tables, on_one_clock, one_record, tests_apart
from jaxdamp.bench.ride_record import RideInterpretation, RideRecord, ride_record
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.sets import BenchSet
from jaxdamp.bench.settings import Settings, settings_by_name, settings_in_names


Command = float | int | str | Mapping[str, float | int]  # one number, one for each record, or a setting
_Record = TypeVar("_Record")


@with_defaults(BENCH_FILES)
def read(
    paths: Paths,
    *,
    sign: str | None = None,
    force_sign: str | None = None,
    command: Command | None = None,
    settings: str | Mapping[str, Settings] | None = None,
    manifest: str | os.PathLike[str] | bool = True,
    skip_bad: bool = False,
    drop_bad_rows: bool = False,
    **files: Unpack[BenchFiles],
) -> BenchSet:
    r"""Read bench records from text files, workbooks, MATLAB, TDMS, MDF4 and Parquet files.

    Columns are found by their headers ("t_s,x_mm,F_N", "time [s]; stroke (mm); force [N]", "Displacement, in", a row
    of units under the header), lines above the header are skipped, and delimiter and decimal comma are found out.
    Nothing is guessed that the file does not show: a missing unit is an error, and what was decided stands in each
    record's notes. docs/reading.md says more.

    Arguments:
        paths: a file, several, a pattern such as "runs/*.csv", or a folder.
        sign: "rebound-positive" or "compression-positive", the direction in which the files count positive. Without
            it the header of stroke or velocity says it ("compression travel"), or positive is taken as rebound; the
            record says so.
        force_sign: "same" if the files' force is positive when it resists motion in the positive direction,
            "opposite" if it is negative then. Without it: the same if `sign` is given, otherwise what makes the work
            per cycle positive, because a damper takes in energy.
        command: what was set on the damper and held, such as a coil current: one number for all files, a number for
            each record by name or pattern, such as `{"*_0.5A": 0.5, "*_1.0A": 1.0}`, or the name of a setting.
            Without it, a column of a coil current or voltage is the command; `BenchRun.command_channel` if it varies.
        settings: what else is known of the records: pattern to settings, `{"hot_*": {"temperature": "80 degC"}}`, or a
            pattern with names in braces, `"*_{current}A"`, that takes the settings from the names of the records.
        manifest: a TOML file with these arguments; True takes `jaxdamp.toml` of the folder that is read, and a note
            says so; False takes none. What is given in the call wins.
        skip_bad: leave out files, and records of a file with several, that cannot be read, instead of reading none;
            `BenchSet.left_out` says which and why.
        drop_bad_rows: leave out rows with a missing value or text, at most ten one after the other and 5 % of all;
            straight lines stand in their place, and a note counts them.
        files: keywords on what is in the files, all optional: `columns`, `gains`, `sampling_rate` and
            `stroke_from_velocity` (see `BenchFiles`), `units`, `delimiter` and `readers` (see `Files`).

    Returns:
        The records, named after their files, in the order of the paths, folders and patterns in natural order. A
        record inside a file of several has its name behind that of the file.

    Raises:
        FileNotFoundError: no such file, or a pattern or folder without files.
        ValueError: naming file, line or column, the value and the remedy; all problems of all files at once.
        ImportError: a format needs a library of the extra `io`.

    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> folder = Path(tempfile.mkdtemp())
    >>> t = np.arange(400) / 200
    >>> rows = [f"{a},{20 * np.sin(9 * a)},{.5 * np.cos(9 * a)}" for a in t]
    >>> _ = (folder / "slow.csv").write_text("\n".join(["t_s,x_mm,F_kN", *rows]))
    >>> run = read(folder)["slow"]
    >>> print(f"{run.amplitude:.3f} m, {run.force.max():.0f} N, {run.work_per_cycle:.2f} J")
    0.020 m, 500 N, 31.42 J
    >>> print(run.notes[1])
    force and stroke of the file agree in sign (work per cycle +31.41 J)
    """
    given: Contents = {"sign": sign, "force_sign": force_sign, "command": command, "settings": settings, **files}
    asked, given, note = with_manifest(paths, manifest, given, BENCH_KEYS)
    signs.check_words(given["sign"], given["force_sign"])
    tables = (given[name] or {} for name in ("columns", "units", "gains"))
    choice = Choice(*tables, stroke_from_velocity=bool(given["stroke_from_velocity"]))
    how = Interpretation(choice, given["sign"], given["force_sign"], given["sampling_rate"], drop_bad_rows)
    runs, wrong, file_names = _read_files(asked, given, partial(_bench_runs, how=how))
    if not (skip_bad and runs):
        ways, names = Setting("skip_bad", True), {base for base, _ in runs}
        what = "file" if names <= {*file_names} else "record"
        others = f"The other {what}" if len(names) == 1 else f"The other {len(names)} {what}s"
        wrong.raise_any(f"{others} can be read: {ways} leaves out what cannot." if runs else "", ways)
    runs = [(base, replace(run, notes=(*run.notes, *note))) for base, run in runs]
    return BenchSet(_commanded(_with_settings(runs, given["settings"]), given["command"]), map(str, wrong.errors))


@with_defaults(FILES)
def read_rides(
    paths: Paths,
    *,
    columns: Mapping[str, str | int] | None = None,
    road: Sequence[str | int] | str | int | None = None,
    reversed_channels: Sequence[str] | None = None,
    sampling_rate: float | int | None = None,
    manifest: str | os.PathLike[str] | bool = True,
    **files: Unpack[Files],
) -> tuple[RideRecord, ...]:
    r"""Read records of a vehicle on a road or a rig, from text files and all formats of `read`.

    Each column needs a unit, in its header (`body acc [g]`), in a row under it, or in `units`. Nothing is guessed.

    Arguments:
        paths: a file, several, a pattern, or a folder.
        columns: name of the channel of the vehicle to header or number (from 0) of its column, such as
            `{"sprung_acceleration": "acc body", "stroke": "LVDT FL"}`. Left out, every column is a channel of the name
            in its header.
        road: headers or numbers of the columns with the height under each wheel, or the force on it, in the order of
            `vehicle.wheel_names`; left out, the column "road", or "road 1", "road 2" and so on.
        reversed_channels: channels (or "road") that the file counts positive downwards or in compression.
        sampling_rate: samples per second [Hz], for files without a column of the time, which is found as by `read`.
        manifest: a TOML file with these arguments, as in `read`: True takes `jaxdamp.toml` of the folder that is read.
        files: `units`, `delimiter` and `readers`, all optional (see `Files`).

    Returns:
        The records, named after their files.

    Raises:
        FileNotFoundError: no such file.
        ValueError: naming file, column and remedy; all problems of all files at once.

    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> file = Path(tempfile.mkdtemp()) / "sweep.csv"
    >>> rows = [f"{i / 100},{5 * np.sin(0.3 * i)},{0.1 * np.cos(0.3 * i)}" for i in range(100)]
    >>> _ = file.write_text("\n".join(["time [s],road [mm],sprung_acceleration [g]", *rows]))
    >>> record = read_rides(file)[0]
    >>> record.units["sprung_acceleration"], round(float(record["sprung_acceleration"][0]), 6)
    ('m/s^2', 0.980665)
    """
    given: Contents = {"columns": columns, "road": road, "reversed_channels": reversed_channels, **files}
    asked, given, note = with_manifest(paths, manifest, given | {"sampling_rate": sampling_rate}, RIDE_KEYS)
    if note:
        given |= {table: given[table] or None for table in ("columns", "units")}
    how = RideInterpretation(**{field.name: given[field.name] for field in fields(RideInterpretation)})
    records, wrong, _ = _read_files(asked, given, partial(_rides, how=how))
    wrong.raise_any()
    return tuple(replace(record, notes=(*record.notes, *note)) for record in records)


def _read_files(
    asked: Paths, given: Contents, records: Callable[[Sequence[RawTable], str, Problems], list[_Record]]
) -> tuple[list[_Record], Problems, list[str]]:
    """The records that can be read, of all files, what was wrong with the others, and the names of the files."""
    readers = with_own(given["readers"])
    if given["sampling_rate"] is not None:
        _checks.positive("sampling_rate", given["sampling_rate"])
    files = find_files(asked, {*FOLDER_SUFFIXES, *(given["readers"] or {})})
    good: list[_Record] = []
    all_wrong, names = Problems(), _names(files)
    for file, name in zip(files, names, strict=True):
        wrong = Problems()
        with wrong.collected(str(file)):
            try:
                good += records(read_tables(file, readers, given["delimiter"]), name, wrong)
            except ArithmeticError as error:
                said = f"its numbers cannot be computed with ({type(error).__name__}: {error})"
                raise ValueError(f"{file}: {said}. Export it again.") from error
        for error in wrong.errors:
            unnamed = type(error) is ValueError and str(file) not in str(error)
            all_wrong.errors.append(ValueError(f"{file}: {error}") if unnamed else error)
    return good, all_wrong, names


def _names(files: Sequence[Path]) -> list[str]:
    """The name of each file without its suffix, with its folder or suffix only where others have the same name."""
    names = [file.stem for file in files]
    folders = {name: {f.parent for f in files if f.stem == name} for name in names}
    names = ["/".join((*_apart(f.parent, folders[f.stem]), f.stem)) for f in files]
    return [f"{n} ({f.suffix[1:]})" if names.count(n) > 1 else n for f, n in zip(files, names, strict=True)]


def _apart(folder: Path, folders: set[Path]) -> tuple[str, ...]:
    """As many of the last parts of a folder as tell it from the others."""
    parts, others = folder.parts[::-1], [other.parts[::-1] for other in folders - {folder}]
    count = next(k for k in range(len(parts) + 1) if all(other[:k] != parts[:k] for other in others))
    return parts[:count][::-1]


def _named(tables: Sequence[RawTable], name: str) -> list[tuple[RawTable, str]]:
    """Each table with the name of its record: that of the file, and its own where the file holds several."""
    return [(table, f"{name}/{table.record}" if len(tables) > 1 else name) for table in tables]


def _bench_runs(
    tables: Sequence[RawTable], name: str, wrong: Problems, how: Interpretation
) -> list[tuple[str, BenchRun]]:
    """The records of a file, each with its name before it was cut at gaps; the errors of the others are collected.

    Tables without stroke and force, or too short, are left out of a file that has records, with a note.
    """
    whole, runs = on_one_clock(_tests(tables, how.choice, wrong), how.choice), []
    short = {table: _why_no_record(table, how.choice) for table in whole}
    good = [table for table, why in short.items() if not why]
    good = good or [table for table in whole if is_record(table, how.choice)] or whole
    left_out = [f"{t.record!r} of the file left out: {why}" for t, why in short.items() if t not in good]
    for table, base in _named(good, name):
        with wrong.collected():
            runs += [(base, replace(run, notes=(*run.notes, *left_out))) for run in bench_runs(table, base, how)]
    return runs


def _tests(tables: Sequence[RawTable], choice: Choice, wrong: Problems) -> list[RawTable]:
    """The tests of the tables, those of one name as one; the errors of those that do not fit together are collected."""
    parts: dict[str, list[RawTable]] = {}
    for part in (part for table in tables for part in tests_apart(table, choice)):
        parts.setdefault(part.record, []).append(part)
    whole = []
    for together in parts.values():
        with wrong.collected():
            whole += one_record(together, choice)
    return whole


def _why_no_record(table: RawTable, choice: Choice) -> str:
    """Why a table is none of the records of a file, by what it has not; empty if it may be one."""
    without = lacking(table, choice)
    if without:
        return "neither stroke nor force" if len(without) > 1 else f"no {without[0]}"
    return "" if len(table) >= FEWEST else f"{len(table)} samples, and a record needs {FEWEST}"


def _rides(tables: Sequence[RawTable], name: str, wrong: Problems, how: RideInterpretation) -> list[RideRecord]:
    """The records of a file with a vehicle; the errors of those that cannot be read are collected."""
    records = []
    for table, base in _named(main_tables(tables), name):
        with wrong.collected():
            records.append(ride_record(table, base, how))
    return records


def _with_settings(
    runs: list[tuple[str, BenchRun]], settings: str | Mapping[str, Settings] | None
) -> list[tuple[str, BenchRun]]:
    names = [base for base, _ in runs]
    table, notes = (settings_by_name(names, settings), {}) if settings is not None else settings_in_names(names)
    completed = []
    for base, run in runs:
        stated = {**table[base], **run.settings, **({} if settings is None else table[base])}
        said = (*run.notes[:-1], *notes.get(base, ()), *run.notes[-1:])
        completed.append((base, replace(run, settings=stated, notes=said)))
    return completed


def _commanded(runs: list[tuple[str, BenchRun]], command: Command | None) -> list[BenchRun]:
    if command is None:
        return [run for _, run in runs]
    if isinstance(command, str):
        return [_held(run, _setting(run, command)) for _, run in runs]
    if not isinstance(command, Mapping):
        return [_held(run, command) for _, run in runs]
    patterns = {base: [key for key in command if fnmatchcase(base, key)] for base, _ in runs}
    _check_patterns(command, patterns)
    return [_held(run, command[patterns[base][0]]) for base, run in runs]


def _held(run: BenchRun, command: float | int) -> BenchRun:
    """The record with a command that is held, whatever its column shows."""
    note = (f"column of the command left out, since it is stated as {command:g}",) * (run.command_channel is not None)
    return replace(run.held_at(command), notes=(*run.notes, *note))


def _check_patterns(command: Mapping[str, float | int], patterns: Mapping[str, Sequence[str]]) -> None:
    fitting = {key for keys in patterns.values() for key in keys}
    unused = ", ".join(repr(key) for key in command if key not in fitting)
    if unused:
        _checks.refuse("command", "name records that are read", unused, f"There are {', '.join(patterns)}.")
    doubtful = [f"{name} ({len(keys)})" for name, keys in patterns.items() if len(keys) != 1]
    if doubtful:
        must = "fit each record with exactly one pattern"
        _checks.refuse("command", must, f"fitting otherwise for {', '.join(doubtful)}")


def _setting(run: BenchRun, name: str) -> float:
    value = run.settings.get(name)
    if not isinstance(value, int | float):
        settings = ", ".join(f"{key}={value!r}" for key, value in run.settings.items()) or "none"
        must = f"name a setting that is a number, also of {run.name!r}"
        _checks.refuse("command", must, repr(name), f"Its settings: {settings}.")
    return float(value)
