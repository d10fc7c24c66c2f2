"""From the raw table of a file to a ride record in SI."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jaxdamp import _checks
from jaxdamp.bench import clock, stamps
from jaxdamp.bench.columns import given_column
from jaxdamp.bench.headers import split_header
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.raw import RawTable
from jaxdamp.bench.ride_record import RIDE_MARK, RIDE_SETTINGS_MARK, ROAD, ROAD_UNITS, RideRecord
from jaxdamp.bench.units import ratio


SI_UNITS = ("m/s^2", "m", "m/s", "N", "rad", "rad/s", "rad/s^2")
STANDARD_GRAVITY = 9.80665  # m/s², of an acceleration in g


@dataclass(frozen=True)
class RideInterpretation:
    """What the caller says about the columns of the files, as `bench.read_rides` describes it."""

    columns: Mapping[str, str | int] | None = None
    road: Sequence[str | int] | str | int | None = None
    units: Mapping[str, str] | None = None
    reversed_channels: Sequence[str] | None = None
    sampling_rate: float | int | None = None

    def unit(self, channel: str) -> str | None:
        """The unit that the caller gives a channel."""
        return (self.units or {}).get(channel)

    def sign(self, channel: str) -> float:
        """-1 for a channel that the file counts the other way."""
        return -1.0 if channel in (self.reversed_channels or ()) else 1.0

    def check_names(self, channels: Mapping[str, int]) -> None:
        """Refuse units and signs of channels that are not read."""
        for name in (*(self.reversed_channels or ()), *(self.units or ())):
            _checks.one_of("channel", name, [*channels, ROAD, "time"])


def ride_record(table: RawTable, name: str, how: RideInterpretation) -> RideRecord:
    """The record of a table.

    Raises:
        ValueError: a column that is missing, doubtful, without a unit, or holds something else than numbers.
    """
    headers = [split_header(column.name)[0] for column in table.columns]
    roads = [given_column(table, ROAD, which, "road") for which in _road_columns(table, headers, how.road)]
    time_column = (how.columns or {}).get("time", "time" if "time" in headers else None)
    chosen = _channels(table, headers, how.columns, {*roads}, time_column)
    how.check_names(chosen)
    time = _time(table, time_column, how)
    channels = {channel: _values(table, index, channel, how) for channel, index in chosen.items()}
    wheels = [_values(table, index, ROAD, how) for index in roads]
    kinds = {unit for _, unit in wheels}
    if len(kinds) > 1:
        raise ValueError(f"{table.where}: the columns of the road must all be heights, or all forces on the wheels.")
    return RideRecord(
        name,
        time,
        np.stack([values for values, _ in wheels], axis=1),
        {channel: values for channel, (values, _) in channels.items()},
        {channel: unit for channel, (_, unit) in channels.items()},
        driven_by="forces" if kinds == {"N"} else "heights",
        settings=_settings(table),
        source=str(table.file),
        notes=table.notes,
    )


def _settings(table: RawTable) -> dict[str, float | int | str]:
    """The settings in a file that the library wrote."""
    lines = [line.removeprefix(RIDE_SETTINGS_MARK) for line in table.preamble if line.startswith(RIDE_SETTINGS_MARK)]
    return json.loads(lines[0]) if lines and table.preamble[0].strip() == RIDE_MARK else {}


def _channels(
    table: RawTable,
    headers: Sequence[str],
    columns: Mapping[str, str | int] | None,
    roads: set[int],
    time_column: str | int | None,
) -> dict[str, int]:
    """Number of the column of each channel: those asked for, or all that have a name."""
    if columns is None:
        return {h: i for i, h in enumerate(headers) if h and i not in roads and h != time_column}
    return {channel: given_column(table, channel, which) for channel, which in columns.items() if channel != "time"}


def _road_columns(
    table: RawTable, headers: Sequence[str], road: Sequence[str | int] | str | int | None
) -> list[str | int]:
    """Headers or numbers of the columns of the road."""
    if road is not None:
        return [road] if isinstance(road, str | int) else list(road)
    numbered = f"{ROAD} "
    roads = [h for h in headers if h == ROAD or (h.startswith(numbered) and h.removeprefix(numbered).isdigit())]
    if not roads:
        remedy = 'Name the columns of the heights under the wheels: `road=["platform"]`.'
        raise ValueError(f"{table.where} has no column `road`; there are {', '.join(table.names)}. {remedy}")
    return [*roads]


def _values(table: RawTable, index: int, channel: str, how: RideInterpretation) -> tuple[Samples, str]:
    """A column in SI with the library's sign, and its SI unit."""
    raw = table.columns[index]
    where = f"{table.where}, column {table.names[index]!r}"
    if raw.faults or raw.is_text:
        row, text = min(raw.faults.items()) if raw.faults else (0, str(raw.values[0]))
        raise ValueError(f"{where}, {table.place(row)}: {text!r} is not a number. Mend or remove the line.")
    written = how.unit(channel) or raw.unit or split_header(raw.name)[1]
    if not written:
        raise ValueError(f"{where}: no unit. Write it into the header, or pass `units={{{channel!r}: 'm/s^2'}}`.")
    units = tuple(ROAD_UNITS.values()) if channel == ROAD else SI_UNITS
    factor, unit = _to_si(written, units)
    if factor is None:
        raise ValueError(f"{where}: {written!r} is no unit of {channel!r}; it must be one of {', '.join(units)}.")
    return how.sign(channel) * factor * np.asarray(raw.values, np.float64), unit


def _to_si(written: str, units: Sequence[str]) -> tuple[float | None, str]:
    """Factor to SI, and the SI unit; None for a unit of something else."""
    if written.strip() in ("g", "g0", "g_n") and "m/s^2" in units:
        return STANDARD_GRAVITY, "m/s^2"
    plain = written.strip().replace("²", "^2").replace("m/s2", "m/s^2").replace("rad/s2", "rad/s^2")
    return next(((factor, unit) for unit in units if (factor := ratio(plain, unit)) is not None), (None, ""))


def _time(table: RawTable, time_column: str | int | None, how: RideInterpretation) -> Samples:
    """The instants [s]."""
    rate = how.sampling_rate
    if time_column is None:
        if rate is None:
            raise ValueError(f"{table.where} has no column `time`: pass `sampling_rate` [Hz], or name it in `columns`.")
        return clock.uniform_time(rate, len(table))
    if rate is not None:
        raise ValueError(f"{table.where} has a column of time: leave `sampling_rate` out.")
    index = given_column(table, "time", time_column)
    raw = table.columns[index]
    where = f"{table.where}, column {table.names[index]!r}"
    if raw.is_text:
        return stamps.seconds(np.asarray(raw.values), where, table.place)[0]
    written = how.unit("time") or raw.unit or split_header(raw.name)[1]
    factor = ratio(written, "s") if written else None
    if factor is None:
        raise ValueError(f"{where}: {written or 'no unit'} instead of a unit of time; pass `units={{'time': 's'}}`.")
    return factor * np.asarray(raw.values, np.float64)
