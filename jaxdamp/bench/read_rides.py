"""Files of a vehicle on a road or a rig in, records in SI out."""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxdamp import _checks
from jaxdamp._documents import read_toml
from jaxdamp._files import find_files
from jaxdamp.bench import sampling, stamps
from jaxdamp.bench.columns import split_header
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.problems import Problems
from jaxdamp.bench.raw import RawTable
from jaxdamp.bench.readers import Reader, folder_suffixes, read_tables, with_own
from jaxdamp.bench.ride_record import RIDE_MARK, RIDE_SETTINGS_MARK, ROAD, ROAD_UNITS, RideRecord
from jaxdamp.bench.units import ratio


SI_UNITS = ("m/s^2", "m", "m/s", "N", "rad", "rad/s", "rad/s^2")
STANDARD_GRAVITY = 9.80665  # m/s², of an acceleration in g


def read_rides(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    columns: Mapping[str, str | int] | None = None,
    road: Sequence[str | int] | str | int | None = None,
    units: Mapping[str, str] | None = None,
    reversed_channels: Sequence[str] | None = None,
    sampling_rate: float | int | None = None,
    delimiter: str | None = None,
    manifest: str | os.PathLike[str] | None = None,
    readers: Mapping[str, Reader] | None = None,
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
        units: channel, "time" or "road" to its unit, where the header has none or a wrong one.
        reversed_channels: channels (or "road") that the file counts positive downwards or in compression.
        sampling_rate: samples per second [Hz], for files without the column "time".
        delimiter: the character between columns of text files, if the search fails.
        manifest: TOML file with these arguments; those of the call take precedence.
        readers: suffix to function that reads such files, as in `read`.

    Returns:
        The records, named after their files.

    Raises:
        FileNotFoundError: no such file.
        ValueError: naming file, column and remedy; all problems of all files at once.

    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "sweep.csv"
    >>> rows = [f"{i / 100},{5 * np.sin(0.3 * i)},{0.1 * np.cos(0.3 * i)}" for i in range(100)]
    >>> _ = file.write_text("\n".join(["time [s],road [mm],sprung_acceleration [g]", *rows]))
    >>> record = read_rides(file)[0]
    >>> record.units["sprung_acceleration"], round(float(record["sprung_acceleration"][0]), 6)
    ('m/s^2', 0.980665)
    """
    given: dict[str, Any] = {
        "columns": columns,
        "road": road,
        "units": units,
        "reversed_channels": reversed_channels,
        "sampling_rate": sampling_rate,
        "delimiter": delimiter,
    }
    stated = {} if manifest is None else _manifest(Path(manifest).expanduser(), given)
    how = {key: stated.get(key) if value is None else value for key, value in given.items()}
    if how["sampling_rate"] is not None:
        _checks.positive("sampling_rate", how["sampling_rate"])
    found, own, problems = [], with_own(readers), Problems()
    for file in find_files(paths, folder_suffixes(readers)):
        with problems.collected():
            tables = read_tables(file, own, how["delimiter"])
            names = [f"{file.stem}/{table.record}" if len(tables) > 1 else file.stem for table in tables]
            found += [_record(table, name, how) for table, name in zip(tables, names, strict=True)]
    problems.raise_any()
    return tuple(found)


def _manifest(file: Path, known: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments that a manifest states."""
    stated = read_toml(file)
    for key in stated:
        _checks.one_of(f"manifest {file}", key, known)
    return stated


def _record(table: RawTable, name: str, how: Mapping[str, Any]) -> RideRecord:
    """The record of a table."""
    headers = [split_header(column.name)[0] for column in table.columns]
    chosen: dict[str, int] = {}
    roads = [_index(table, headers, ROAD, which) for which in _road_columns(table, headers, how["road"])]
    timed = "time" if "time" in headers else None
    clock = (how["columns"] or {}).get("time", timed)
    if how["columns"] is None:
        chosen = {h: i for i, h in enumerate(headers) if h and i not in roads and h != clock}
    else:
        items = how["columns"].items()
        chosen = {channel: _index(table, headers, channel, which) for channel, which in items if channel != "time"}
    for channel in (how["reversed_channels"] or (), how["units"] or ()):
        for one in channel:
            _checks.one_of("channel", one, [*chosen, ROAD, "time"])
    time = _time(table, headers, clock, how)
    pairs = {channel: _values(table, i, channel, how) for channel, i in chosen.items()}
    wheels = [_values(table, i, ROAD, how) for i in roads]
    kinds = {unit for _, unit in wheels}
    if len(kinds) > 1:
        raise ValueError(f"{table.where}: the columns of the road must all be heights, or all forces on the wheels.")
    road, driven_by = np.stack([values for values, _ in wheels], axis=1), "forces" if kinds == {"N"} else "heights"
    units = {channel: unit for channel, (_, unit) in pairs.items()}
    marks = [line.removeprefix(RIDE_SETTINGS_MARK) for line in table.preamble if line.startswith(RIDE_SETTINGS_MARK)]
    own = bool(table.preamble) and table.preamble[0].strip() == RIDE_MARK
    settings = json.loads(marks[0]) if own and marks else {}
    channels = {channel: values for channel, (values, _) in pairs.items()}
    return RideRecord(name, time, road, channels, units, driven_by, settings, str(table.file), table.notes)


def _road_columns(table: RawTable, headers: Sequence[str], road: Any) -> list[str | int]:
    """Headers or numbers of the columns of the road."""
    if road is not None:
        return [road] if isinstance(road, str | int) else list(road)
    found = [h for h in headers if h == ROAD or (h.startswith(f"{ROAD} ") and h.removeprefix(f"{ROAD} ").isdigit())]
    if not found:
        remedy = 'Name the columns of the heights under the wheels: `road=["platform"]`.'
        raise ValueError(f"{table.where} has no column `road`; there are {', '.join(table.names)}. {remedy}")
    return list(found)


def _index(table: RawTable, headers: Sequence[str], channel: str, which: str | int) -> int:
    """Number of a column."""
    if isinstance(which, int):
        if not 0 <= which < len(headers):
            raise ValueError(f"{table.where} has {len(headers)} columns, none of number {which} for {channel!r}.")
        return which
    fitting = [i for i, (h, whole) in enumerate(zip(headers, table.names, strict=True)) if which in (h, whole)]
    if len(fitting) != 1:
        near = _checks.nearest(which, [*headers])
        hint = f" Did you mean {near!r}?" if near and not fitting else ""
        count = f"{len(fitting)} columns" if fitting else "no column"
        raise ValueError(f"{table.where} has {count} {which!r} for {channel!r}; it has {', '.join(table.names)}.{hint}")
    return fitting[0]


def _values(table: RawTable, index: int, channel: str, how: Mapping[str, Any]) -> tuple[Samples, str]:
    """A column in SI with the library's sign, and its SI unit."""
    raw = table.columns[index]
    where = f"{table.where}, column {table.names[index]!r}"
    if raw.faults or raw.is_text:
        row, text = min(raw.faults.items()) if raw.faults else (0, str(raw.values[0]))
        raise ValueError(f"{where}, {table.place(row)}: {text!r} is not a number. Mend or remove the line.")
    written = (how["units"] or {}).get(channel) or raw.unit or split_header(raw.name)[1]
    if not written:
        raise ValueError(f"{where}: no unit. Write it into the header, or pass `units={{{channel!r}: 'm/s^2'}}`.")
    wanted = tuple(ROAD_UNITS.values()) if channel == ROAD else SI_UNITS
    factor, unit = _to_si(written, wanted)
    if factor is None:
        raise ValueError(f"{where}: {written!r} is no unit of {channel!r}; it must be one of {', '.join(wanted)}.")
    sign = -1.0 if channel in (how["reversed_channels"] or ()) else 1.0
    return sign * factor * np.asarray(raw.values, np.float64), unit


def _to_si(written: str, wanted: Sequence[str]) -> tuple[float | None, str]:
    """Factor to SI, and the SI unit; None for a unit of something else."""
    if written.strip() in ("g", "g0", "g_n") and "m/s^2" in wanted:
        return STANDARD_GRAVITY, "m/s^2"
    plain = written.strip().replace("²", "^2").replace("m/s2", "m/s^2").replace("rad/s2", "rad/s^2")
    return next(((factor, unit) for unit in wanted if (factor := ratio(plain, unit)) is not None), (None, ""))


def _time(table: RawTable, headers: Sequence[str], clock: str | int | None, how: Mapping[str, Any]) -> Samples:
    """The instants [s]."""
    rate = how["sampling_rate"]
    if clock is None:
        if rate is None:
            raise ValueError(f"{table.where} has no column `time`: pass `sampling_rate` [Hz], or name it in `columns`.")
        return sampling.uniform_time(rate, len(table))
    if rate is not None:
        raise ValueError(f"{table.where} has a column of time: leave `sampling_rate` out.")
    index = _index(table, headers, "time", clock)
    raw = table.columns[index]
    where = f"{table.where}, column {table.names[index]!r}"
    if raw.is_text:
        return stamps.seconds(np.asarray(raw.values), where, table.place)[0]
    written = (how["units"] or {}).get("time") or raw.unit or split_header(raw.name)[1]
    factor = ratio(written, "s") if written else None
    if factor is None:
        raise ValueError(f"{where}: {written or 'no unit'} instead of a unit of time; pass `units={{'time': 's'}}`.")
    return factor * np.asarray(raw.values, np.float64)
