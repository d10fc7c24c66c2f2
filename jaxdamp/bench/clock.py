"""The channels of a record as arrays, and its instants: order, gaps, rounding, jitter, time stamps as text."""

import hashlib
import itertools
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from jaxtyping import ArrayLike, Float
from numpy.lib.stride_tricks import sliding_window_view

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting
from jaxdamp.bench.motion import Samples


Place = Callable[[int], str]  # where a sample stands, for messages
IN_ARRAYS: Place = "sample {}".format
FEWEST = 20  # samples of a record
_MEASURED = "A record is measured: keep it out of the arguments of `jax.jit`, and trace the law (`jaxdamp.respond`)."
_GAP = 1.5  # sampling steps that are taken for a gap
_OFTEN = 0.02  # share of such steps beyond which a clock jitters
_WIDE_GAP = 3.0  # sampling steps that are a gap even then
_JITTER = 0.02  # sampling steps by which an instant may be off


def uniform_time(rate: float | int, count: int) -> Samples:
    """Instants [s] of samples taken at a rate [Hz], from zero."""
    return np.arange(count) / rate


def channel_of(channel: str, values: ArrayLike, count: int) -> Float[np.ndarray, " time"]:
    """A copy of a channel, of the length of the time."""
    _checks.untraced(channel, values, _MEASURED)
    column = np.array(values, dtype=np.float64)
    if column.ndim != 1 or len(column) != count:
        _checks.refuse(channel, f"be a column of as many samples as the time, {count}", f"of shape {column.shape}")
    return column


def digest(*channels: np.ndarray) -> bytes:
    """A digest of samples, the same wherever they are equal."""
    joined = hashlib.blake2b(digest_size=16)
    for channel in channels:
        joined.update(channel.tobytes())
    return joined.digest()


def check_time(time: Samples, where: str) -> tuple[Samples, str]:
    """The instants of a uniformly sampled record, and a sentence if they had to be put back on the uniform grid."""
    check_order(time, where)
    if is_uniform(time):
        return time, ""
    missing = gaps(time)
    if missing.size:
        refuse_gaps(time, missing, where)
    rounded = without_rounding(time)
    if rounded is not None:
        return rounded
    steps = np.diff(time)
    raise ValueError(
        f"{where}: the samples are not uniform in time, the steps go from {steps.min():.4g} to {steps.max():.4g} s. "
        "Resample all channels with numpy.interp to one rate; `bench.read` does so with files."
    )


def check_order(time: Samples, where: str, place: Place = IN_ARRAYS) -> None:
    """Refuse a time that goes back or stands still, naming where."""
    back = np.flatnonzero(np.diff(time) <= 0)
    if back.size:
        i = int(back[0]) + 1
        moves = f"time goes from {time[i - 1]:.9g} s to {time[i]:.9g} s, but must increase"
        _refuse_clock(f"{where}, {place(i)}: {moves}. Cut the record there")


def _refuse_clock(said: str) -> NoReturn:
    """Refuse a time with a sentence on what may also be wrong."""
    without, rate = Setting("columns", {"time": None}), Setting("sampling_rate")
    remedy = f"or, if its clock is too coarse, leave its column out and give the rate: {without}, {rate}."
    raise ArgumentError(f"{said}; {remedy}", without, rate)


def is_uniform(time: Samples) -> bool:
    """Whether increasing instants lie on a uniform grid, as near as a clock needs."""
    step, off = _grid(time)
    return off <= _JITTER * step


def gaps(time: Samples) -> np.ndarray:
    """Numbers of the samples behind which time jumps. A clock with steps of many lengths only jitters."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    if is_uniform(time):
        return np.empty(0, dtype=int)
    wide = steps > _GAP * usual
    if np.mean(wide) > _OFTEN:
        wide = steps > _WIDE_GAP * usual
    return np.flatnonzero(wide)


def rate_changes(time: Samples) -> np.ndarray:
    """Numbers of the samples behind which the clock runs at another rate, steadily before and behind."""
    count = FEWEST
    if len(time) <= 2 * count or is_uniform(time):
        return np.empty(0, dtype=int)
    middle = np.arange(count, len(time) - count)
    before, behind = ((time[middle + a] - time[middle + b]) / count for a, b in ((0, -count), (count, 0)))
    places = middle[np.abs(np.log(behind / before)) > np.log(_OTHER_RATE)]
    windows, number = sliding_window_view(time, count + 1), np.arange(count + 1) - count / 2

    def off_grid(first: np.ndarray) -> np.ndarray:
        inside = windows[first] - windows[first].mean(axis=1, keepdims=True)
        step = inside @ number / (number @ number)
        return np.max(np.abs(inside - step[:, None] * number), axis=1) / step

    off = np.maximum(off_grid(places - count), off_grid(places))
    steady = off < _STEADY
    groups = np.split(places[steady], np.flatnonzero(np.diff(places[steady]) > count) + 1)
    offs = np.split(off[steady], np.flatnonzero(np.diff(places[steady]) > count) + 1)
    return np.array([group[np.argmin(each)] - 1 for group, each in zip(groups, offs, strict=True) if group.size], int)


def _cuts(time: Samples) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the samples behind which time jumps, and of those behind which its rate changes."""
    changes = rate_changes(time)
    stretches = itertools.pairwise([0, *(changes + 1), len(time)])
    return np.concatenate([start + gaps(time[start:stop]) for start, stop in stretches]), changes


def refuse_cuts(time: Samples, where: str, place: Place) -> NoReturn:
    """Refuse a record that cannot be cut at its gaps and changes of its rate."""
    missing, changes = _cuts(time)
    if missing.size:
        refuse_gaps(time, missing, where, place)
    i = int(changes[0]) + 1
    before, behind = (FEWEST / (time[i + a] - time[i + b]) for a, b in ((0, -FEWEST), (FEWEST, 0)))
    said = f"the sampling rate changes from {before:.4g} to {behind:.4g} Hz ({changes.size} such changes in all)"
    _refuse_clock(f"{where}, {place(i)}: {said}. Cut the record there")


def refuse_gaps(time: Samples, missing: np.ndarray, where: str, place: Place = IN_ARRAYS) -> NoReturn:
    """Refuse a record with samples missing behind these."""
    i, steps = int(missing[0]) + 1, np.diff(time)
    usual = float(np.median(steps))
    _refuse_clock(
        f"{where}, {place(i)}: {steps[i - 1] / usual - 1:.0f} samples are missing between {time[i - 1]:.6g} "
        f"and {time[i]:.6g} s ({missing.size} such gaps in all; the usual step is {usual:.4g} s). Cut the record "
        "into the parts before and after the gap"
    )


def without_rounding(time: Samples) -> tuple[Samples, str] | None:
    """The uniform instants that were rounded when they were written (three decimals at 300 Hz), and a note."""
    step, off = _grid(time)
    written = (digits for digits in range(9) if np.all(np.abs(np.round(time, digits) - time) < 1e-10))
    quantum = 10.0 ** -next(written, 9)
    if off > 0.6 * quantum:
        return None
    note = f"time was rounded to {quantum:g} s in the file; it is put back on a grid of {1 / step:.6g} Hz"
    return time[0] + step * np.arange(len(time)), note


def _grid(time: Samples) -> tuple[float, float]:
    """Step of the uniform grid next to the instants, and the largest distance from it."""
    number = np.arange(len(time)) - (len(time) - 1) / 2
    step = float(np.dot(number, time) / np.dot(number, number))
    return step, float(np.max(np.abs(time - time.mean() - step * number)))


def check_numbers(values: Float[np.ndarray, " time"], role: str, where: str, place: Place = IN_ARRAYS) -> None:
    """Refuse NaN and infinity, naming the first."""
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise ValueError(
            f"{where}, {place(int(bad[0]))}: the {role} is {values[bad[0]]} ({bad.size} such values in all). "
            "Cut the record there or mend it."
        )


def check_stroke(stroke: Samples, where: str) -> None:
    """Refuse a stroke that stands still."""
    if np.ptp(stroke) <= 1e-9:
        name = Setting("columns", {"stroke": ...})
        raise ArgumentError(
            f"{where}: the stroke is constant ({stroke[0]:.6g} m), so there is no motion to learn from. Is it the "
            f"right column? Name it with {name}.",
            name,
        )


def check_count(count: int, where: str) -> None:
    """Refuse a record that is too short."""
    if count < FEWEST:
        raise ValueError(
            f"{where} has only {count} samples, too few: a record needs at least {FEWEST}, better 30 per cycle."
        )


_OTHER_RATE = 1.2  # ratio of steps beyond which the clock runs at another rate, if it is steady before and behind
_STEADY = 0.25  # of a step, by which a steady clock is off: rounded instants are
_EPOCH = 1e8  # seconds: a larger time counts from 1970, not from the start of the record
_MOST_PARTS = 20


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch of a record without gap."""

    samples: slice  # which samples of the file it holds
    stored: Samples  # their instants in the file [s]
    time: Samples  # uniform instants [s]
    resample: bool  # whether the channels have to be interpolated at these instants
    notes: tuple[str, ...]  # what was done to the time

    def of(self, values: Float[np.ndarray, " file_time"]) -> Samples:
        """A channel of the file at the instants of this part."""
        return np.interp(self.time, self.stored, values[self.samples]) if self.resample else values[self.samples]


def regular_parts(time: Samples, where: str, place: Place = IN_ARRAYS) -> list[Part]:
    """The stretches of a record between gaps in time and changes of its rate, each on uniform instants."""
    notes: tuple[str, ...] = ()
    if abs(time[0]) > _EPOCH:
        notes = (f"time counts from the first sample, which the file puts at {time[0]:.3f} s",)
        time = time - time[0]
    check_order(time, where, place)
    missing, changes = _cuts(time)
    if len(missing) + len(changes) >= _MOST_PARTS:
        refuse_cuts(time, where, place)
    edges = [0, *(np.sort(np.concatenate([missing, changes])) + 1).tolist(), len(time)]
    kinds = {"gaps in time": missing.size, "changes of the sampling rate": changes.size}
    between = " and ".join(kind for kind, count in kinds.items() if count)
    parts = []
    for number, (start, stop) in enumerate(itertools.pairwise(edges), 1):
        cut = f"part {number} of {len(edges) - 1} between {between}, {time[start]:.6g} to {time[stop - 1]:.6g} s"
        parts.append(_part(time, slice(start, stop), (*notes, cut) if between else notes))
    return parts


def _part(time: Samples, samples: slice, notes: tuple[str, ...]) -> Part:
    stored = time[samples]
    if len(stored) < FEWEST or is_uniform(stored):
        return Part(samples, stored, stored, False, notes)
    rounded = without_rounding(stored)
    if rounded is not None:
        grid, note = rounded
        return Part(samples, stored, grid, False, (*notes, note))
    grid = np.linspace(stored[0], stored[-1], len(stored))
    off = float(np.max(np.abs(stored - grid))) / (grid[1] - grid[0])
    note = (
        f"the clock jitters by up to {off:.2g} of a step: all channels resampled by linear interpolation at "
        f"{1 / (grid[1] - grid[0]):.6g} Hz"
    )
    return Part(samples, stored, grid, True, (*notes, note))


_DATE = r"(?:(?P<iso>\d{4}-\d\d-\d\d)|(?P<dotted>\d{1,2}\.\d{1,2}\.\d{4})|(?P<slashed>\d{1,4}/\d{1,2}/\d{1,4}))"
_CLOCK = r"(?P<hours>\d{1,3}):(?P<minutes>\d\d)(?::(?P<seconds>\d\d(?:[.,]\d+)?))?(?:\s*(?P<half>[AaPp][Mm]))?"
_STAMP = re.compile(rf"(?:{_DATE}(?:[T ]\s*|$))?(?:{_CLOCK}(?P<zone>Z|[+-]\d\d:?\d\d)?)?")
_DAY = 86400.0
_NOTE = "time counts from the first time stamp"


def is_stamp(text: str) -> bool:
    """Whether a text is a date, a time of day, or both.

    >>> [is_stamp(text) for text in ("2026-03-01T09:30:00.125Z", "09:30:00,125", "1.3.2026 9:30:00", "9.5", "OK")]
    [True, True, True, False, False]
    """
    return (":" in text or "-" in text or "/" in text or text.count(".") == 2) and bool(_STAMP.fullmatch(text))


def seconds(texts: np.ndarray, where: str, place: Place) -> tuple[Float[np.ndarray, " time"], str]:
    """Time stamps as seconds from the first one, and a sentence on what was made of them.

    They are ISO 8601, or "hh:mm:ss.fff" with or without a date, with AM or PM, all of one time zone.
    """
    at_once = _at_once(texts)
    if at_once is not None:
        return at_once, _NOTE
    values, dates, zones = np.empty(len(texts)), [], set()
    for index, text in enumerate(texts):
        stamp = _STAMP.fullmatch(str(text).strip())
        if stamp is None or stamp["hours"] is None:
            without, rate = Setting("columns", {"time": None}), Setting("sampling_rate")
            raise ArgumentError(
                f"{where}, {place(index)}: {str(text)!r} is no time stamp such as 2026-03-01T09:30:00.125 or "
                f"09:30:00.125. Mend it, or leave the column out and give the rate: {without}, {rate}.",
                without,
                rate,
            )
        values[index] = _time_of_day(stamp)
        dates.append(stamp["iso"] or stamp["dotted"] or stamp["slashed"] or "")
        zones.add(stamp["zone"])
    if len(zones) > 1:
        named = ", ".join(sorted(zone or "none" for zone in zones))
        raise ValueError(f"{where}: the time stamps have different time zones ({named}): export them in one.")
    if any(dates):
        return _from_first(values, _days(dates, where)), _NOTE
    days = np.cumsum(np.diff(values, prepend=values[0]) < -_DAY / 2)
    return _from_first(values, days), _NOTE + (", with midnight in between" if days[-1] else "")


def _time_of_day(stamp: re.Match[str]) -> float:
    hours = int(stamp["hours"])
    if stamp["half"]:
        hours = hours % 12 + 12 * (stamp["half"].lower() == "pm")
    clock = 3600 * hours + 60 * int(stamp["minutes"])
    return clock + float((stamp["seconds"] or "0").replace(",", "."))


def _at_once(texts: np.ndarray) -> Float[np.ndarray, " time"] | None:
    """ISO 8601 dates and times of one length in seconds from the first, by NumPy; None if some need a closer look."""
    first = _STAMP.fullmatch(str(texts[0]))
    if first is None or not first["iso"] or not first["seconds"] or first["zone"] or first["half"]:
        return None
    if any(len(text) != len(texts[0]) or text[4] != "-" or text[13] != ":" for text in texts):
        return None
    try:
        return (texts.astype("datetime64[ns]") - np.datetime64(texts[0], "ns")).astype(np.float64) / 1e9
    except ValueError:
        return None


def _from_first(clock: Float[np.ndarray, " time"], days: np.ndarray) -> Float[np.ndarray, " time"]:
    return np.round((clock - clock[0]) + _DAY * (days - days[0]), 9)  # to a nanosecond: no rest of the subtraction


def _days(dates: list[str], where: str) -> Float[np.ndarray, " time"]:
    """Days since the first date."""
    different = list(dict.fromkeys(dates))
    if len(different) == 1:
        return np.zeros(len(dates))
    if any("/" in date or not date for date in different):
        shown = ", ".join(map(repr, different[:3]))
        raise ValueError(
            f"{where}: the dates of the time stamps ({shown}) change, and which number is the day and which the month "
            "they do not say: export them as ISO 8601, 2026-03-01T09:30:00.125."
        )
    iso = {date: "-".join(f"{int(n):02}" for n in reversed(date.split("."))) if "." in date else date for date in dates}
    try:
        day = {date: float(np.datetime64(text, "D").astype(int)) for date, text in iso.items()}
    except ValueError as error:
        raise ValueError(f"{where}: the dates of the time stamps are no dates: {error}.") from error
    return np.array([day[date] for date in dates])
