"""The range of the records that a law was fitted to, stored in the law."""

from typing import Any, NamedTuple, TypeVar, final

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks


UNITS = {"velocity": "m/s", "stroke": "m", "frequency": "Hz", "force": "N", "temperature": "K", "command": ""}
Limits = tuple[float | int, float | int]
Tree = TypeVar("Tree")


class OutsideFittedRangeWarning(UserWarning):
    """A law is used outside the range of the records that it was fitted to: its force is extrapolated."""


class Quantity(NamedTuple):
    """One quantity of a fitted range: its name, lowest and highest value, and unit."""

    name: str
    limits: tuple[float, float]
    unit: str


@final
class FittedRange(eqx.Module):
    """Lowest and highest value of each quantity in the records that a law was fitted to.

    Outside these limits the law is an extrapolation, which no record confirms. A quantity that the records do not
    contain is `None`. The limits are data of the law, not parameters: fits, tunings and gradients do not change them.

    Arguments:
        velocity: velocity [m/s], positive in extension.
        stroke: stroke [m], positive in extension, measured from the zero of the records.
        frequency: dominant frequency of the records [Hz].
        force: force [N], positive when it resists extension.
        temperature: oil temperature [K].
        command: coil current, voltage, clicks, in the unit of the law's command.

    Raises:
        ValueError: limits that are not two finite numbers in order.

    >>> from jaxdamp.dampers import FittedRange
    >>> FittedRange(velocity=(-0.5, 0.9), command=(0.0, 2.0))
    FittedRange(velocity=(-0.5, 0.9), command=(0.0, 2.0))
    """

    # One array, with infinite limits for unknown quantities: laws that differ only in their range have the same
    # structure and share compiled programs. A NumPy array is in double precision, whatever the precision of JAX.
    limits: Float[np.ndarray, "6 2"] | Float[Array, "6 2"]

    def __init__(
        self,
        *,
        velocity: Limits | None = None,
        stroke: Limits | None = None,
        frequency: Limits | None = None,
        force: Limits | None = None,
        temperature: Limits | None = None,
        command: Limits | None = None,
    ) -> None:
        given = dict(zip(UNITS, (velocity, stroke, frequency, force, temperature, command), strict=True))
        self.limits = np.array([_checked(name, limits) for name, limits in given.items()])

    def _of(self, name: str) -> tuple[float, float] | None:
        known = _checks.concrete(self.limits)
        if known is None or not np.all(np.isfinite(row := known[list(UNITS).index(name)])):
            return None
        return float(row[0]), float(row[1])

    @property
    def velocity(self) -> tuple[float, float] | None:
        """Velocities [m/s]."""
        return self._of("velocity")

    @property
    def stroke(self) -> tuple[float, float] | None:
        """Strokes [m]."""
        return self._of("stroke")

    @property
    def frequency(self) -> tuple[float, float] | None:
        """Dominant frequencies of the records [Hz]."""
        return self._of("frequency")

    @property
    def force(self) -> tuple[float, float] | None:
        """Forces [N]."""
        return self._of("force")

    @property
    def temperature(self) -> tuple[float, float] | None:
        """Temperatures [K]."""
        return self._of("temperature")

    @property
    def command(self) -> tuple[float, float] | None:
        """Commands, in the unit of the law's command."""
        return self._of("command")

    def known(self) -> list[Quantity]:
        """The quantities that the records contain (none while JAX traces the law)."""
        quantities = ((name, self._of(name), unit) for name, unit in UNITS.items())
        return [Quantity(name, limits, unit) for name, limits, unit in quantities if limits is not None]

    def without(self, *names: str) -> "FittedRange":
        """The same range without some quantities."""
        return FittedRange(
            **{quantity.name: quantity.limits for quantity in self.known() if quantity.name not in names}
        )

    def words(self) -> str:
        """The range in words: "velocity −0.5 to 0.9 m/s, stroke −20 to 20 mm"."""
        return ", ".join(f"{q.name} {span(q.name, q.limits)}" for q in self.known())

    def __repr__(self) -> str:
        return f"FittedRange({', '.join(f'{q.name}={q.limits}' for q in self.known())})"


def span(name: str, limits: Limits) -> str:
    """Two limits with their unit, strokes in millimetres and temperatures in °C: "−20 to 20 mm"."""
    low, high = shown(name, limits[0]), shown(name, limits[1])
    return f"{low} to {high} {shown_unit(name)}".rstrip()


def shown(name: str, value: float | int) -> str:
    """A value for display, with three figures (whole numbers for thousands)."""
    value = 1e3 * value if name == "stroke" else value - 273.15 if name == "temperature" else value
    return (f"{value:.0f}" if abs(value) >= 1e3 else f"{value:.3g}").replace("-", "−")


def shown_unit(name: str) -> str:
    """The unit for `shown`."""
    return {"stroke": "mm", "temperature": "°C"}.get(name, UNITS[name])


def _checked(name: str, limits: Limits | None) -> tuple[float, float]:
    if limits is None:
        return -np.inf, np.inf
    _checks.untraced(name, limits, "A range is what records covered: give plain numbers.")
    numbers = np.asarray(limits, dtype=float)
    if numbers.shape != (2,) or not np.all(np.isfinite(numbers)) or numbers[0] > numbers[1]:
        unit = f" [{UNITS[name]}]" if UNITS[name] else ""
        must = f"be the lowest and the highest value{unit}, two finite numbers in order"
        _checks.refuse(name, must, limits, "Leave out what is not known.")
    return float(numbers[0]), float(numbers[1])


def without_fitted_ranges(tree: Tree) -> Tree:
    """A law, a vehicle or any tree without the ranges of its laws.

    Compiled code uses laws without them, so that laws fitted to different records share one program.

    Arguments:
        tree: the tree.
    """
    return jax.tree.map(lambda leaf: None if isinstance(leaf, FittedRange) else leaf, tree, is_leaf=_is_range)


def has_fitted_range(tree: Any) -> bool:
    """Whether any law in a tree has a fitted range.

    Arguments:
        tree: a law, a vehicle or another module.
    """
    return any(map(_is_range, jax.tree.leaves(tree, is_leaf=_is_range)))


def _is_range(node: Any) -> bool:
    return isinstance(node, FittedRange)
