"""One wheel with its suspension: what all cars are built from."""

from typing import Any, Protocol, final, runtime_checkable

import equinox as eqx

from jaxdamp._types import Number
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import nonnegative, parameter, positive
from jaxdamp.vehicles.parts import AbstractPart, Body, Element, Link, Wheel, prefixed
from jaxdamp.vehicles.points import Point


@final
class Corner(AbstractPart):
    """Wheel, tyre, spring, damper, and what may stand beside them, all referred to the wheel.

    Of an axle seen from the side, a corner is one wheel (half a car) or the whole axle, as the vehicle says.

    Arguments:
        unsprung_mass: wheel and hub [kg].
        spring_rate: linear suspension spring at the wheel [N/m].
        tyre_stiffness: [N/m].
        damper: law at the wheel; `dampers.MotionRatio(law, ratio)` for one that moves less or more.
        tyre_damping: [N s/m].
        extra_spring: law beside the linear spring, such as `CubicSpring` or `dampers.GasSpring`.
        bump_stop: law such as `dampers.BumpStop`.
        friction: law such as `dampers.CoulombFriction`.
        tyre_lifts: whether the tyre can leave the road.
        damper_count: how many dampers like `damper` act together, two where the corner is a whole axle with one on
            each side; the channel of the damper's force and its power are of one.
    """

    unsprung_mass: Number = parameter("kg", "mass of wheel and hub", positive)
    spring_rate: Number = parameter("N/m", "suspension spring rate at the wheel", positive)
    tyre_stiffness: Number = parameter("N/m", "vertical tyre stiffness", positive)
    damper: AbstractDamper
    tyre_damping: Number = parameter("N s/m", "vertical tyre damping", nonnegative, default=0.0)
    extra_spring: AbstractDamper | None = None
    bump_stop: AbstractDamper | None = None
    friction: AbstractDamper | None = None
    tyre_lifts: bool = eqx.field(static=True, default=False)
    damper_count: int = eqx.field(static=True, default=1)


@runtime_checkable
class HasCorner(Protocol):
    """Anything with the attributes of a `Corner`."""

    unsprung_mass: Any
    spring_rate: Any
    tyre_stiffness: Any
    tyre_damping: Any
    tyre_lifts: bool
    damper_count: int

    damper: Any
    extra_spring: Any
    bump_stop: Any
    friction: Any


def suspend(
    corner: HasCorner,
    name: str,
    mount: Point,
    *,
    behind: Any = 0.0,
    left: Any = 0.0,
    beside: bool = False,
    sides: int = 1,
) -> tuple[Body, Link, Wheel]:
    """The parts of a corner under a point of the body: its wheel, its suspension and its tyre.

    Arguments:
        corner: the corner.
        name: of its parts and channels, may be empty.
        mount: point of the body above the wheel.
        behind: distance behind the front axle [m].
        left: distance to the left of the middle [m].
        beside: on the axle of the wheel before it.
        sides: of the vehicle that the corner stands for.
    """
    wheel = Body(prefixed(name, "unsprung"), corner.unsprung_mass)
    laws = {
        "damper": corner.damper,
        "extra_spring": corner.extra_spring,
        "bump_stop": corner.bump_stop,
        "friction": corner.friction,
    }
    counts = {"damper": corner.damper_count}
    elements = tuple(Element(kind, law, counts.get(kind, 1)) for kind, law in laws.items() if law is not None)
    suspension = Link(name, mount - wheel.at(), corner.spring_rate, elements=elements, sides=sides)
    lifts = corner.tyre_lifts
    tyre = Wheel(name, wheel.at(), corner.tyre_stiffness, corner.tyre_damping, behind, left, (), lifts, beside, sides)
    return wheel, suspension, tyre
