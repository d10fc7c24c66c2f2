"""Bench files in, records in SI and one sign convention out."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting
from jaxdamp.bench import sampling
from jaxdamp.bench import sign as signs
from jaxdamp.bench.columns import Column, find_columns
from jaxdamp.bench.files import find_files
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.runs import COMMAND_MARK, FILE_MARK, NOTE_MARK, BenchRun
from jaxdamp.bench.sets import BenchSet
from jaxdamp.bench.tables import Table, read_table
from jaxdamp.bench.units import is_unit
from jaxdamp.bench.velocity import estimate_velocity


def read(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    sign: str | None = None,
    force_sign: str | None = None,
    columns: Mapping[str, str | int | None] | None = None,
    units: Mapping[str, str] | None = None,
    sampling_rate: float | int | None = None,
    delimiter: str | None = None,
    command: float | Mapping[str, float] | None = None,
) -> BenchSet:
    r"""Read bench records from text files.

    Columns are found by their headers ("t_s,x_mm,F_N", "time [s]; stroke (mm); force [N]", "Displacement, in", a row
    of units under the header), lines above the header are skipped, and delimiter and decimal comma are found out.
    Nothing is guessed that the file does not show: a missing unit is an error, and what was decided stands in each
    record's notes.

    Arguments:
        paths: a file, several, a pattern such as "runs/*.csv", or a folder.
        sign: "rebound-positive" or "compression-positive", the direction in which the files count positive. Without
            it, positive is taken as rebound, and the record says so.
        force_sign: "same" if the files' force is positive when it resists motion in the positive direction,
            "opposite" if it is negative then. Without it: the same if `sign` is given, otherwise what makes the work
            per cycle positive, because a damper takes in energy.
        columns: quantity to header or number (from 0) of its column, for "time", "stroke", "velocity", "force" and
            "temperature"; None leaves the file's column unused.
        units: quantity to unit, where the header has none or a wrong one.
        sampling_rate: samples per second [Hz], for files without a time column.
        delimiter: the character between columns, if the search fails.
        command: what was set on the damper and held, such as a coil current: one number for all files, or a number for
            each record by name or pattern, such as `{"*_0.5A": 0.5, "*_1.0A": 1.0}`.

    Returns:
        The records, named after their files, in the order of the paths, folders and patterns in natural order.

    Raises:
        FileNotFoundError: no such file, or a pattern or folder without files.
        ValueError: naming file, line or column, the value and the remedy.

    >>> import tempfile
    >>> from pathlib import Path
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
    signs.check_words(sign, force_sign)
    if sampling_rate is not None:
        _checks.positive("sampling_rate", sampling_rate)
    files = find_files(paths)
    stems = [file.stem for file in files]
    names = [f"{f.parent.name}/{f.stem}" if stems.count(f.stem) > 1 else f.stem for f in files]
    runs = []
    for file, name in zip(files, names, strict=True):
        table = read_table(file, delimiter, is_unit)
        found = find_columns(table, columns, units)
        runs.append(_record(table, found, name, sign, force_sign, sampling_rate))
    return BenchSet(_commanded(runs, command))


def _commanded(runs: list[BenchRun], command: float | Mapping[str, float] | None) -> list[BenchRun]:
    """The records with the commands given."""
    if command is None:
        return runs
    if not isinstance(command, Mapping):
        return [replace(run, command=command) for run in runs]
    fitting = {run.name: [key for key in command if fnmatchcase(run.name, key)] for run in runs}
    unused = [key for key in command if not any(key in keys for keys in fitting.values())]
    if unused:
        names = ", ".join(fitting)
        _checks.refuse("command", "name records that are read", ", ".join(map(repr, unused)), f"There are {names}.")
    doubtful = [f"{name} ({len(keys)})" for name, keys in fitting.items() if len(keys) != 1]
    if doubtful:
        must = "fit each record with exactly one pattern"
        _checks.refuse("command", must, f"fitting otherwise for {', '.join(doubtful)}")
    return [replace(run, command=command[fitting[run.name][0]]) for run in runs]


def _record(
    table: Table,
    columns: dict[str, Column],
    name: str,
    sign: str | None,
    force_sign: str | None,
    sampling_rate: float | int | None,
) -> BenchRun:
    where = str(table.file)
    sampling.check_count(len(table.values), where)
    channels = {}
    for role, column in columns.items():
        values = column.conversion(np.ascontiguousarray(table.values[:, column.index]))
        sampling.check_numbers(values, f"{role} (column {column.header!r})", where, table.lines)
        channels[role] = values
    notes = [_columns_note(table, columns)]
    time, note = _time(channels.get("time"), len(table.values), sampling_rate, where, table.lines)
    notes += [note] if note else []
    stroke, force = channels["stroke"], channels["force"]
    sampling.check_stroke(stroke, f"{where}, column {columns['stroke'].header!r}")
    own = bool(table.preamble) and table.preamble[0].strip() == FILE_MARK
    if own:
        if sign == "compression-positive" or force_sign == "opposite":
            given = [Setting(name, word) for name, word in (("sign", sign), ("force_sign", force_sign)) if word]
            words = " and ".join(map(str, given))
            raise ArgumentError(f"{where} states that it is rebound-positive: read it without {words}.", *given)
        decision = signs.Decision(1.0, 1.0, ("positive stroke is rebound, as the file states",))
    else:
        decision = signs.decide(time, stroke, force, sign, force_sign, where)
    velocity, how = channels.get("velocity"), "velocity as the file states"
    if velocity is None or not own:
        velocity, how = _velocity(time, stroke, velocity, where)
    earlier = [line.strip().removeprefix(NOTE_MARK) for line in table.preamble if line.startswith(NOTE_MARK)]
    stated = [line.removeprefix(COMMAND_MARK) for line in table.preamble if own and line.startswith(COMMAND_MARK)]
    return BenchRun(
        name,
        time,
        _turned(stroke, decision.motion),
        _turned(velocity, decision.motion),
        _turned(force, decision.force),
        temperature=channels.get("temperature"),
        command=float(stated[0]) if stated else None,
        source=where,
        notes=(*earlier, *notes, *decision.notes, how),
    )


def _turned(values: Samples, factor: float) -> Samples:
    return values if factor == 1.0 else values * factor


def _columns_note(table: Table, columns: dict[str, Column]) -> str:
    used = ", ".join(f"{c.role} from {c.header!r} in {c.conversion.unit}" for c in columns.values())
    taken = {column.index for column in columns.values()}
    rest = [name for i, name in enumerate(table.names) if i not in taken]
    return f"{used}; brought to SI" + (f"; not used: {', '.join(rest)}" if rest else "")


def _time(
    time: Samples | None, count: int, rate: float | int | None, where: str, lines: tuple[int, ...]
) -> tuple[Samples, str]:
    """The instants, from the time column or the sampling rate given."""
    if time is None:
        if rate is None:
            example, name = Setting("sampling_rate", 1000), Setting("columns", {"time": ...})
            raise ArgumentError(
                f"{where} has no time column: pass the rate at which it was sampled, for example {example} "
                f"[Hz], or name the column with {name}.",
                example,
                name,
            )
        return sampling.uniform_time(rate, count), f"time from the sampling rate given, {rate:g} Hz"
    time, note = sampling.check_time(time, where, lines)
    own = (count - 1) / (time[-1] - time[0])
    if rate is not None and abs(rate / own - 1) > 0.01:
        given, without = Setting("sampling_rate", rate), Setting("columns", {"time": None})
        raise ArgumentError(
            f"{where}: {given} contradicts the time column, which has {own:.6g} Hz. Leave one of "
            f"them out: {without} leaves out the column.",
            given,
            without,
        )
    return time, note


def _velocity(time: Samples, stroke: Samples, measured: Samples | None, where: str) -> tuple[Samples, str]:
    """The velocity column if it is the derivative of the stroke, otherwise the derivative."""
    derived, how = estimate_velocity(time, stroke)
    if measured is None:
        return derived, how
    without = Setting("columns", {"velocity": None})
    remedy = f"Mend the column or its unit, or derive the velocity from the stroke: {without}."
    power = float(np.dot(measured, measured) * np.dot(derived, derived))
    likeness = float(np.dot(measured, derived)) / np.sqrt(power) if power > 0 else 0.0
    scale = float(np.dot(measured, derived) / np.dot(derived, derived))
    if likeness < -0.8:
        fault = f"has the opposite sign of the stroke's derivative (correlation {likeness:.3f})"
    elif likeness < 0.8:
        fault = f"is not the derivative of the stroke (correlation {likeness:.3f})"
    elif not 0.8 < scale < 1.25:
        fault = f"is {scale:.4g} times the stroke's derivative: one of the two has a wrong unit"
    else:
        fault = ""
    if fault:
        raise ArgumentError(f"{where}: the velocity column {fault}. {remedy}", without)
    doubt = " - they differ, look at both" if likeness < 0.99 or not 0.97 < scale < 1.03 else ""
    return measured, (
        f"velocity as measured; it is {scale:.4g} times the stroke's derivative, correlation {likeness:.4f}{doubt}"
    )
