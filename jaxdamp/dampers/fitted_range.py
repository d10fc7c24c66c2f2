"""The range of the records that a law was fitted to, stored in the law, and the motion compared with it."""

import dataclasses
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar, final

import jax
import numpy as np
from jax.extend.core import unsafe_am_i_under_a_jit_DO_NOT_USE  # pyright: ignore[reportPrivateImportUsage]
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._types import ScalarLike


UNITS = {"velocity": "m/s", "stroke": "m", "frequency": "Hz", "force": "N", "temperature": "K", "command": ""}
Limits = tuple[float | int, float | int]


class StandardError(NamedTuple):
    """How well a fit determined one number of a law.

    Attributes:
        name: of the number, as in the table of the fit.
        value: the standard error, in the unit; infinite if no record determines the number.
        unit: in SI.
        identified: whether the records tell this number from the others.
    """

    name: str
    value: float
    unit: str
    identified: bool


Tree = TypeVar("Tree")


class OutsideFittedRangeWarning(UserWarning):
    """A law is used outside the range of the records that it was fitted to: its force is extrapolated."""


class Quantity(NamedTuple):
    """One quantity of a fitted range: its name, lowest and highest value, and unit."""

    name: str
    limits: tuple[float, float]
    unit: str


@final
@dataclass(frozen=True, kw_only=True)
class FittedRange:
    """Lowest and highest value of each quantity in the records that a law was fitted to.

    Outside these limits the law is an extrapolation, which no record confirms. A quantity that the records do not
    contain is `None`. The limits describe a law; they are no parameters and no arrays of it.

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

    velocity: Limits | None = None
    stroke: Limits | None = None
    frequency: Limits | None = None
    force: Limits | None = None
    temperature: Limits | None = None
    command: Limits | None = None

    def __post_init__(self) -> None:
        for name in UNITS:
            object.__setattr__(self, name, _checked(name, getattr(self, name)))

    def known(self) -> list[Quantity]:
        """The quantities that the records contain."""
        quantities = ((name, getattr(self, name), unit) for name, unit in UNITS.items())
        return [Quantity(name, limits, unit) for name, limits, unit in quantities if limits is not None]

    def without(self, *names: str) -> "FittedRange":
        """The same range without some quantities."""
        return replace(self, **dict.fromkeys(names))

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


def _checked(name: str, limits: Limits | None) -> tuple[float, float] | None:
    if limits is None:
        return None
    _checks.untraced(name, limits, "A range is what records covered: give plain numbers.")
    numbers = np.asarray(limits, dtype=float)
    if numbers.shape != (2,) or not np.all(np.isfinite(numbers)) or numbers[0] > numbers[1]:
        unit = f" [{UNITS[name]}]" if UNITS[name] else ""
        must = f"be the lowest and the highest value{unit}, two finite numbers in order"
        _checks.refuse(name, must, limits, "Leave out what is not known.")
    return float(numbers[0]), float(numbers[1])


@final
@dataclass(frozen=True)
class RangeNote:
    """The fitted range as part of a law, or that there is none: a pytree without leaves, equal to any other.

    So laws with any range and without one have one structure, share compiled programs and can be mapped together.

    JAX stores the structure of what a compiled function returns, and returns it from later calls with other laws. A
    structure that arises in such a trace therefore has no range: results of `jit` have none, rather than that of the
    law of the first call.

    Arguments:
        fitted_to: the range, if any.
        standard_errors: of the numbers that the records gave.
    """

    fitted_to: FittedRange | None = None
    standard_errors: tuple[StandardError, ...] = ()


class _Unseen:
    """A note in a structure, which compares and hashes like any other."""

    def __init__(self, note: RangeNote) -> None:
        self.note = note

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Unseen)

    def __hash__(self) -> int:
        return hash(_Unseen)

    def __repr__(self) -> str:
        return ""


def _noted(note: RangeNote) -> RangeNote:
    """The note, without a range in a program that JAX compiles."""
    filled = note.fitted_to is not None or note.standard_errors
    return RangeNote() if filled and unsafe_am_i_under_a_jit_DO_NOT_USE() else note


jax.tree_util.register_pytree_node(
    RangeNote, lambda note: ((), _Unseen(_noted(note))), lambda unseen, _: _noted(unseen.note)
)


def without_fitted_ranges(tree: Tree) -> Tree:
    """A law, a vehicle or any tree without the ranges of its laws, as for a law that is mixed from several.

    Arguments:
        tree: the tree.
    """
    return jax.tree.map(lambda leaf: RangeNote() if _is_note(leaf) else leaf, tree, is_leaf=_is_note)


def without_standard_errors(tree: Tree) -> Tree:
    """A law, a vehicle or any tree without the standard errors of the fits of its laws.

    Arguments:
        tree: the tree.
    """
    return jax.tree.map(lambda leaf: RangeNote(leaf.fitted_to) if _is_note(leaf) else leaf, tree, is_leaf=_is_note)


def has_standard_errors(tree: object) -> bool:
    """Whether any law in a tree has the standard errors of its fit.

    Arguments:
        tree: a law, a vehicle or another module.
    """
    return any(_is_note(note) and note.standard_errors for note in jax.tree.leaves(tree, is_leaf=_is_note))


def has_fitted_range(tree: object) -> bool:
    """Whether any law in a tree has a fitted range.

    Arguments:
        tree: a law, a vehicle or another module.
    """
    notes = filter(_is_note, jax.tree.leaves(tree, is_leaf=_is_note))
    return any(note.fitted_to is not None for note in notes)


def _is_note(node: object) -> bool:
    return isinstance(node, RangeNote)


Samples = Float[np.ndarray, " samples"]


@final
@dataclasses.dataclass(frozen=True)
class Motion:
    """Stroke, velocity and force of a law at uniformly spaced times; `None` for unknown channels.

    Arguments:
        stroke: [m], positive in extension, shape (samples,).
        velocity: [m/s], shape (samples,).
        force: [N], positive when it resists extension, shape (samples,).
        temperature: of the oil [K].
    """

    stroke: Samples | None = None
    velocity: Samples | None = None
    force: Samples | None = None
    temperature: float | None = None

    def moved(self, ratio: ScalarLike) -> "Motion":
        """Stroke and velocity times a ratio."""
        stroke, velocity = (None if a is None else float(ratio) * a for a in (self.stroke, self.velocity))
        return dataclasses.replace(self, stroke=stroke, velocity=velocity)

    def levered(self, stroke: Samples, ratio: Samples) -> "Motion":
        """Another stroke [m], the velocity times a ratio of each sample, the force divided by it."""
        velocity, force = (None if a is None else a * b for a, b in ((self.velocity, ratio), (self.force, 1.0 / ratio)))
        return dataclasses.replace(self, stroke=stroke, velocity=velocity, force=force)

    def divided(self, factor: ScalarLike) -> "Motion":
        """The force divided by a factor (unknown if the factor is zero)."""
        return self.with_force(None if self.force is None or float(factor) == 0.0 else self.force / float(factor))

    def with_force(self, force: Samples | None) -> "Motion":
        """The same motion at another force [N]."""
        return dataclasses.replace(self, force=force)

    def at_temperature(self, temperature: ScalarLike) -> "Motion":
        """The same motion at another oil temperature [K]."""
        return dataclasses.replace(self, temperature=float(temperature))
