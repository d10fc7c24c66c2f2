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
