"""The parts of a vehicle: rigid bodies, links between their points, wheels on the road."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PyTree

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import AbstractDeclared, as_float, nonnegative, parameter, positive


def _is_one(coefficient: object) -> bool:
    return isinstance(coefficient, float) and coefficient == 1.0


@final
class Point(eqx.Module):
    """Σ coefficient · coordinate: the height of a point [m] or an angle [rad], for small angles.

    Points can be added, subtracted and scaled: the extension of a link is `body.at(1.2) - wheel.at()`. `Body.at` gives
    points, `Body.pitch` and `Body.roll` give angles.

    Attributes:
        terms: the coefficient of each coordinate, by its name.

    >>> twist = Point({"roll": 1.0}) - (Point({"z_left": 1.0}) - Point({"z_right": 1.0})) * 0.5
    >>> twist.terms
    {'roll': 1.0, 'z_left': -0.5, 'z_right': 0.5}
    """

    terms: Mapping[str, ScalarLike | int]

    def __add__(self, other: "Point") -> "Point":
        terms = dict(self.terms)
        for name, coefficient in other.terms.items():
            terms[name] = terms[name] + coefficient if name in terms else coefficient
        return Point(terms)

    def __mul__(self, factor: ScalarLike | int) -> "Point":
        return Point({name: factor * coefficient for name, coefficient in self.terms.items()})

    __rmul__ = __mul__

    def __neg__(self) -> "Point":
        return self * -1.0

    def __sub__(self, other: "Point") -> "Point":
        return self + -other

    def of(self, values: Mapping[str, ArrayLike]) -> PyTree:
        """Its value for given values of the coordinates by name, such as a mode shape.

        >>> Point({"z_sprung": 1.0, "pitch": -1.0}).of({"z_sprung": 0.5, "pitch": 0.25})
        0.25
        """
        return sum(coefficient * values[name] for name, coefficient in self.terms.items())


def matrix(points: Sequence[Point], coordinates: Sequence[str]) -> Float[Array, "points coordinates"]:
    """The coefficients of points, one row each, in the order of the coordinates; other coordinates are ignored."""
    numbers: list[ScalarLike | int] = [0.0, 1.0]  # of the entries: a gather compiles faster than a stack of rows
    entries = np.zeros((len(points), len(coordinates)), dtype=int)
    column = {name: j for j, name in enumerate(coordinates)}
    for i, point in enumerate(points):
        for name, coefficient in point.terms.items():
            if name in column:
                entries[i, column[name]] = 1 if _is_one(coefficient) else len(numbers)
                numbers += [] if _is_one(coefficient) else [coefficient]
    return jnp.stack([jnp.asarray(number, dtype=float) for number in numbers])[entries]


SPRUNG = "sprung"
Parts: TypeAlias = "tuple[tuple[Body, ...], tuple[Link, ...], tuple[Wheel, ...]]"


def prefixed(name: str, word: str) -> str:
    """The name of a channel of a part: "front" and "stroke" give "front_stroke"; an empty name adds no prefix.

    Arguments:
        name: of the part.
        word: the channel.
    """
    return f"{name}_{word}" if name else word


def maybe_float(value: ScalarLike | int | None) -> Scalar | None:
    """The number, as a field holds it, or None."""
    return None if value is None else as_float(value)


class AbstractPart(AbstractDeclared):
    """A part of a vehicle with its own parameters."""


@final
class Inertia(AbstractPart):
    """A rotation of a body, pitch (nose up) or roll (left side up), and its moment of inertia."""

    axis: str = eqx.field(static=True)
    moment: Number = parameter("kg m²", "moment of inertia about the centre of gravity", positive, adjustable=False)

    @property
    def sense(self) -> str:
        """Its positive direction."""
        return {"pitch": "nose up", "roll": "left side up"}[self.axis]


@final
class Body(AbstractPart):
    """A rigid body with heave and, if the moments of inertia are given, pitch and roll.

    Its coordinates are the height of the centre of gravity `z_{name}` [m, up] and the angles [rad] `{name}_pitch`
    (nose up) and `{name}_roll` (left side up); those of the body named "sprung" are just `pitch` and `roll`.

    Arguments:
        name: name of the body, used in the names of coordinates and channels.
        mass: mass [kg].
        pitch_inertia: moment of inertia in pitch [kg m²]; left out, the body does not pitch.
        roll_inertia: moment of inertia in roll [kg m²]; left out, the body does not roll.

    >>> body = Body("sprung", 580.0, pitch_inertia=1100.0)
    >>> {name: float(share) for name, share in body.at(1.5).terms.items()}
    {'z_sprung': 1.0, 'pitch': 1.5}
    """

    name: str = eqx.field(static=True)
    mass: Number = parameter("kg", "mass of the body", positive, adjustable=False)
    turns: tuple[Inertia, ...]

    def __init__(
        self,
        name: str,
        mass: ScalarLike | int,
        *,
        pitch_inertia: ScalarLike | int | None = None,
        roll_inertia: ScalarLike | int | None = None,
    ) -> None:
        self.name, self.mass = name, mass
        given = (("pitch", pitch_inertia), ("roll", roll_inertia))
        self.turns = tuple(Inertia(axis, moment) for axis, moment in given if moment is not None)

    def angle(self, axis: str) -> str:
        """Name of the coordinate of an angle."""
        return axis if self.name == SPRUNG else prefixed(self.name, axis)

    @property
    def masses(self) -> dict[str, Scalar]:
        """The coordinates of the body, each with its mass [kg] or moment of inertia [kg m²]."""
        return {f"z_{self.name}": self.mass} | {self.angle(turn.axis): turn.moment for turn in self.turns}

    def _turn(self, axis: str) -> Point:
        if axis not in [turn.axis for turn in self.turns]:
            _checks.refuse("axis", f"be one that {self.name!r} turns about", repr(axis), f"Give it a `{axis}_inertia`.")
        return Point({self.angle(axis): 1.0})

    @property
    def pitch(self) -> Point:
        """The pitch angle, nose up [rad]."""
        return self._turn("pitch")

    @property
    def roll(self) -> Point:
        """The roll angle, left side up [rad]."""
        return self._turn("roll")

    def at(self, ahead: ScalarLike | int | None = None, left: ScalarLike | int | None = None) -> Point:
        """The height of a point `ahead` and `left` of the centre of gravity [m], z + ahead θ + left φ."""
        point = Point({f"z_{self.name}": 1.0})
        point = point if ahead is None else point + as_float(ahead) * self.pitch
        return point if left is None else point + as_float(left) * self.roll


@final
class Element(AbstractPart):
    """A law at a port, with a name: `Element("damper", law)` gives the channel `damper_force`.

    If there are several equal ones, such as the dampers of both sides in a side view of a truck, the vehicle has the
    force of all; the channels of force and dissipated power are those of one.

    Arguments:
        name: name of the element.
        law: law of one of them.
        count: number of equal laws.

    Raises:
        ValueError: a count below one.
    """

    name: str = eqx.field(static=True)
    law: AbstractDamper
    count: int = eqx.field(static=True, default=1)

    def __check_init__(self) -> None:
        if self.count < 1:
            _checks.refuse("count", "be 1 or more", self.count, "It is the number of equal laws.")

    @property
    def together(self) -> AbstractDamper:
        """The law of all of them together."""
        return self.law if self.count == 1 else float(self.count) * self.law


@final
class Link(AbstractPart):
    """A linear spring, a dashpot and any laws in parallel; the extension is the upper point minus the lower point.

    A link with laws has the channels `stroke` [m], `damper_velocity` [m/s] (of the extension: with a `MotionRatio` or a
    `Linkage` the damper's own is ratio times that) and the force [N] of each law, after the name of the link. Across an
    angle, as in an anti-roll bar, pass `angular=True`: the units are N m/rad, N m s/rad, rad, rad/s and N m.

    Arguments:
        name: name of the link, may be empty.
        extension: upper point minus lower point.
        stiffness: stiffness of the linear spring.
        damping: coefficient of the linear dashpot.
        elements: laws parallel to them.
        sides: number of sides of the vehicle that it stands for; only for descriptions.
        angular: whether the extension is an angle [rad], and the laws give moments [N m].
    """

    name: str = eqx.field(static=True)
    extension: Point
    stiffness: Number = parameter("N/m", "stiffness of the linear spring", nonnegative, default=0.0)
    damping: Number = parameter("N s/m", "coefficient of the linear dashpot", nonnegative, default=0.0)
    elements: tuple[Element, ...] = ()
    sides: int = eqx.field(static=True, default=1)
    angular: bool = eqx.field(static=True, default=False)


@final
class Wheel(AbstractPart):
    """A tyre between a point of the vehicle and the road: a linear spring, a dashpot and any laws.

    Channels, with its name as prefix: `z_road` [m], `dynamic_tyre_load` [N] (minus the static load),
    `relative_tyre_load`; with laws also `stroke`, `damper_velocity` and their forces. The columns of a road are in the
    order of the wheels.

    Arguments:
        name: name of the wheel, may be empty.
        point: point of the vehicle above the tyre.
        stiffness: vertical stiffness of the tyre.
        damping: vertical damping of the tyre.
        behind: distance behind the front axle [m], for delays.
        left: distance to the left of the middle [m]; zero if the wheel stands for both sides.
        elements: laws between point and road.
        lifts: whether the tyre can lift off (`LiftOff`).
        beside: whether it is on the same axle as the previous wheel.
        sides: number of sides of the vehicle that it stands for; only for descriptions.
    """

    name: str = eqx.field(static=True)
    point: Point
    stiffness: Number = parameter("N/m", "vertical tyre stiffness", positive, adjustable=False)
    damping: Number = parameter("N s/m", "vertical tyre damping", nonnegative, default=0.0, adjustable=False)
    behind: Number = parameter("m", "distance behind the front axle", nonnegative, default=0.0, adjustable=False)
    left: Number = parameter("m", "distance to the left of the middle", default=0.0, adjustable=False)
    elements: tuple[Element, ...] = ()
    lifts: bool = eqx.field(static=True, default=False)
    beside: bool = eqx.field(static=True, default=False)
    sides: int = eqx.field(static=True, default=1)

    @property
    def element_names(self) -> tuple[str, ...]:
        """Names of the elements between it and the road, with that of a tyre that can leave it."""
        names = [element.name for element in self.elements] + ["lift_off"] * self.lifts
        return tuple(prefixed(self.name, name) for name in names)


@final
class Place(AbstractPart):
    """A place on the body where the acceleration is of interest.

    It has the channels `z_{name}`, `{name}_velocity` and `{name}_acceleration`.

    Arguments:
        name: name of the place.
        ahead: distance ahead of the centre of gravity [m]; `None` for a body that does not pitch.
        left: distance to the left of the centre of gravity [m]; `None` for a body that does not roll.
        body: name of the body it is on.
    """

    name: str = eqx.field(static=True)
    ahead: Scalar | None = eqx.field(default=None, converter=maybe_float)
    left: Scalar | None = eqx.field(default=None, converter=maybe_float)
    body: str = eqx.field(static=True, default=SPRUNG)
