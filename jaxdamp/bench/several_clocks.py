"""Stroke and force of a record in groups of a file that have clocks of their own, brought onto one clock."""

from collections.abc import Sequence

import numpy as np

from jaxdamp._checks import ArgumentError
from jaxdamp.bench import sampling
from jaxdamp.bench.columns import Choice, is_record
from jaxdamp.bench.raw import RawColumn, RawTable


def on_one_clock(tables: Sequence[RawTable], choice: Choice) -> list[RawTable]:
    """The tables of a file; those that hold only the stroke and only the force as one, on the clock with more samples.

    The other channels are interpolated by cubics over the time that both clocks cover. Files with a table that has
    both, and tables without a column "time" in seconds, stay as they are.

    Raises:
        ValueError: several tables could belong together, a clock has gaps, or both do not run at the same time.
    """
    roles = ("velocity" if choice.stroke_from_velocity else "stroke", "force")
    parts = {role: [table for table in tables if is_record(table, choice, (role,))] for role in roles}
    apart = [table for group in parts.values() for table in group]
    whole = len({id(table) for table in apart}) < len(apart)
    clocks = [np.asarray(c.values) for table in apart for c in table.columns if (c.name, c.unit) == ("time", "s")]
    if whole or not all(parts.values()) or len(clocks) < len(apart):
        return list(tables)
    names = " and ".join(f"the {role} in {', '.join(repr(t.record) for t in group)}" for role, group in parts.items())
    remedy = "Export the channels of a record on one clock, in one group."
    if len(apart) > len(parts):
        raise ArgumentError(
            f"{apart[0].file}: which groups of different clocks belong together is not clear: {names}. {remedy}"
        )
    for table, clock in zip(apart, clocks, strict=True):
        sampling.check_order(clock, table.where)
        if sampling.gaps(clock).size:
            raise ArgumentError(f"{table.where}: the clock has gaps, over which nothing is interpolated. {remedy}")
    start, stop = max(clock[0] for clock in clocks), min(clock[-1] for clock in clocks)
    finest = max(clocks, key=lambda clock: len(clock) / (clock[-1] - clock[0]))
    common = finest[(finest >= start) & (finest <= stop)]
    if len(common) < sampling.FEWEST:
        raise ArgumentError(f"{apart[0].file}: the clocks of {names} hardly overlap. {remedy}")
    columns = [_at(common, clock, column) for t, clock in zip(apart, clocks, strict=True) for column in _numbers(t)]
    note = (
        f"{names}, on different clocks: brought onto that of {1 / np.median(np.diff(finest)):.4g} Hz by cubics, "
        f"from {start:.4g} to {stop:.4g} s, which both cover"
    )
    together = RawTable(apart[0].file, (RawColumn("time", common, "s"), *columns), notes=(note,))
    return [together, *(table for table in tables if table not in apart)]


def _numbers(table: RawTable) -> list[RawColumn]:
    """The channels beside the clock that hold numbers without faults."""
    columns = [c for c in table.columns if c.name != "time" and not c.is_text and not c.faults]
    return [c for c in columns if np.all(np.isfinite(np.asarray(c.values)))]


def _at(common: np.ndarray, clock: np.ndarray, column: RawColumn) -> RawColumn:
    """A channel at the instants of another clock."""
    from scipy.interpolate import CubicSpline  # takes a second to import, and few files need it

    values = np.asarray(column.values)
    inside = (clock >= common[0]) & (clock <= common[-1])
    same = np.array_equal(clock[inside], common)
    return RawColumn(column.name, values[inside] if same else CubicSpline(clock, values)(common), column.unit)
