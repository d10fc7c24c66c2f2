"""How values are written on the command line: numbers, ranges, names with values. Needs no JAX."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from jaxdamp import _checks


Bound = float | str | None  # of a limit: a number, or a text that is relative or has a unit; None for no end
Limit = Bound | tuple[Bound, Bound]
Named = tuple[str, dict[str, float]]  # an owner and its numbers, as in stroke:offset,delay=0.001
T = TypeVar("T")
Reader = Callable[[str, Any], object]  # gives the value of an option, from its name and its text or texts


def words(option: str, texts: Sequence[str]) -> list[str]:
    """Words between commas, also from several texts.

    >>> words("over", ["stroke, road", "pitch"])
    ['stroke', 'road', 'pitch']
    """
    return [word.strip() for text in texts for word in text.split(",") if word.strip()]


def pairs(option: str, texts: Sequence[str], like: str = "NAME=VALUE") -> list[tuple[str, str]]:
    """What "a=1,b=2" assigns, also from several texts; a comma inside a value stays.

    >>> pairs("limit", ["travel=0.1,grip=900", "comfort=1"])
    [('travel', '0.1'), ('grip', '900'), ('comfort', '1')]
    >>> pairs("columns", ["time=t,stroke=LVDT, FL"])
    [('time', 't'), ('stroke', 'LVDT, FL')]
    """
    named_texts: list[tuple[str, str]] = []
    for part in (part.strip() for text in texts for part in re.split(r",(?=\s*[^\s,=:]+\s*=)", text)):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not name or not value:
            _checks.refuse(option, f"read like {like}", repr(part))
        if name in (earlier for earlier, _ in named_texts):
            _checks.refuse(option, "name each thing once", f"twice {name!r}")
        named_texts.append((name, value))
    return named_texts


def column(text: str) -> str | int | None:
    """The header or the number of a column; "none" for no column.

    >>> column("Displacement, in"), column("2"), column("none")
    ('Displacement, in', 2, None)
    """
    return int(text) if text.isdigit() else None if text.lower() == "none" else text


def columns(option: str, given: Sequence[str]) -> list[str | int | None]:
    """Headers or numbers of columns, one from each text: a header may hold commas."""
    return [column(text) for text in given]


def named(
    value: Callable[[str], T], must: str = "be numbers", like: str = "NAME=VALUE"
) -> Callable[[str, Sequence[str]], dict[str, T]]:
    """The reader of "a=1,b=2".

    >>> named(float)("noise", ["stroke=0.0002"])
    {'stroke': 0.0002}
    """

    def read(option: str, given: Sequence[str]) -> dict[str, T]:
        values = {}
        for name, text in pairs(option, given, like):
            try:
                values[name] = value(text)
            except ValueError:
                _checks.refuse(option, must, repr(text))
        return values

    return read


def commands(option: str, given: Sequence[str]) -> float | str | dict[str, float]:
    """What was set on the damper: one number, the name of a setting, or numbers by name or pattern of the records.

    >>> commands("command", ["0.5"]), commands("command", ["current"])
    (0.5, 'current')
    >>> commands("command", ["*_0.5A=0.5,*_1A=1"])
    {'*_0.5A': 0.5, '*_1A': 1.0}
    """
    like = "0.5, '*_0.5A=0.5,*_1A=1' or the name of a setting"
    if len(given) > 1 or re.search("[=,]", given[0]):
        return named(float, f"read like {like}", like)(option, given)
    try:
        return float(given[0])
    except ValueError:
        return given[0].strip()


def numbers_in_order(option: str, given: Sequence[str]) -> list[float]:
    """Numbers between commas.

    >>> numbers_in_order("velocities", ["0.052,0.131"])
    [0.052, 0.131]
    """
    try:
        return [float(word) for word in words(option, given)]
    except ValueError:
        _checks.refuse(option, "read like 0.052,0.131", repr(",".join(given)))


def part(option: str, given: str) -> str:
    """A part of so many, such as 17/200."""
    _checks.part_of(option, given)
    return given


def names_or_numbers(option: str, given: Sequence[str]) -> str | list[float]:
    """One word, or numbers."""
    try:
        return numbers_in_order(option, given)
    except ValueError:
        return ",".join(given)


def two(option: str, given: str) -> tuple[float, float]:
    """Two numbers, as in 2:10."""
    try:
        first, second = map(float, given.split(":"))
    except ValueError:
        _checks.refuse(option, "read like 2:10", repr(given))
    return first, second


def span(text: str) -> tuple[float | None, float | None]:
    """The ends of "0.1" (an upper one alone), "0.05:0.1" or "0.05:".

    >>> span("0.05:"), span("3")
    ((0.05, None), (None, 3.0))
    """
    ends = [float(end) if end.strip() else None for end in text.split(":")]
    if len(ends) > 2 or ends in ([None], [None, None]):
        raise ValueError(text)
    return (None, ends[0]) if len(ends) == 1 else (ends[0], ends[1])


_QUANTITY = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-zµ].*)")


def quantity(text: str) -> tuple[float, str] | None:
    """The number and the unit of a text; None where it has no unit.

    >>> quantity("500 lbf"), quantity("1e3"), quantity("2e-3"), quantity("+10%")
    ((500.0, 'lbf'), None, None, None)
    """
    match = _QUANTITY.fullmatch(text)
    if match is None or re.fullmatch(r"[eE][+-]?\d+", match[2]):  # 1e3 is a number
        return None
    return float(match[1]), match[2]


def limit(text: str) -> Limit:
    """A largest value, a range, or either relative to the start or in a unit of its own; None is no limit.

    >>> limit("0.1"), limit("-0.1:0.2"), limit("+10%"), limit("0.05:+20%"), limit("none"), limit("4in")
    (0.1, (-0.1, 0.2), '+10%', (0.05, '+20%'), None, '4in')
    """
    if text == "none":
        return None
    parts = [part.strip() for part in text.split(":")]
    with_unit = [quantity(part) is not None for part in parts]
    if not any(with_unit) and not any(part.endswith("%") for part in parts):
        lower, upper = span(text)
    else:
        ends = [_end(part, unit) for part, unit in zip(parts, with_unit, strict=True)]
        if len(ends) > 2 or (any(with_unit) and any(isinstance(end, float) for end in ends)):
            raise ValueError(text)  # of 2:4in both may be meant in inches
        lower, upper = (None, ends[0]) if len(ends) == 1 else ends
    return upper if lower is None else (lower, upper)


def bound(text: str) -> tuple[Bound, Bound]:
    """A range of a parameter, each end with its unit or both in SI.

    >>> bound("1000:4000"), bound("5 lbf s/in:25 lbf s/in"), bound("3")
    ((1000.0, 4000.0), ('5 lbf s/in', '25 lbf s/in'), (None, 3.0))
    """
    ends = limit(text)
    if ends is None or "%" in text:
        raise ValueError(text)
    return ends if isinstance(ends, tuple) else (None, ends)


def _end(text: str, with_unit: bool) -> Bound:
    """One end of a limit: a number, or a text that is relative or has a unit; None for no end."""
    return text if with_unit or text.endswith("%") else float(text) if text else None


class Axis(NamedTuple):
    """The values of an axis of a sweep, in their unit; in SI where it is empty."""

    values: np.ndarray
    unit: str


def axis(text: str) -> Axis:
    """The values of an axis: "1000:8000:15" are 15 of them, "1000;1200" two, each with its unit or all in SI.

    >>> axis("1000:2000:3").values.tolist(), axis("5 lbf s/in;9 lbf s/in")
    ([1000.0, 1500.0, 2000.0], Axis(values=array([5., 9.]), unit='lbf s/in'))
    """
    first, *more = text.split(":")
    count = int(more.pop()) if more else None
    ends = text.split(";") if count is None else [first, *more]
    numbers, units = zip(*(quantity(end.strip()) or (float(end), "") for end in ends), strict=True)
    if len(set(units)) > 1 or (count is not None and len(numbers) != 2):
        raise ValueError(text)
    return Axis(np.array(numbers) if count is None else np.linspace(numbers[0], numbers[1], count), units[0])


def axes(option: str, given: Sequence[str]) -> dict[str, Axis]:
    """The axes of a sweep by parameter, each of one value or more."""
    must = "read like NAME=FIRST:LAST:COUNT or NAME=A;B;C, each with its unit or all in SI"
    grid = named(axis, must)(option, given)
    for name, (values, _) in grid.items():
        if not values.size:
            _checks.refuse(option, "have one value or more on each axis", name)
    return grid


def named_numbers(defaults: Mapping[str, float | None], example: str) -> Callable[[str, Sequence[str]], list[Named]]:
    """The reader of texts such as "stroke:offset,delay=0.001".

    It gives the owner and its numbers of each text; those without a value take that of `known`.

    >>> named_numbers({"offset": 0.0, "delay": 0.0}, "")("sensor", ["stroke:offset,delay=0.001"])
    [('stroke', {'offset': 0.0, 'delay': 0.001})]
    """

    def read(option: str, given: Sequence[str]) -> list[Named]:
        return [one(option, text) for text in given]

    def one(option: str, text: str) -> Named:
        owner, _, stated = (part.strip() for part in text.partition(":"))
        if not owner or not stated:
            must = "read like NAME:NUMBER=START,NUMBER=START"
            _checks.refuse(option, must, repr(text), f"Such as {example}.")
        numbers: dict[str, float] = {}
        for part in stated.split(","):
            name, equals, value = (piece.strip() for piece in part.partition("="))
            _checks.one_of(option, name, defaults)
            try:
                number = float(value) if equals else defaults[name]
            except ValueError:
                number = None
            if number is None:
                _checks.refuse(option, f"give a number for {name}", repr(text), f"Such as {example}.")
            numbers[name] = number
        return owner, numbers

    return read
