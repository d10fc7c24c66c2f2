"""How values are written on the command line: numbers, ranges, names with values. Needs no JAX."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from jaxdamp import _checks


def words(option: str, texts: Sequence[str]) -> list[str]:
    """Words between commas, also from several texts.

    >>> words("over", ["stroke, road", "pitch"])
    ['stroke', 'road', 'pitch']
    """
    return [word.strip() for text in texts for word in text.split(",") if word.strip()]


def pairs(option: str, texts: Sequence[str], like: str = "NAME=VALUE") -> list[tuple[str, str]]:
    """What "a=1,b=2" assigns, also from several texts; a comma inside a value stays.

    Arguments:
        option: its name, for messages.
        texts: as they were typed.
        like: how it is written, for messages.

    >>> pairs("limit", ["travel=0.1,grip=900", "comfort=1"])
    [('travel', '0.1'), ('grip', '900'), ('comfort', '1')]
    >>> pairs("columns", ["time=t,stroke=LVDT, FL"])
    [('time', 't'), ('stroke', 'LVDT, FL')]
    """
    found: list[tuple[str, str]] = []
    for part in (part.strip() for text in texts for part in re.split(r",(?=\s*[^\s,=:]+\s*=)", text)):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not name or not value:
            _checks.refuse(option, f"read like {like}", repr(part))
        if name in (known for known, _ in found):
            _checks.refuse(option, "name each thing once", f"twice {name!r}")
        found.append((name, value))
    return found


def texts(option: str, given: Sequence[str]) -> dict[str, str]:
    """Texts by name.

    >>> texts("units", ["stroke=mm,force=kN"])
    {'stroke': 'mm', 'force': 'kN'}
    """
    return dict(pairs(option, given, "stroke=..." if option in ("columns", "units", "gains") else "NAME=VALUE"))


def columns(option: str, given: Sequence[str]) -> dict[str, str | int | None]:
    """Headers or numbers of columns by quantity; "none" leaves a quantity out.

    >>> columns("columns", ["time=t_s,stroke=Displacement, in", "force=2,velocity=none"])
    {'time': 't_s', 'stroke': 'Displacement, in', 'force': 2, 'velocity': None}
    """
    return {role: None if text.lower() == "none" else column(text) for role, text in texts(option, given).items()}


def column(text: str) -> str | int:
    """The header or the number of a column."""
    return int(text) if text.isdigit() else text


def columns_in_order(option: str, given: Sequence[str]) -> list[str | int]:
    """Headers or numbers of columns, one from each text: a header may hold commas."""
    return [column(text) for text in given]


def commands(option: str, given: Sequence[str]) -> dict[str, float]:
    """What was set on the damper, by name or pattern of the records.

    >>> commands("command", ["*_0.5A=0.5,*_1A=1"])
    {'*_0.5A': 0.5, '*_1A': 1.0}
    """
    stated: dict[str, float] = {}
    for part in words(option, given):
        pattern, _, number = (piece.strip() for piece in part.rpartition("="))
        try:
            stated[pattern] = float(number)
        except ValueError:
            pattern = ""
        if not pattern:
            _checks.refuse(option, "read like '*_0.5A=0.5'", repr(part))
    return stated


def numbers(option: str, given: Sequence[str]) -> dict[str, float]:
    """Numbers by name.

    >>> numbers("noise", ["stroke=0.0002"])
    {'stroke': 0.0002}
    """
    found = {}
    for name, text in pairs(option, given):
        try:
            found[name] = float(text)
        except ValueError:
            _checks.refuse(option, "be numbers", repr(text))
    return found


def numbers_in_order(option: str, given: Sequence[str]) -> list[float]:
    """Numbers between commas.

    >>> numbers_in_order("velocities", ["0.052,0.131"])
    [0.052, 0.131]
    """
    try:
        return [float(word) for word in words(option, given)]
    except ValueError:
        _checks.refuse(option, "read like 0.052,0.131", repr(",".join(given)))


def names_or_numbers(option: str, given: Sequence[str]) -> str | list[float]:
    """One word, or numbers."""
    try:
        return [float(word) for word in words(option, given)]
    except ValueError:
        return ",".join(given)


def two(option: str, given: str) -> tuple[float, float]:
    """Two numbers, as in 2:10."""
    try:
        first, second = map(float, given.split(":"))
    except ValueError:
        _checks.refuse(option, "read like 2:10", repr(given))
    return first, second


def spans(option: str, given: Sequence[str]) -> dict[str, tuple[float | None, float | None]]:
    """Lower and upper end by name.

    >>> spans("bound", ["rate=1000:4000,mass=:50"])
    {'rate': (1000.0, 4000.0), 'mass': (None, 50.0)}
    """
    return {name: span(option, text) for name, text in pairs(option, given)}


def span(option: str, text: str) -> tuple[float | None, float | None]:
    """The ends of "0.1" (an upper one alone), "0.05:0.1" or "0.05:".

    >>> span("limit", "0.05:"), span("limit", "3")
    ((0.05, None), (None, 3.0))
    """
    ends = text.split(":")
    try:
        both = [float(end) if end.strip() else None for end in ends]
    except ValueError:
        both = []
    if len(both) not in (1, 2) or not any(number is not None for number in both):
        _checks.refuse(option, "be a number, or two as LOWER:UPPER", repr(text))
    return (None, both[0]) if len(both) == 1 else (both[0], both[1])


def limits(option: str, given: Sequence[str]) -> dict[str, Any]:
    """Largest values, ranges, or values relative to the start by metric; None is no limit.

    >>> limits("limit", ["travel=0.1,maximum_x=-0.1:0.2", "grip=+10%", "comfort=0.05:+20%"])
    {'travel': 0.1, 'maximum_x': (-0.1, 0.2), 'grip': '+10%', 'comfort': (0.05, '+20%')}
    >>> limits("limit", ["grip=none"])
    {'grip': None}
    """
    found: dict[str, Any] = {}
    for name, text in pairs(option, given):
        parts = [part.strip() for part in text.split(":")]
        if text == "none":
            found[name] = None
            continue
        if any(part.endswith("%") for part in parts) and len(parts) < 3:
            ends = [part if part.endswith("%") else span(option, part)[1] if part else None for part in parts]
            lower, upper = (None, ends[0]) if len(ends) == 1 else ends
        else:
            lower, upper = span(option, text)
        found[name] = upper if lower is None else (lower, upper)
    return found


def axes(option: str, given: Sequence[str]) -> dict[str, np.ndarray]:
    """The axes of a sweep: "damper.rate=1000:8000:15" are 15 values, "sprung_mass=1000;1200" two.

    >>> {name: values.tolist() for name, values in axes("over", ["rate=1000:2000:3", "mass=1;2"]).items()}
    {'rate': [1000.0, 1500.0, 2000.0], 'mass': [1.0, 2.0]}
    """
    found = {}
    for name, text in pairs(option, given):
        parts = text.split(":")
        try:
            if len(parts) == 3:
                found[name] = np.linspace(float(parts[0]), float(parts[1]), int(parts[2]))
            else:
                found[name] = np.array([float(number) for number in text.split(";")])
        except ValueError:
            _checks.refuse(option, "read like NAME=FIRST:LAST:COUNT or NAME=A;B;C", f"{name}={text}")
        if not found[name].size:
            _checks.refuse(option, "have one value or more on each axis", f"{name}={text}")
    return found


def named_numbers(known: Mapping[str, float | None], example: str) -> Callable[[str, Sequence[str]], list[Any]]:
    """The reader of texts such as "stroke:offset,delay=0.001".

    It gives the owner and its numbers of each text; those without a value take that of `known`.

    >>> named_numbers({"offset": 0.0, "delay": 0.0}, "")("sensor", ["stroke:offset,delay=0.001"])
    [('stroke', {'offset': 0.0, 'delay': 0.001})]
    """

    def read(option: str, given: Sequence[str]) -> list[Any]:
        return [one(option, text) for text in given]

    def one(option: str, text: str) -> tuple[str, dict[str, float]]:
        owner, _, rest = (part.strip() for part in text.partition(":"))
        if not owner or not rest:
            must = "read like NAME:NUMBER=START,NUMBER=START"
            _checks.refuse(option, must, repr(text), f"Such as {example}.")
        found: dict[str, float] = {}
        for part in rest.split(","):
            name, equals, value = (piece.strip() for piece in part.partition("="))
            _checks.one_of(option, name, known)
            try:
                number = float(value) if equals else known[name]
            except ValueError:
                number = None
            if number is None:
                _checks.refuse(option, f"give a number for {name}", repr(text), f"Such as {example}.")
            found[name] = number
        return owner, found

    return read
