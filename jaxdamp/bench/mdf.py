"""Reader of MDF files: channel groups with the same clock are a record together."""

from pathlib import Path

import numpy as np

from jaxdamp.bench.raw import RawColumn, RawTable
from jaxdamp.bench.raw_tables import Untyped, alone, apart, library


_TIME = 1  # what a master channel measures, of time, angle, distance and index; files before MDF4 know time only


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
