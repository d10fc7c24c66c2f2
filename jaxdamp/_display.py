"""Units, sign and words in which results are shown: tables, pictures and CSV ask here; computing and JSON stay in SI.

Forces, velocities and strokes have the sign of the library everywhere else: positive in extension (rebound).
"""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from jaxdamp import _checks


Number = TypeVar("Number", float, np.ndarray)
REBOUND, COMPRESSION = "rebound-positive", "compression-positive"
_SI = {
    "lbf": 4.4482216152605,
    "kgf": 9.80665,
    "N": 1.0,
    "in": 0.0254,
    "mm": 1e-3,
    "m": 1.0,
    "lb": 0.45359237,
    "kg": 1.0,
}
_KINDS = {"lbf": "N", "kgf": "N", "N": "N", "in": "m", "mm": "m", "m": "m", "lb": "kg", "kg": "kg"}
SYSTEMS = {"SI": {}, "metric": {"N": "N", "m": "mm"}, "imperial": {"N": "lbf", "m": "in", "kg": "lb"}}
UNITS = {
    "N": ("N", "N"),
    "kgf": ("N", "kgf"),
    "lbf": ("N", "lbf"),
    "m/s": ("m", "m"),
    "mm/s": ("m", "mm"),
    "in/s": ("m", "in"),
}
_FACTOR = re.compile(r"(lbf|kgf|kN|N|mm|in|m|kg|lb|s)(?:\^(-?[\d.]+))?")
_KEPT = re.compile(r"m/s(\^|²|\^2)|^m\^?[23²³]|m/km|cycle")  # accelerations, areas, road roughness: SI for everybody
_EXPONENT = re.compile(r"(?<![\w.])\d(?:\.\d+)?e\+0[1-5]\b")  # two or three digits of a large number: 1.1e+03 is 1100
_NUMBER = r"[-−+]?(?:\d+(?:\.\d+)?(?:e[-+]?\d+)?|inf)"
_AMOUNT = re.compile(
    rf"(?<![\w.])((?:{_NUMBER}, )*)({_NUMBER})(?:( to | … | ± )({_NUMBER}))?([ \xa0])"
    r"(N s/m|N/mm|N/m|mm/s|m/s|mm|kN|kg|N|m|J)(?![\w²³^/·]| [ms]\b)"
)
_READ = {"m": (1e3, "mm"), "N/m": (1e-3, "N/mm")}  # strokes and rates of springs
_SIGNED = re.compile(
    r"(mid-stroke |stated )?(rebound |compression |mean |static |gas |least |largest )?(force|velocity|stroke)( at .*)?"
    r"|(\w+_)?working_space_mean|(\w+ )*suspension travel, mean( \[.*)?"
)
_ENDS = (("lowest", "highest"), ("fitted from", "fitted to"), ("least force", "largest force"), ("from", "to"))
_ENDS += (("minimum", "maximum"),)
_PHRASES = {  # of the library's sign, and of the other
    "+ rebound, − compression": "+ compression, − rebound",
    "+ rebound": "+ compression",
    "rebound positive": "compression positive",
    "+ resists extension": "+ resists compression",
    "positive where it resists extension": "positive where it resists compression",
    "extension positive": "compression positive",
    "positive in rebound": "positive in compression",
    "positive in extension (rebound)": "positive in compression",
    "positive when it resists extension": "positive when it resists compression",
}
_SIGN_WORDS = re.compile("|".join(map(re.escape, _PHRASES)))


class Shown(NamedTuple):
    """How numbers of one unit are shown."""

    unit: str  # that is printed
    factor: float  # number printed = factor · number; negative where the sign is the other one

    def __call__(self, values: Number) -> Number:
        """The numbers that are printed."""
        return values if self.factor == 1.0 else values * self.factor


_WORK = Shown("in lbf", 1.0 / (_SI["in"] * _SI["lbf"]))  # the area of a loop as a shop draws it


@dataclass(frozen=True)
class Display:
    """Units, sign and words of what is shown.

    Arguments:
        units: "SI" (as the library computes), "metric" (N, mm, mm/s), "imperial" (lbf, in, in/s, lb), or a force and a
            velocity such as "kgf,mm/s".
        sign: "rebound-positive" or "compression-positive": the direction in which strokes, velocities and the forces
            that resist them are positive.
        wording: a sentence in the reader's words, such as with options of a command instead of arguments.

    Raises:
        ValueError: another word.

    >>> shop = Display("imperial", "compression-positive")
    >>> shop.of("N s/m").unit, round(shop.of("N", signed=True)(-444.822), 2)
    ('lbf s/in', 100.0)
    >>> shop.text("velocity [m/s]   (+ rebound)"), Display("kgf,mm/s").words("at -0.5 to 0.5 m/s: 98.1 N")
    ('velocity [in/s]   (+ compression)', 'at -500 to 500 mm/s: 10 kgf')
    """

    units: str = "SI"
    sign: str = REBOUND
    wording: Callable[[str], str] = str

    def __post_init__(self) -> None:
        _checks.one_of("sign", self.sign, (REBOUND, COMPRESSION))
        for word in () if self.units in SYSTEMS else self.units.split(","):
            _checks.one_of("units", word.strip(), (*SYSTEMS, *UNITS))

    @property
    def plain(self) -> bool:
        """Whether all numbers are shown as the library computes them."""
        return not self._system and self.sign == REBOUND

    @property
    def described(self) -> str:
        """The units and the sign in words; empty for those of the library."""
        parts = [f"units {self.units}"] * bool(self._system)
        parts += ["compression positive"] * (self.sign == COMPRESSION)
        if self.plain:
            return ""
        exceptions = "; sentences, JSON files and parameters of formulas count rebound positive"
        return f"Shown in {', '.join(parts)}{exceptions * (self.sign == COMPRESSION)}."

    @property
    def _system(self) -> dict[str, str]:
        if self.units in SYSTEMS:
            return SYSTEMS[self.units]
        return dict(UNITS[word.strip()] for word in self.units.split(","))

    def of(self, unit: str, *, signed: bool = False) -> Shown:
        """How numbers of a unit are shown.

        Arguments:
            unit: in which the numbers are, such as "N s/m" or "mm".
            signed: whether their sign is that of the direction: forces, velocities and strokes.
        """
        system = self._system
        work = unit == "J" and (system.get("N"), system.get("m")) == ("lbf", "in")
        shown = _WORK if work else _converted(unit, tuple(sorted(system.items())))
        return shown._replace(factor=-shown.factor) if signed and self.sign == COMPRESSION else shown

    def read(self, unit: str, *, signed: bool = False) -> Shown:
        """How numbers of a unit are shown where people read them: as `of`, but mm in place of m and N/mm of N/m.

        Arguments:
            unit: as in `of`.
            signed: as in `of`.

        >>> Display().read("m"), Display("imperial").read("m").unit
        (Shown(unit='mm', factor=1000.0), 'in')
        """
        factor, unit = _READ.get(unit, (1.0, unit))
        shown = self.of(unit, signed=signed)
        return shown._replace(factor=factor * shown.factor)

    def signed(self, quantity: str) -> bool:
        """Whether the sign of a quantity is that of the direction, by its name or its label.

        Such as "rebound force at 0.1 m/s", or "stroke [mm] (+ rebound)".
        """
        return bool(_SIGNED.fullmatch(quantity) or _SIGN_WORDS.search(quantity))

    def turned(self, names: tuple[str, ...]) -> list[int]:
        """The order in which columns of lowest and highest values are shown, by their names."""
        order = list(range(len(names)))
        for low, high in _ENDS if self.sign == COMPRESSION else ():
            if low in names and high in names:
                first, second = names.index(low), names.index(high)
                order[first], order[second] = second, first
        return order

    def speed(self, value: float) -> str:
        """The speed of a vehicle [m/s] in words: in miles an hour where lengths are in inches."""
        return f"{value / 0.44704:.3g} mph" if self._system.get("m") == "in" else f"{value:.4g} m/s"

    def text(self, label: str, *, read: bool = False) -> str:
        """The label of an axis or a table, with the unit in brackets and the words on the sign that are shown.

        Arguments:
            label: with the unit of the library.
            read: whether the numbers beside it are those of `read`.
        """
        shown = self.read if read else self.of
        return self._turned(re.sub(r"\[([^\[\]]+)\]", lambda match: f"[{shown(match[1]).unit}]", label))

    def words(self, sentence: str) -> str:
        """A sentence in the reader's words, with forces, velocities and lengths in the units that are shown."""
        said = _plain(self.wording(sentence))
        return self._turned(_AMOUNT.sub(self._amount, said) if self._system else said)

    def _turned(self, text: str) -> str:
        return _SIGN_WORDS.sub(lambda match: _PHRASES[match[0]], text) if self.sign == COMPRESSION else text

    def _amount(self, match: re.Match[str]) -> str:
        """Numbers with their unit as they are shown; a value beside its error has the digits that the error leaves."""
        before, *pair, blank, unit = match.groups()
        shown, sign = self.of(unit), pair[1]

        def one(text: str) -> str:
            return _plain(f"{shown(float(text.replace('−', '-'))):.{_figures(text)}g}")

        if sign == " ± ":
            said = _plain(plus_minus(*(shown(float(text.replace("−", "-"))) for text in (pair[0], pair[2]))))
        else:
            said = (sign or "").join(one(text) for text in (pair[0], pair[2]) if text)
        others = "".join(f"{one(text)}, " for text in before.split(", ")[:-1])
        return f"{others}{said}{blank}{shown.unit}"


def _plain(text: str) -> str:
    """A text with large numbers of a few digits written out: 1100 for 1.1e+03."""
    return _EXPONENT.sub(lambda match: f"{float(match[0]):.12g}", text)


def _figures(text: str) -> int:
    """Significant figures of a number as it is written, three at the least."""
    return max(3, len(re.sub(r"^[-−+]?0*\.?0*|\.|e.*", "", text)))


_ROUNDING = 1e-13  # relative: that of sums in double precision
_FIGURES = 9  # of a value, at the most: a smaller error is said by its power of ten


def rounded(value: float, error: float) -> tuple[str, str]:
    """A value and its standard error as text, with the significant digits.

    The error has two digits, the value the digits down to the second digit of the error, but one at the least and nine
    at the most. Errors of the size of rounding, such as the scatter of equal numbers, are zero.

    Arguments:
        value: the number.
        error: its standard error, in the same unit.

    >>> rounded(14361.27, 61.8), rounded(0.9035, 0.2912), rounded(3.2, float("inf"))
    (('14361', '62'), ('0.90', '0.29'), ('3.2', 'inf'))
    >>> rounded(0.0624512, 7e-18), rounded(2500.0, 1.3e-6)
    (('0.062451', '0'), ('2500', '1.3e-06'))
    """
    if error <= _ROUNDING * abs(value):
        error = 0.0
    if not (np.isfinite(error) and np.isfinite(value) and error > 0):
        return f"{value:.5g}", f"{error:.2g}"
    if error < 10.0**-_FIGURES * abs(value):
        return f"{value:.{_FIGURES}g}", f"{error:.2g}"
    place = int(np.floor(np.log10(error))) - 1
    place_of_value = min(place, int(np.floor(np.log10(abs(value))))) if value else place
    if max(abs(value), error) >= 1e9 or place_of_value < -9:
        return f"{value:.3e}", f"{error:.1e}"
    texts = (f"{round(number, -at):.{max(-at, 0)}f}" for number, at in ((value, place_of_value), (error, place)))
    return next(texts), next(texts)


def plus_minus(value: float, error: float) -> str:
    """A value with its error, each with the digits that mean something.

    >>> plus_minus(827.3, 551.0), plus_minus(0.131, 0.00042)
    ('830 ± 550', '0.13100 ± 0.00042')
    """
    return " ± ".join(rounded(value, error))


@lru_cache(maxsize=256)
def _converted(unit: str, system: tuple[tuple[str, str], ...]) -> Shown:
    """A unit with the units of a system in the place of those that it is made of."""
    wanted, factor = dict(system), 1.0
    if not wanted or not unit or _KEPT.search(unit):
        return Shown(unit, 1.0)
    pieces: list[list[str]] = []
    for side, text in enumerate(unit.split("/")):
        words = []
        for word in text.split():
            match = _FACTOR.fullmatch(word.strip("()"))
            if side > 1 or match is None:
                return Shown(unit, 1.0)
            base = "N" if match[1] == "kN" else match[1]
            target = wanted.get(_KINDS.get(base, ""), base)
            scale = _SI.get(base, 1.0) / _SI.get(target, 1.0) * (1e3 if match[1] == "kN" and target != "N" else 1.0)
            name = match[1] if target == base else target
            factor *= scale ** (float(match[2] or 1) * (1 - 2 * side))
            words.append(word.replace(match[1], name, 1))
        pieces.append(words)
    return Shown("/".join(" ".join(words) for words in pieces), factor)


_present: ContextVar[Display] = ContextVar("display", default=Display())  # noqa: B039 - it cannot be changed


def display() -> Display:
    """The units and the sign in force."""
    return _present.get()


@contextmanager
def shown_in(chosen: Display) -> Iterator[None]:
    """Tables, pictures and CSV made inside are in these units and this sign."""
    token = _present.set(chosen)
    try:
        yield
    finally:
        _present.reset(token)
