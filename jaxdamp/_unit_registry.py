"""The units that pint knows, read once: that takes half a second."""

from functools import cache
from typing import TYPE_CHECKING


if TYPE_CHECKING:
    import pint


@cache
def unit_registry() -> "pint.UnitRegistry":
    """Units by name; a temperature in °C is brought to K."""
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


def ratio(written: str, other: str) -> float | None:
    """How many of another unit one of this unit is; None if there is no such number.

    That is so of units of different things, of what is no unit, and of scales with different zeros.

    >>> ratio("mile", "m"), ratio("kg", "m"), ratio("degC", "K")
    (1609.344, None, None)
    """
    registry = unit_registry()  # not within `try`: that it does not start says nothing of the text
    try:
        zero, one = (float(registry.Quantity(x, written.strip()).to(other.strip()).magnitude) for x in (0.0, 1.0))
    except Exception:  # pint answers unknown text with errors of many classes, its tokeniser's among them
        return None
    return one if zero == 0.0 else None
