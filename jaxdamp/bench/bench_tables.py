"""From the raw table of a file to a bench record in SI and the library's sign."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting
from jaxdamp.bench import clock, sign as signs
from jaxdamp.bench.clock import Part, regular_parts
from jaxdamp.bench.columns import REQUIRED, Choice, Column, find_columns
from jaxdamp.bench.motion import Samples, cycle_instants
from jaxdamp.bench.raw import Problems, RawColumn, RawTable
from jaxdamp.bench.runs import COMMAND_MARK, FILE_MARK, INTEGRATED_MARK, NOTE_MARK, SETTINGS_MARK, BenchRun
from jaxdamp.bench.velocity import estimate_velocity, integrate_velocity


@dataclass(frozen=True)
class Interpretation:
    """What the caller says about the numbers of the files, as `bench.read` describes it."""

    choice: Choice = field(default_factory=Choice)
    sign: str | None = None
    force_sign: str | None = None
    sampling_rate: float | int | None = None
    drop_bad_rows: bool = False


_LONGEST_BRIDGE = 10  # bad rows one after the other that are bridged
_MOST_BAD = 0.05  # share of the rows of a record that may be left out


def bench_runs(table: RawTable, name: str, how: Interpretation) -> list[BenchRun]:
    """The record of a table; several if it has gaps in time."""
    columns, doubts = find_columns(table, how.choice)
    table = without_bad_rows(table, columns) if how.drop_bad_rows else table
    clock.check_count(len(table), table.where)
    channels, notes = _channels(table, columns, how.choice)
    notes = [_columns_note(table, columns), *table.notes, *doubts, *notes]
    motion = channels["stroke" if "stroke" in channels else "velocity"]
    parts = _parts(table, channels.pop("time", None), motion, how.sampling_rate)
    names = [f"{name}_part{number}" for number in range(1, len(parts) + 1)] if len(parts) > 1 else [name]
    return [_record(table, columns, channels, part, n, how, notes) for part, n in zip(parts, names, strict=True)]


def without_bad_rows(table: RawTable, columns: Mapping[str, Column]) -> RawTable:
    """A table without rows in which a quantity is missing or no number; a note counts them.

    Their places, of ten rows one after the other at most, are bridged by straight lines between the rows around them,
    so that the time goes on; before the first good row and after the last one, as in a footer, they are cut off.
    """
    used = [column.index for column in columns.values() if column.conversion is not None]
    bad = np.zeros(len(table), dtype=bool)
    for index in used:
        bad |= ~np.isfinite(np.asarray(table.columns[index].values, np.float64))
    if not bad.any():
        return table
    rows, place = np.arange(len(table)), table.place(int(np.argmax(bad)))
    good = rows[~bad]
    longest, count = int(np.diff(good, prepend=-1, append=len(table)).max()) - 1, int(bad.sum())
    if longest > _LONGEST_BRIDGE or bad.mean() > _MOST_BAD:
        limits = f"at most {_LONGEST_BRIDGE} in a row, and {100 * _MOST_BAD:g} % of all"
        raise ValueError(
            f"{table.where}: {count} of {len(table)} rows are bad, up to {longest} one after the other, the first is "
            f"{place}; {limits}, can be left out. Cut the record there."
        )
    inside = slice(good[0], good[-1] + 1)
    channels = [replace(column, values=column.values[inside]) for column in table.columns]
    for index in used:
        values = np.interp(rows[inside], good, np.asarray(table.columns[index].values, np.float64)[~bad])
        channels[index] = replace(channels[index], values=values, faults={})
    bridged = ", straight lines instead" * bool(bad[inside].any())
    note = f"{count} bad row{'s' * (count > 1)} left out{bridged}; the first is {place}"
    lines = table.lines[inside] if len(table.lines) else table.lines
    return replace(table, columns=tuple(channels), lines=lines, notes=(*table.notes, note))


def _channels(table: RawTable, columns: Mapping[str, Column], choice: Choice) -> tuple[dict[str, Samples], list[str]]:
    """The numbers of every quantity in SI, and notes on those that were left out."""
    channels, notes, problems = {}, [], Problems()
    for role, column in columns.items():
        with problems.collected():
            try:
                channels[role], note = _values(table, table.columns[column.index], column)
            except ValueError as error:
                if role in REQUIRED or role == "time" or choice.asks_for(role):
                    raise
                note = f"{role} left out: {error}"
            notes += [note] if note else []
    problems.raise_any()
    return channels, notes


def _values(table: RawTable, raw: RawColumn, column: Column) -> tuple[Samples, str]:
    """One channel in SI, and a note on time stamps."""
    where = f"{table.where}, column {column.header!r}"
    values = np.asarray(raw.values)
    drop = Setting("drop_bad_rows", True)
    if raw.faults:
        row, text = min(raw.faults.items())
        what = f"{text!r} is not a number" if text else "the value is missing"
        more = f" ({len(raw.faults)} such values in all)" if len(raw.faults) > 1 else ""
        place = f"{table.where}, {table.place(row)}, column {column.header!r}"
        raise ArgumentError(f"{place}: {what}{more}. Mend or remove the line, or pass {drop}.", drop)
    if column.conversion is None:
        return clock.seconds(values, where, table.place)
    values = column.conversion(np.ascontiguousarray(values))
    try:
        clock.check_numbers(values, f"{column.role} (column {column.header!r})", table.where, table.place)
    except ValueError as error:
        raise ArgumentError(f"{error} Or pass {drop}.", drop) from error
    if column.role == "temperature":
        _check_temperature(values, where)
    return values, ""


def _check_temperature(temperature: Samples, where: str) -> None:
    """Refuse temperatures that no damper has: of a sensor that failed, or in another unit."""
    cold = temperature[temperature <= _checks.COLDEST]
    if cold.size:
        unit = Setting("units", {"temperature": "degC"})
        raise ArgumentError(
            f"{where}: the temperature is {cold[0]:.6g} K, {cold[0] - 273.15:.6g} °C ({cold.size} values below "
            f"{_checks.COLDEST:g} K in all). Did the sensor fail? Is its unit another one? Name it with {unit}.",
            unit,
        )


def _columns_note(table: RawTable, columns: Mapping[str, Column]) -> str:
    used = ", ".join(f"{c.role} from {c.header!r} in {c.unit}" for c in columns.values())
    taken = {column.index for column in columns.values()}
    unused = [name for i, name in enumerate(table.names) if i not in taken] if table.is_named else []
    return f"{used}; brought to SI" + (f"; not used: {', '.join(unused)}" if unused else "")


def _parts(table: RawTable, time: Samples | None, motion: Samples, rate: float | int | None) -> list[Part]:
    """The stretches without gap that hold a full cycle; all of a record that has no gap."""
    where = table.where
    if time is None:
        return [_from_rate(len(table), rate, where)]
    parts = regular_parts(time, where, table.place)
    _check_rate(parts, rate, where)
    if len(parts) == 1:
        return parts
    good = [part for part in parts if _has_cycle(part, motion)]
    if not good:
        clock.refuse_cuts(time, where, table.place)
    left_out = [part for part in parts if part not in good]
    samples = sum(len(part.time) for part in left_out)
    plural = "s" if len(left_out) > 1 else ""
    note = (f"{len(left_out)} part{plural} without a full cycle left out, {samples} samples",) if left_out else ()
    return [replace(part, notes=(*part.notes, *note)) for part in good]


def _has_cycle(part: Part, motion: Float[np.ndarray, " file_time"]) -> bool:
    moved = part.of(motion)
    return len(part.time) >= clock.FEWEST and np.ptp(moved) > 0 and len(cycle_instants(part.time, moved)) > 1


def _from_rate(count: int, rate: float | int | None, where: str) -> Part:
    if rate is None:
        example, name = Setting("sampling_rate", 1000), Setting("columns", {"time": ...})
        raise ArgumentError(
            f"{where} has no time column: pass the rate at which it was sampled, for example {example} "
            f"[Hz], or name the column with {name}.",
            example,
            name,
        )
    time = clock.uniform_time(rate, count)
    return Part(slice(None), time, time, False, (f"time from the sampling rate given, {rate:g} Hz",))


def _check_rate(parts: list[Part], rate: float | int | None, where: str) -> None:
    time = max(parts, key=lambda part: len(part.time)).time
    measured = (len(time) - 1) / (time[-1] - time[0]) if len(time) > 1 else 0.0
    if rate is not None and abs(rate - measured) > 0.01 * rate:
        given, without = Setting("sampling_rate", rate), Setting("columns", {"time": None})
        raise ArgumentError(
            f"{where}: {given} contradicts the time column, which has {measured:.6g} Hz. Leave one of "
            f"them out: {without} leaves out the column.",
            given,
            without,
        )


def _record(
    table: RawTable,
    columns: Mapping[str, Column],
    channels: Mapping[str, Samples],
    part: Part,
    name: str,
    how: Interpretation,
    notes: list[str],
) -> BenchRun:
    where, time = table.where, part.time
    moved = {role: part.of(values) for role, values in channels.items()}
    force, velocity, source = moved["force"], moved.get("velocity"), ""
    integrated = "stroke" not in moved
    if velocity is not None and integrated:
        stroke, velocity, source = integrate_velocity(time, velocity, where)
    else:
        stroke = moved["stroke"]
        clock.check_stroke(stroke, f"{where}, column {columns['stroke'].header!r}")
    states_all = bool(table.preamble) and table.preamble[0].strip() == FILE_MARK
    if states_all:
        _refuse_signs(how, where)
        decision = signs.Decision(1.0, 1.0, ("positive stroke is rebound, as the file states",))
    else:
        headers = [columns[role].header for role in ("stroke", "velocity") if role in moved]
        decision = signs.decide(time, stroke, force, how.sign, how.force_sign, where, headers)
    if velocity is None or not (states_all or integrated):
        velocity, source = _velocity(time, stroke, velocity, where)
    stated = _stated(table) if states_all else {}
    held, varying, unit, said = _commanded(columns, moved, stated.get("command"))
    return BenchRun(
        name,
        time,
        decision.motion * stroke,
        decision.motion * velocity,
        decision.force * force,
        temperature=moved.get("temperature"),
        command=held,
        command_channel=varying,
        command_unit=unit,
        settings=stated.get("settings", {}),
        source=str(table.file),
        notes=(
            *stated.get("notes", ()),
            *notes,
            *part.notes,
            *said,
            *decision.notes,
            source or "velocity as the file states",
        ),
        stroke_is_integrated=integrated or stated.get("stroke_is_integrated", False),
        units={role: column.unit for role, column in columns.items()},
    )


def _commanded(
    columns: Mapping[str, Column], channels: Mapping[str, Samples], stated: float | None
) -> tuple[float | None, Samples | None, str, list[str]]:
    """The command that is held, or else its channel and unit; and a note where a column shows that it is held."""
    conversion = columns["command"].conversion if "command" in channels else None
    if conversion is None:
        return stated, None, "", []
    values = channels["command"]
    if np.ptp(values) > 0.0:
        return None, values, conversion.si, []
    return float(values[0]), None, "", [f"command held at {values[0]:g} {conversion.si}, by its column"]


def _refuse_signs(how: Interpretation, where: str) -> None:
    if how.sign == "compression-positive" or how.force_sign == "opposite":
        words = (("sign", how.sign), ("force_sign", how.force_sign))
        given = [Setting(name, word) for name, word in words if word]
        listed = " and ".join(map(str, given))
        raise ArgumentError(f"{where} states that it is rebound-positive: read it without {listed}.", *given)


def _stated(table: RawTable) -> dict:
    """Command, settings and notes in a file that the library wrote."""
    after = {
        mark: [line.strip().removeprefix(mark) for line in table.preamble if line.startswith(mark)]
        for mark in (COMMAND_MARK, SETTINGS_MARK, NOTE_MARK)
    }
    command, settings = after[COMMAND_MARK], after[SETTINGS_MARK]
    return {
        "command": float(command[0]) if command else None,
        "settings": json.loads(settings[0]) if settings else {},
        "notes": after[NOTE_MARK],
        "stroke_is_integrated": any(line.strip() == INTEGRATED_MARK for line in table.preamble),
    }


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
