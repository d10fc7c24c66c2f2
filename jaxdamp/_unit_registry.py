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
    """How many of another unit one of this unit is, or None if they measure different things or are none.

    >>> ratio("mile", "m"), ratio("kg", "m")
    (1609.344, None)
    """
    registry = unit_registry()  # not within `try`: that it does not start says nothing of the text
    try:
        return float(registry.Quantity(1.0, written.strip()).to(other.strip()).magnitude)
    except Exception:  # pint answers unknown text with errors of many classes, its tokeniser's among them
        return None
