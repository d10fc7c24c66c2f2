"""Reader of TDMS files: waveforms with clocks of their own, on the common time of the file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jaxdamp.bench.raw import RawColumn, RawTable
from jaxdamp.bench.raw_tables import Clock, Untyped, alone, library, tables_by_clock


_UNSET = np.datetime64("1904-01-01T00:00:00", "ns")  # the zero of LabVIEW, where no start was written


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
