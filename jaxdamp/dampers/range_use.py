"""By how much a law is used outside the range that it was fitted to."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp import _checks
from jaxdamp._traced import is_traced, of_known_numbers
from jaxdamp._warned import warn
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.fitted_range import (
    UNITS,
    FittedRange,
    Limits,
    Motion,
    OutsideFittedRangeWarning,
    RangeNote,
    StandardError,
    has_fitted_range,
    shown_unit,
    span,
    without_standard_errors,
)
from jaxdamp.dampers.inside import command_paths, laws_inside
from jaxdamp.parameters import get


TOLERANCE = 0.05  # of the larger limit, by which a use may leave the range without a warning
_ROUNDING = 1e-9  # of the larger limit


class RangeUse(NamedTuple):
    """One quantity of a law in use, beside the range of its records.

    Attributes:
        law: class of the law that has the range.
        quantity: velocity, stroke, force, temperature or command.
        unit: in SI.
        used: lowest and highest value in use.
        fitted: lowest and highest value of the records.
        share: share of the time outside [-]; None where nothing changes with time.
    """

    law: str  # class of the law that has the range
    quantity: str  # velocity, stroke, force, temperature or command
    unit: str  # SI
    used: tuple[float, float]  # lowest and highest value in use
    fitted: tuple[float, float]
    share: float | None  # of the time outside, where it changes with time

    @property
    def beyond(self) -> float:
        """How far the use reaches beyond the range, in its unit; zero inside."""
        return max(self.fitted[0] - self.used[0], self.used[1] - self.fitted[1], 0.0)

    @property
    def outside(self) -> bool:
        """Whether that is more than the tolerance, a twentieth of the larger limit (of the width, for temperatures)."""
        low, high = self.fitted
        size = high - low if self.quantity == "temperature" else max(abs(low), abs(high))
        return self.beyond > (TOLERANCE + _ROUNDING) * size

    @property
    def times(self) -> float | None:
        """The largest value in use over the limit that it passes; `None` inside, and where that has no meaning."""
        pairs = [(self.used[0], self.fitted[0], -1.0), (self.used[1], self.fitted[1], 1.0)]
        ratios = [used / limit for used, limit, side in pairs if side * limit > 0 and side * (used - limit) > 0]
        return None if not ratios or self.quantity in ("temperature", "command") else max(ratios)

    def words(self) -> str:
        """As in "velocity −0.41 to 0.54 m/s, fitted to −0.089 to 0.089 m/s (6.1 times), 41 % of the time outside"."""
        at = self.used if self.used[0] < self.used[1] else self.used[:1]
        used = span(self.quantity, self.used) if len(at) > 1 else _single(self.quantity, at[0])
        text = f"{self.quantity} {used}, fitted to {span(self.quantity, self.fitted)}"
        text += "" if self.times is None else f" ({self.times:.2g} times)"
        return text if self.share is None else f"{text}, {_percent(self.share)} of the time outside"


def _single(quantity: str, value: float) -> str:
    low = span(quantity, (value, value)).split(" to ")[0]
    return f"{low} {shown_unit(quantity)}".rstrip()


def _percent(share: float) -> str:
    percent = 100.0 * share
    return "less than 1 %" if percent < 1.0 else f"{percent:.0f} %"


@of_known_numbers
def range_use(law: AbstractDamper, motion: Motion) -> list[RangeUse]:
    """Every quantity of a motion beside the range of the law, and of each law inside that has a range of its own.

    Velocity and force are compared always, the stroke of laws that depend on it (a law of the velocity alone is no
    worse at another stroke), temperature and command where the law knows them. A law inside is judged by its own
    motion: behind a `MotionRatio` or a `Linkage` by the damper's stroke and velocity, in a `Scaled` law by the force
    before scaling. Inside a `SeriesSpring`, a `Bushing` or a `Lag` the motion of the whole stands for it, which is
    mostly more.

    Empty where no law has a range, or while JAX traces the law or its motion.
    """
    if not has_fitted_range(law) or is_traced((law, *vars(motion).values())):
        return []
    return list(dict.fromkeys(_uses(law, motion)))


def _uses(law: AbstractDamper, motion: Motion) -> list[RangeUse]:
    """Own uses, then those of the laws inside."""
    uses = [] if law.fitted_to is None else _own_uses(law, motion)
    inside = [use for part, inner in law.motion_inside(motion) for use in _uses(part, inner)]
    return uses + inside


def _own_uses(law: AbstractDamper, motion: Motion) -> list[RangeUse]:
    assert law.fitted_to is not None
    uses = []
    stroke = motion.stroke if law.traits().stroke_dependent else None
    channels = {"velocity": motion.velocity, "stroke": stroke, "force": motion.force}
    commands = sorted({float(get(law, path)) for path in command_paths(law)})
    channels |= {"temperature": _temperatures(law, motion), "command": np.array(commands)}
    for name, fitted, unit in law.fitted_to.known():
        values = channels.get(name)
        if values is None or not values.size or not np.all(np.isfinite(values)):
            continue
        used = float(values.min()), float(values.max())
        outside = float(np.mean((values < fitted[0]) | (values > fitted[1])))
        changing = name in ("velocity", "stroke", "force")
        uses.append(RangeUse(type(law).__name__, name, unit, used, fitted, outside if changing else None))
    return uses


def _temperatures(law: AbstractDamper, motion: Motion) -> np.ndarray:
    """The oil temperatures [K] that are set around a law and inside it."""
    inside = [inner for _, inner in law.motion_inside(motion)]
    deeper = [t for part, inner in law.motion_inside(motion) for t in _temperatures(part, inner)]
    temperatures = {motion.temperature, *(inner.temperature for inner in inside), *deeper} - {None}
    return np.array(sorted(t for t in temperatures if t is not None))


def sentence(name: str, uses: Sequence[RangeUse]) -> str:
    """By how much a damper of this name leaves the range of its laws; empty if it does not.

    A force beyond the range is said where it does not simply follow from a velocity beyond it.

    Arguments:
        name: of the damper.
        uses: its quantities in use.
    """
    left = [use for use in uses if use.outside]
    fast = {use.law for use in left if use.quantity == "velocity"}
    left = [use for use in left if use.quantity != "force" or use.law not in fast]
    several = len({use.law for use in left}) > 1
    lines = dict.fromkeys(f"{use.law} {use.words()}" if several else use.words() for use in left)
    return f"{name}: {'; '.join(lines)}." if left else ""


def warn_outside(sentences: Sequence[str]) -> None:
    """Warn of each damper that leaves its range.

    Arguments:
        sentences: what to warn of, one for each damper; empty ones are left out.
    """
    for text in filter(None, sentences):
        warn(f"Extrapolated: {text}", OutsideFittedRangeWarning)


@of_known_numbers
def extrapolated(law: AbstractDamper, velocities: Float[np.ndarray, " points"]) -> Bool[np.ndarray, " points"]:
    """At which velocities [m/s] the law, or a law inside, is outside the velocities that it was fitted to.

    Arguments:
        law: the damper law.
        velocities: [m/s], positive in rebound, shape (points,).
    """
    velocities = np.asarray(velocities, dtype=float)
    outside = np.zeros(velocities.shape, bool)
    if not has_fitted_range(law):
        return outside
    if law.fitted_to is not None and law.fitted_to.velocity is not None:
        low, high = law.fitted_to.velocity
        rounding = _ROUNDING * max(abs(low), abs(high))
        outside |= (velocities < low - rounding) | (velocities > high + rounding)
    for part, inner in law.motion_inside(Motion(velocity=velocities)):
        if inner.velocity is not None:
            outside |= extrapolated(part, inner.velocity)
    return outside


L = TypeVar("L")
D = TypeVar("D", bound=AbstractDamper)


def with_fitted_range(law: L, fitted_to: FittedRange | None = None, **limits: Limits) -> L:
    """The same law with the range of the records that it was fitted to, instead of any previous range.

    `identify.fit` and `train` do this; state the range yourself for a law with parameters from another source. Laws
    inside have their own ranges. Simulations with the law then report by how much it is used outside the range.

    The range is no array of the law: a law with a range has the same structure as one without, and `jax.tree.map` of
    several laws returns that of the first. A law that a compiled function (`jax.jit`, `jax.lax.scan`) returns has none.

    Arguments:
        law: any law.
        fitted_to: the range; or give the limits by name.
        limits: as `FittedRange` takes them, such as `velocity=(-0.5, 0.5)`.

    Raises:
        ValueError: something that is not a law; neither a range nor limits, or both; an unknown quantity;
            limits out of order.

    >>> from jaxdamp.dampers import Linear
    >>> with_fitted_range(Linear(1500.0), velocity=(-0.5, 0.9)).fitted_to.words()
    'velocity −0.5 to 0.9 m/s'
    """
    if not isinstance(law, AbstractDamper):
        _checks.refuse("law", "be a damper law", f"a {type(law).__name__}", "For a vehicle, set it for its dampers.")
    for name in limits:
        _checks.one_of("limits", name, UNITS)
    if (fitted_to is None) == (not limits):
        remedy = "Write for example `with_fitted_range(law, velocity=(-0.5, 0.5))`."
        _checks.refuse("fitted_to", "be given, or limits by name, and not both", repr(fitted_to), remedy)
    return _with_note(law, RangeNote(fitted_to or FittedRange(**limits), law.standard_errors))


def with_standard_errors(law: D, errors: Iterable[StandardError]) -> D:
    """The same law with the standard errors of its fit, instead of any previous ones, also of laws inside.

    Arguments:
        law: any law.
        errors: of numbers of the law, by path; not finite where the records say nothing.
    """
    noted = [error if np.isfinite(error.value) else error._replace(value=float("inf")) for error in errors]
    law = without_standard_errors(law)
    return _with_note(law, RangeNote(law.fitted_to, tuple(noted)))


def not_identified(tree: object) -> list[str]:
    """The paths of the parameters of fitted laws of which the records determine no number.

    Arguments:
        tree: a law, a vehicle or another module.
    """
    numbers: dict[str, list[bool]] = {}
    for prefix, law in laws_inside(tree):
        for error in law.standard_errors:
            numbers.setdefault(prefix + error.name.partition("[")[0], []).append(error.identified)
    return [path for path, identified in numbers.items() if not any(identified)]


def _with_note(law: L, note: RangeNote) -> L:
    """The law with another note."""
    changed = object.__new__(type(law))
    for name, value in (vars(law) | {"range_note": note}).items():
        object.__setattr__(changed, name, value)
    return changed
