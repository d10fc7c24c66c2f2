"""Readers of TDMS, MDF and Parquet files: channels with their units, and the clocks that they have together."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jaxdamp.bench.raw import Clock, RawColumn, RawTable, Untyped, alone, apart, library, tables_by_clock


_UNSET = np.datetime64("1904-01-01T00:00:00", "ns")  # the zero of LabVIEW, where no start was written
_TIME = 1  # what a master channel measures, of time, angle, distance and index; files before MDF4 know time only


def read_parquet(file: Path) -> list[RawTable]:
    """Read a Parquet file; units may stand in the metadata of its fields, as "unit"."""
    arrow = library("pyarrow", file)
    table, columns = library("pyarrow.parquet", file).read_table(file), []
    for field, data in zip(table.schema, table.columns, strict=True):
        unit = (field.metadata or {}).get(b"unit", b"").decode()
        values = (data.cast(arrow.float64()) if arrow.types.is_decimal(field.type) else data).to_numpy()
        columns.append(RawColumn(field.name, values if values.dtype.kind != "O" else [str(v) for v in values], unit))
    return [RawTable(file, tuple(columns))]


def read_tdms(file: Path) -> list[RawTable]:
    """Read a TDMS file: every group is a record. Waveforms without a channel for the time bring their own.

    Dates and the starts of waveforms count from the earliest of the file, so that groups keep their places in time.
    """
    groups = [(group.name, group.channels()) for group in library("nptdms", file).TdmsFile.read(file).groups()]
    starts = [start for _, channels in groups for channel in channels if (start := _start(channel)) is not None]
    origin = min(starts, default=None)
    return alone([table for name, channels in groups for table in _tables(file, name, channels, origin)])


def _tables(file: Path, name: str, channels: Sequence[Untyped], origin: np.datetime64 | None) -> list[RawTable]:
    """The channels of a group, one table for each clock."""
    columns, clocks, unplaced = [], [], []
    starts = [_seconds(start, origin) for channel in channels if (start := _start(channel)) is not None]
    for channel in channels:
        values, stated, start = channel[:], channel.properties, _start(channel)
        is_date = values.dtype.kind == "M"
        values = _seconds(values, origin) if is_date and origin is not None else values
        columns.append(RawColumn(channel.name, values, "s" if is_date else str(stated.get("unit_string", ""))))
        step, offset = float(stated.get("wf_increment", 0.0)), float(stated.get("wf_start_offset", 0.0))
        if is_date or not step > 0.0 or not len(values):
            clocks.append(None)
            continue
        begin = min(starts, default=0.0) if start is None else _seconds(start, origin)
        clocks.append(Clock(float(begin) + offset, step))
        unplaced += [channel.name] * (start is None and origin is not None)
    said = f"no start time in the file of {', '.join(unplaced)}: taken as the first of the group, or else of the file"
    return tables_by_clock(file, name, columns, clocks, [said] * bool(unplaced))


def _start(channel: Untyped) -> np.datetime64 | None:
    """The date of the first sample of a channel: of a waveform, or of dates; None where none is written."""
    stated = channel.properties.get("wf_start_time")
    if stated is None and len(channel) and channel.dtype.kind == "M":
        stated = channel[0]
    date = np.datetime64("NaT", "ns") if stated is None else np.datetime64(stated, "ns")
    return None if np.isnat(date) or date == _UNSET else date


def _seconds(dates: Untyped, origin: np.datetime64 | None) -> Untyped:
    """Seconds from the first date of the file."""
    return (dates - origin) / np.timedelta64(1, "s")


def read_mdf(file: Path) -> list[RawTable]:
    """Read an MDF file: channel groups with the same clock and channels of other names are a record together.

    Samples that the file marks as invalid are missing values. A master channel that is no time keeps its name and unit,
    and groups without one have no clock.
    """
    tables: list[tuple[str, RawColumn | None, list[RawColumn]]] = []
    with library("asammdf", file).MDF(file) as content:
        for index, group in enumerate(content.groups):
            master = _master(content, index)
            values = [i for i, channel in enumerate(group.channels) if channel.channel_type == 0]
            columns = [column for i in values if (column := _column(content, index, i)) is not None]
            same = next((other for _, clock, other in tables if _fit(master, clock, columns, other)), None)
            if same is not None:
                same.extend(columns)
            else:
                tables.append((_name(group.channel_group) or f"group {index}", master, columns))
    names = apart([name for name, _, _ in tables])
    whole = [[clock, *columns] if clock else columns for _, clock, columns in tables]
    return alone([RawTable(file, tuple(c), name) for c, name in zip(whole, names, strict=True) if c])


def _name(group: Untyped) -> str:
    """The name of a channel group, which has a comment at most before MDF4."""
    return getattr(group, "acq_name", "") or group.comment


def _column(content: Untyped, group: int, index: int) -> RawColumn | None:
    """A channel of numbers, NaN where the file says that a sample is invalid; None for texts and structures."""
    channel = content.get(group=group, index=index, ignore_invalidation_bits=True)
    if channel.samples.dtype.kind not in "biuf" or channel.samples.ndim != 1:
        return None
    invalid = getattr(channel, "invalidation_bits", None)
    values = channel.samples if invalid is None else np.where(invalid, np.nan, channel.samples)
    return RawColumn(channel.name, values, channel.unit)


def _master(content: Untyped, group: int) -> RawColumn | None:
    """The channel over which a group is recorded: "time" in seconds, or what else it is; None where it has none."""
    about = content.groups[group].channel_group
    owner = group if group in content.masters_db else getattr(about, "cg_master_index", None)
    place = content.masters_db.get(owner)
    if place is None:
        return None
    values, channel = np.asarray(content.get_master(group), np.float64), content.groups[owner].channels[place]
    if getattr(channel, "sync_type", _TIME) == _TIME:
        return RawColumn("time", values, "s")
    return RawColumn(channel.name, values, channel.unit or "")


def _fit(one: RawColumn | None, other: RawColumn | None, columns: list[RawColumn], others: list[RawColumn]) -> bool:
    """Whether two groups are one record: the same clock, and no channel in both."""
    if one is None or other is None or {c.name for c in columns} & {c.name for c in others}:
        return False
    same = (one.name, one.unit) == (other.name, other.unit)
    return same and np.array_equal(np.asarray(one.values), np.asarray(other.values))
