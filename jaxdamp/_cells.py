"""Cells and columns of tables: numbers as a reader is shown them, with units."""

import math
import re
from collections.abc import Callable
from decimal import Decimal
from typing import NamedTuple, TypeAlias

import numpy as np

from jaxdamp._display import Shown as ShownUnit, display, plus_minus


Cell = str | float | int | None
Units: TypeAlias = Callable[..., ShownUnit]  # `Display.of` or `Display.read`


class Shown(float):
    """A number with the text that a reader is shown; files keep all its digits.

    >>> number = Shown(14361.2734, "14361")
    >>> f"{number:.4g}", str(number)
    ('14361', '14361.2734')
    """

    text: str

    def __new__(cls, value: float, text: str) -> "Shown":
        """The number, and its text."""
        self = super().__new__(cls, value)
        self.text = text
        return self

    def __reduce__(self) -> tuple[type["Shown"], tuple[float, str]]:
        return Shown, (float(self), self.text)  # of a copy

    def __format__(self, spec: str) -> str:
        return self.text


class Column(NamedTuple):
    """A column: its name, its unit, and how a number in it is written for reading.

    Attributes:
        name: of the column.
        unit: as it is printed; empty for none.
        spec: format of a number in it, such as ".3g".
    """

    name: str
    unit: str = ""
    spec: str = ".4g"

    @property
    def heading(self) -> str:
        """Name with unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def text(self, cell: Cell) -> str:
        """A cell for reading; nothing where there is no value."""
        if cell is None:
            return ""
        return display().words(cell) if isinstance(cell, str) else _written(cell, self.spec)


def _written(number: float, spec: str) -> str:
    """A number in a format, but without a power of ten from 0.001 to 99 999, and without a sign of zero.

    >>> [_written(number, ".4g") for number in (11187.4, -1032.4, 0.00123, 8.818e-05, -0.0)] + [_written(-0.04, ".1f")]
    ['11187', '-1032', '0.00123', '8.818e-05', '0', '0.0']
    """
    text = format(number, spec)
    if "e" in text and not isinstance(number, Shown | int) and 1e-3 <= abs(number) < 1e5:
        text = f"{number:.0f}" if abs(number) >= 1e3 else np.format_float_positional(float(text), trim="-")
    return text[1:] if re.fullmatch(r"[-+]0(\.0*)?", text) else text


_COUNTS = ("count", "cycles", "wheels", "ratio", "times", "(value − true)/se")  # columns whose numbers have no unit
_SPREADS = ("scatter", "uncertainty", "standard error", "change")  # and those without a sign
QUANTITIES = ("quantity", "metric", "finding")  # columns that say what the numbers of a row are
_BAND = ("from", "to")  # of a force; times and distances have no direction


def is_along_a_road(column: Column) -> bool:
    """Whether a column has distances along a road, which are in m for everybody."""
    return column.unit == "m" and column.name in (*_BAND, "wavelength")


def factor_of(shown: Units, column: Column, unit: str, quantity: str) -> float:
    """What a number is shown times, of a row with this unit and quantity, if it states them."""
    unit_of_column = column.unit or ("" if column.name in _COUNTS else unit)
    if unit_of_column in ("", "–", "%") or is_along_a_road(column):
        return 1.0
    signed = display().signed(column.name if column.unit else quantity) and column.name not in _SPREADS
    signed |= column.unit == "N" and column.name in _BAND
    signed &= not (quantity and column.name == "velocity")  # it is positive, the direction is in the quantity
    return shown(unit_of_column.replace("²", "^2"), signed=signed).factor


def unit_shown(shown: Units, unit: str) -> str:
    """A unit as it is printed, in that which is shown."""
    return typeset_unit(shown(unit.replace("²", "^2")).unit, "")


def scaled(cell: Cell, factor: float) -> Cell:
    """A number of a table times a factor; the text of a `Shown` keeps what its digits say.

    >>> f"{scaled(Shown(1498909.0, '1498900'), 1e-3)}", f"{scaled(Shown(0.00104, '0.0010'), 1e3)}"
    ('1498.9', '1.0')
    """
    if factor == 1.0 or not isinstance(cell, float):
        return cell
    value = cell * factor + 0.0
    if not isinstance(cell, Shown):
        return value
    _, sign, error = cell.text.partition(" ± ")
    if sign:
        return Shown(value, plus_minus(value, float(error) * abs(factor)))
    if not np.isfinite(value):
        return Shown(value, cell.text)
    power = round(math.log10(abs(factor)))
    if math.isclose(abs(factor), 10.0**power):
        digits = Decimal(cell.text) if "." in cell.text else Decimal(cell.text).normalize()
        return Shown(value, format(digits.scaleb(power).copy_sign(Decimal(value)), "f"))
    figures = max(3, len(re.sub(r"^-?0*\.?0*|\.|e.*", "", cell.text)))
    return Shown(value, f"{value:.{figures}g}")


def typeset_unit(unit: str, none: str = "") -> str:
    """A unit as it is printed: "m/s²" for "m/s^2", and `none` where there is no unit."""
    return unit.replace("^2", "²") or none
