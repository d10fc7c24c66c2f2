"""Time stamps: dates and clocks as text, in seconds."""

import re
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from jaxdamp._checks import ArgumentError, Setting


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


def seconds(texts: np.ndarray, where: str, place: Callable[[int], str]) -> tuple[Float[np.ndarray, " time"], str]:
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
    """Seconds from midnight."""
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
