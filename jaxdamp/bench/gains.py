"""Gain and offset of a sensor: what a column in volts means."""

import re

from jaxdamp._checks import ArgumentError, Setting
from jaxdamp.bench.units import GAINS, Conversion, conversion, ratio


_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_GAIN = re.compile(rf"\s*({_NUMBER})\s*(.+?)\s*/\s*([^/\s]+)\s*(?:([+-])\s*({_NUMBER})\s*(\S.*?))?\s*")


def gain_conversion(role: str, gain: str, written: str, where: str) -> Conversion:
    """How to bring a column to SI by the gain of its sensor.

    Arguments:
        role: the quantity.
        gain: "500 N/V", with an offset "10 mm/V - 2.5 mm": quantity = gain · value + offset.
        written: unit of the column as the file states it; empty takes the one that the gain divides by.
        where: the column, for messages.

    Raises:
        ValueError: a gain that does not read so, does not give that quantity, or divides by another unit than the
            column has.

    >>> bring = gain_conversion("force", "0.5 kN/V + 20 N", "mV", "run.csv")
    >>> bring.unit, bring.factor, bring.offset
    ('mV at 0.5 kN/V + 20 N', 0.5, 20.0)
    """
    usual = f"{GAINS[role]}/V"
    example = Setting("gains", {role: usual})
    match = _GAIN.fullmatch(gain)
    if match is None:
        raise ArgumentError(
            f"{where}: the gain {gain!r} does not read like {usual!r}, or with an offset '{usual} - {GAINS[role]}'. "
            f"Pass {example}.",
            example,
        )
    size, unit, divisor, sign, offset, offset_unit = match.groups()
    unit = unit.strip("()[] ")
    out, of_offset = conversion(role, unit), conversion(role, offset_unit or unit)
    if out is None or of_offset is None:
        wrong = unit if out is None else offset_unit
        raise ArgumentError(
            f"{where}: the gain {gain!r} must give a {role}, but {wrong!r} is no unit of {role}. Pass one such as "
            f"{example}.",
            example,
        )
    scale = 1.0 if not written else ratio(written, divisor)
    if scale is None:
        raise ArgumentError(
            f"{where}: the column is in {written!r}, but the gain {gain!r} divides by {divisor!r}. Pass the gain for "
            f"{written!r}, for example {Setting('gains', {role: f'{size} {unit}/{written}'})}.",
            Setting("gains", {role: f"{size} {unit}/{written}"}),
        )
    shift = 0.0 if offset is None else float(sign + "1") * float(offset) * of_offset.factor + of_offset.offset
    if offset is None and out.offset:
        shift = out.offset  # a sensor in degrees Celsius without offset counts from 0 °C
    return Conversion(f"{written or divisor} at {gain.strip()}", float(size) * out.factor * scale, shift)
