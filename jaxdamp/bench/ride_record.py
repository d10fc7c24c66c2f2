"""Records of a vehicle on a rig or on a road: what moved it, what its sensors measured, and how tables become them."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import final

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._tables import Contents, plain
from jaxdamp.bench import clock
from jaxdamp.bench.columns import Choice, find_one, given_column
from jaxdamp.bench.headers import split_header
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.raw import RawColumn, RawTable
from jaxdamp.bench.units import ratio


RIDE_MARK = "# jaxdamp ride record: heights and accelerations up, travels positive in extension"
RIDE_SETTINGS_MARK = "# settings: "
ROAD = "road"
ROAD_UNITS = {"heights": "m", "forces": "N"}


@final
@dataclass(frozen=True, repr=False, eq=False)
class RideRecord:
    """A vehicle on a road or on a rig: the heights under its wheels, and the measured channels.

    Channels have the names of the vehicle's channels (`vehicle.units` lists them, `vehicle.descriptions` says which
    direction is positive): `sprung_acceleration`, `stroke`, `z_unsprung`, `dynamic_tyre_load`. All are in SI; heights
    and accelerations are positive up, travels and their rates in extension. Arrays are copies and read-only.

    Arguments:
        name: name of the record.
        time: instants [s], uniform and increasing, shape (time,).
        road: height of the road, or of the platform of a test rig, under each wheel [m], up positive, in the order of
            `vehicle.wheel_names`, shape (time, wheels); one wheel may be given in one dimension. The rear axle's column
            has its own heights at the same instants. Or the measured force on each wheel [N], see `driven_by`.
        channels: the measured channels by name, each of shape (time,).
        units: their SI units, as far as they are known; `fit` compares them with those of the vehicle.
        driven_by: what `road` is: "heights" [m], or "forces" [N] on the wheels minus the static loads, positive up, of
            wheel force transducers; the tyres then have no part in the motion (`vehicles.ForceDriven`).
        settings: further facts about the record by name, such as payload or speed.
        source: the file, or another origin.
        notes: sentences on what was done to the data.

    Raises:
        ValueError: no channels, channels of different lengths, fewer than 20 samples, NaN, time that is not uniform, a
            road that stands still.

    >>> time = np.arange(500) / 500
    >>> platform = 0.01 * np.sin(6 * np.pi * time)
    >>> RideRecord("3 Hz", time, platform, {"stroke": 0.4 * platform}, units={"stroke": "m"})
    RideRecord('3 Hz': 1 s at 500 Hz, 1 wheel moved by 20 mm, measured: stroke)
    """

    name: str
    time: np.ndarray
    road: np.ndarray
    channels: Mapping[str, np.ndarray]
    units: Mapping[str, str] = field(default_factory=dict)
    driven_by: str = "heights"
    settings: Mapping[str, float | int | str] = field(default_factory=dict)
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        where = f"record {self.name!r}"
        _checks.one_of("driven_by", self.driven_by, ROAD_UNITS)
        if not self.channels:
            remedy = "Write `channels={'sprung_acceleration': values}`."
            _checks.refuse("channels", "hold at least one measured channel", "empty", remedy)
        _checks.untraced("channels", (self.time, self.road, dict(self.channels)))
        time, road = np.array(self.time, np.float64), np.array(self.road, np.float64)
        road = road[:, None] if road.ndim == 1 else road
        clock.check_count(len(time), where)
        clock.check_numbers(time, "time", where)
        time, note = clock.check_time(time, where)
        channels = {name: np.array(values, np.float64) for name, values in self.channels.items()}
        for name, values in {ROAD: road, **channels}.items():
            if len(values) != len(time) or values.ndim != 1 + (name == ROAD):
                _checks.refuse(name, f"have one sample for each of {len(time)} instants", f"of shape {values.shape}")
            clock.check_numbers(np.ravel(values), name, where)
        if not np.any(np.ptp(road, axis=0) > 0):
            remedy = "Free motion after a release has no input: give the heights while the vehicle is moved."
            _checks.refuse(ROAD, "move", f"constant in {where}", remedy)
        for values in (time, road, *channels.values()):
            values.setflags(write=False)
        unknown = [name for name in self.units if name not in channels]
        if unknown:
            _checks.one_of("units", unknown[0], channels)
        notes = (*self.notes, *([note] if note else []))
        for argument, value in {"time": time, ROAD: road, "channels": channels, "notes": notes}.items():
            object.__setattr__(self, argument, value)

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.time)

    @cached_property
    def fingerprint(self) -> bytes:
        """A digest of the channels, the same for a record that is read again, copied or renamed."""
        names = sorted(self.channels)
        return clock.digest(self.time, self.road, np.array(names), *(self.channels[name] for name in names))

    def __getitem__(self, channel: str) -> Float[np.ndarray, " time"]:
        """A measured channel."""
        _checks.one_of("channel", channel, self.channels)
        return self.channels[channel]

    @property
    def dt(self) -> float:
        """Sampling interval [s]."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    @property
    def wheels(self) -> int:
        """Number of wheels that the road moves."""
        return self.road.shape[1]

    def between(self, start: float | int, stop: float | int) -> "RideRecord":
        """The part of the record with start ≤ time < stop [s]."""
        chosen = (self.time >= start) & (self.time < stop)
        channels = {name: values[chosen] for name, values in self.channels.items()}
        notes = (*self.notes, f"cut to {start:g} to {stop:g} s")
        changed = {"time": self.time[chosen], "road": self.road[chosen], "channels": channels, "notes": notes}
        return replace(self, **changed)

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the record with units in its header; `read_rides` gives back the same numbers to the last bit."""
        for name in self.channels:
            if not self.units.get(name):
                remedy = f"Give it when the record is made: `units={{{name!r}: 'm/s^2'}}`."
                _checks.refuse("units", "state the unit of each channel", f"without one for {name!r}", remedy)
        roads = [ROAD] if self.wheels == 1 else [f"{ROAD} {i + 1}" for i in range(self.wheels)]
        header = ["time [s]", *[f"{name} [{ROAD_UNITS[self.driven_by]}]" for name in roads]]
        header += [f"{name} [{self.units[name]}]" for name in self.channels]
        columns = np.column_stack([self.time, self.road, *self.channels.values()])
        settings = [RIDE_SETTINGS_MARK + json.dumps(plain(self.settings))] if self.settings else []
        rows = [",".join(map(repr, row)) for row in columns.tolist()]
        path = Path(path)
        path.write_text("\n".join([RIDE_MARK, *settings, ",".join(header), *rows]) + "\n", encoding="utf-8")
        return path

    def summary(self) -> Contents:
        """Length, rate and the standard deviation of each channel, in SI."""
        levels = {f"standard deviation of {name}": float(np.std(values)) for name, values in self.channels.items()}
        return {"name": self.name, "samples": len(self), "sampling_rate": 1.0 / self.dt, **levels}

    def __repr__(self) -> str:
        rate, span = 1.0 / self.dt, float(np.max(np.ptp(self.road, axis=0)))
        moved = f"{1e3 * span:.3g} mm" if self.driven_by == "heights" else f"{span:.3g} N"
        wheels = f"{self.wheels} wheel{'s' * (self.wheels > 1)}"
        return (
            f"RideRecord({self.name!r}: {len(self) * self.dt:.4g} s at {rate:.6g} Hz, {wheels} moved by {moved},"
            f" measured: {', '.join(self.channels)})"
        )


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

    def unit(self, channel: str, column: RawColumn) -> str | None:
        """The unit of a channel: that given, or that of its column."""
        return (self.units or {}).get(channel) or column.unit or split_header(column.name)[1]

    def check_names(self, channels: Mapping[str, int]) -> None:
        """Refuse units and signs of channels that are not read."""
        for name in (*(self.reversed_channels or ()), *(self.units or ())):
            _checks.one_of("channel", name, [*channels, ROAD, "time"])


def ride_record(table: RawTable, name: str, how: RideInterpretation) -> RideRecord:
    """The record of a table."""
    headers = [split_header(column.name)[0] for column in table.columns]
    roads = [given_column(table, ROAD, which, "road") for which in _road_columns(table, headers, how.road)]
    at = _time_column(table, headers, how)
    chosen = _channels(table, headers, how.columns, {*roads, *([] if at is None else [at])})
    if not chosen:
        remedy = "A record needs a measured channel beside the road, in the same table, sheet or group."
        raise ValueError(
            f"{table.where}: no channel beside road and time; its columns are {', '.join(table.names)}. {remedy}"
        )
    how.check_names(chosen)
    time = _time(table, at, how)
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
    lines = [line.removeprefix(RIDE_SETTINGS_MARK) for line in table.preamble if line.startswith(RIDE_SETTINGS_MARK)]
    return json.loads(lines[0]) if lines and table.preamble[0].strip() == RIDE_MARK else {}


def _channels(
    table: RawTable, headers: Sequence[str], columns: Mapping[str, str | int] | None, others: set[int]
) -> dict[str, int]:
    """Number of the column of each channel: those asked for, or all that have a name but for road and time."""
    if columns is None:
        return {header: index for index, header in enumerate(headers) if header and index not in others}
    return {channel: given_column(table, channel, which) for channel, which in columns.items() if channel != "time"}


def _road_columns(
    table: RawTable, headers: Sequence[str], road: Sequence[str | int] | str | int | None
) -> list[str | int]:
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
    written = how.unit(channel, raw)
    if not written:
        raise ValueError(f"{where}: no unit. Write it into the header, or pass `units={{{channel!r}: 'm/s^2'}}`.")
    units = tuple(ROAD_UNITS.values()) if channel == ROAD else SI_UNITS
    factor, unit = _to_si(written, units)
    if factor is None:
        raise ValueError(f"{where}: {written!r} is no unit of {channel!r}; it must be one of {', '.join(units)}.")
    sign = -1.0 if channel in (how.reversed_channels or ()) else 1.0
    return sign * factor * np.asarray(raw.values, np.float64), unit


def _to_si(written: str, units: Sequence[str]) -> tuple[float | None, str]:
    """Factor to SI, and the SI unit; None for a unit of something else."""
    if written.strip() in ("g", "g0", "g_n") and "m/s^2" in units:
        return STANDARD_GRAVITY, "m/s^2"
    plain = written.strip().replace("²", "^2").replace("m/s2", "m/s^2").replace("rad/s2", "rad/s^2")
    return next(((factor, unit) for unit in units if (factor := ratio(plain, unit)) is not None), (None, ""))


def _time_column(table: RawTable, headers: Sequence[str], how: RideInterpretation) -> int | None:
    """The number of the column of the time: that given, that of the name "time", or one that `read` takes for it."""
    wanted = (how.columns or {}).get("time", "time" if "time" in headers else None)
    return find_one(table, "time", Choice()) if wanted is None else given_column(table, "time", wanted)


def _time(table: RawTable, index: int | None, how: RideInterpretation) -> Samples:
    rate = how.sampling_rate
    if index is None:
        if rate is None:
            raise ValueError(f"{table.where} has no column `time`: pass `sampling_rate` [Hz], or name it in `columns`.")
        return clock.uniform_time(rate, len(table))
    if rate is not None:
        raise ValueError(f"{table.where} has a column of time, {table.names[index]!r}: leave `sampling_rate` out.")
    raw = table.columns[index]
    where = f"{table.where}, column {table.names[index]!r}"
    if raw.is_text:
        return clock.seconds(np.asarray(raw.values), where, table.place)[0]
    written = how.unit("time", raw)
    factor = ratio(written, "s") if written else None
    if factor is None:
        raise ValueError(f"{where}: {written or 'no unit'} instead of a unit of time; pass `units={{'time': 's'}}`.")
    return factor * np.asarray(raw.values, np.float64)
