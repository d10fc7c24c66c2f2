"""Units at the file boundary: what a header or a user names becomes SI, by the gain of a sensor if need be."""

import re
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache

import numpy as np

from jaxdamp import _unit_registry
from jaxdamp._checks import ArgumentError, Setting


SI = {"time": "s", "stroke": "m", "velocity": "m/s", "force": "N", "temperature": "K", "command": "A"}
COMMAND_UNITS = ("A", "V", "%")  # of a command that is measured: a coil current, a voltage, a duty cycle
USUAL = {
    "time": ("s", "ms", "us", "min"),
    "stroke": ("mm", "m", "cm", "in", "um"),
    "velocity": ("m/s", "mm/s", "cm/s", "in/s", "ft/s"),
    "force": ("N", "kN", "daN", "lbf", "kgf"),
    "temperature": ("degC", "K", "degF"),
    "command": ("A", "mA", "V", "mV", "%"),
}
# The units of nearly all files: pint takes half a second to load, of the three until a first fit.
_KNOWN = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "stroke": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "in/s": 0.0254},
    "force": {"N": 1.0, "daN": 10.0, "kN": 1e3},
    "signal": {"V": 1.0, "mV": 1e-3},
}
GAINS = {
    "time": "0.001 s",
    "stroke": "10 mm",
    "velocity": "0.5 m/s",
    "force": "500 N",
    "temperature": "100 K",
    "command": "0.5 A",
}
SIGNALS = ("count", "counts", "digit", "digits", "ma", "mv/v", "%fs")  # units of a signal, beside volts
# How bench software writes units that pint reads as something else or not at all, in lower case, per quantity.
_WRITTEN = {
    "time": {"sec": "s", "secs": "s", "sek": "s", "msec": "ms", "µs": "us", "μs": "us"},
    "stroke": {"inch": "in", "inches": "in", '"': "in", "µm": "um", "μm": "um"},
    "velocity": {f"{unit}{per}": f"{unit}/s" for unit in ("m", "mm", "cm", "in") for per in ("_s", "/sec", "/second")}
    | {"mps": "m/s", "mmps": "mm/s"}
    | dict.fromkeys(("ips", "inch/s", "inches/s", "inch/sec"), "in/s"),
    "force": {"lb": "lbf", "lbs": "lbf", "pounds": "lbf", "newtons": "N", "kp": "kgf", "kg-f": "kgf"},
    "temperature": dict.fromkeys(("°c", "c", "deg_c", "deg c"), "degC") | dict.fromkeys(("°f", "f", "deg f"), "degF"),
    "command": {"amp": "A", "amps": "A", "ampere": "A", "volt": "V", "volts": "V"},
}


@dataclass(frozen=True)
class Conversion:
    """SI value = factor · value + offset, from the unit named; the SI unit where a quantity has several."""

    unit: str
    factor: float
    offset: float = 0.0
    si: str = ""

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """The values in SI."""
        return values if self.factor == 1.0 and self.offset == 0.0 else values * self.factor + self.offset


_COMMANDS = {
    unit: Conversion(unit, 1e-3 if unit.startswith("m") else 1.0, si=unit.removeprefix("m"))
    for unit in USUAL["command"]
}


@lru_cache(maxsize=256)
def conversion(role: str, written: str) -> Conversion | None:
    """How to bring a column with this unit to SI, or None if this is no unit of that quantity.

    >>> conversion("stroke", "in").factor
    0.0254
    >>> conversion("force", "lbs").unit
    'lbf'
    >>> conversion("force", "mm") is None
    True
    """
    text = written.strip()
    if not text:
        return None
    exact = {unit.lower(): unit for unit in USUAL[role]}
    if text not in USUAL[role]:
        text = _WRITTEN[role].get(text.lower()) or exact.get(text.lower()) or text
    if role == "command":
        return _COMMANDS.get(text)
    if any(text in units for units in _KNOWN.values()):
        factor = _KNOWN.get(role, {}).get(text)
        return None if factor is None else Conversion(text, factor)
    registry = _unit_registry.unit_registry()  # not within `try`: that it does not start says nothing of the text
    try:
        unit = registry.Unit(text)
        zero, one, two = (registry.Quantity(x, unit).to(SI[role]).magnitude for x in (0.0, 1.0, 2.0))
    except Exception:  # pint answers unknown text with errors of many classes, its tokeniser's among them
        return None
    if zero == 0.0:
        return Conversion(text, float(one))
    return Conversion(text, float(two - zero) / 2, float(zero))


def is_usual(written: str) -> bool:
    """Whether this text is a unit of the tables here, for which pint, which takes long to load, is not asked."""
    tables = (*USUAL.values(), *_KNOWN.values(), *_WRITTEN.values())
    return any(written in units or written.lower() in units for units in tables)


@lru_cache(maxsize=256)
def is_unit(written: str) -> bool:
    """Whether this text is a unit of any quantity that a record has, or of a sensor's signal."""
    if is_usual(written) or any(conversion(role, written) is not None for role in SI):
        return True
    return ratio(written, "V") is not None


@lru_cache(maxsize=256)
def ratio(written: str, other: str) -> float | None:
    """How many of another unit one of this unit is, or None if they measure different things.

    Arguments:
        written: this unit, such as "lbf".
        other: the other unit, such as "N".

    >>> ratio("mV", "V"), ratio("mm", "V"), ratio("digits", "digits")
    (0.001, None, 1.0)
    """
    if written.strip().lower() == other.strip().lower():
        return 1.0
    one, two = (next((units for units in _KNOWN.values() if text in units), {}) for text in (written, other))
    if one and two:
        return one[written] / two[other] if one is two else None
    return _unit_registry.ratio(written, other)


def named_conversion(role: str, written: str, where: str) -> Conversion:
    """As `conversion`, but a clear error that begins with `where` and suggests a unit."""
    known_unit = conversion(role, written)
    if known_unit is not None:
        return known_unit
    near = get_close_matches(written, [*USUAL[role], *_WRITTEN[role]], 1, cutoff=0.6) if written.strip("-–— ") else []
    hint = f"Did you mean {near[0]!r}? " if near else ""
    if ratio(written, "V") is not None or written.strip().lower() in SIGNALS:
        gain = Setting("gains", {role: f"{GAINS[role]}/{written}"})
        raise ArgumentError(
            f"{where}: {written!r} is the unit of a sensor's signal, not of {role}. Pass the gain of the sensor, for "
            f"example {gain}.",
            gain,
        )
    other = next((r for r in SI if conversion(r, written) is not None), None)
    what = f"is a unit of {other}, not of {role}" if other else f"is no known unit of {role}"
    example = near[0] if near else USUAL[role][0]
    usual = Setting("units", {role: example})
    raise ArgumentError(
        f"{where}: {written!r} {what}. {hint}Usual ones are {', '.join(USUAL[role])}: pass {usual}.", usual
    )


_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_GAIN = re.compile(rf"\s*({_NUMBER})\s*(.+?)\s*/\s*([^/\s]+)\s*(?:([+-])\s*({_NUMBER})\s*(\S.*?))?\s*")


def gain_conversion(role: str, gain: str, written: str, where: str) -> Conversion:
    """How to bring a column to SI by the gain of its sensor: quantity = gain · value + offset.

    A gain is written "500 N/V", with an offset "10 mm/V - 2.5 mm". A column without a unit has that which the gain
    divides by.

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
    return Conversion(f"{written or divisor} at {gain.strip()}", float(size) * out.factor * scale, shift, out.si)
