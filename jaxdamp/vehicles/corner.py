"""One wheel with its suspension: what all cars are built from."""

from typing import Any, final

import equinox as eqx

from jaxdamp._types import Number
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import Module, nonnegative, parameter, positive
from jaxdamp.vehicles.parts import AbstractPart, Body, Link, Wheel, prefixed
from jaxdamp.vehicles.points import Point
from jaxdamp.vehicles.suspension import Suspension


class AbstractCorner(Module):
    """The fields of a wheel with its suspension, which a `Corner` and a `QuarterCar` have in common."""

    unsprung_mass: Number = parameter("kg", "mass of wheel and hub", positive)
    spring_rate: Number = parameter("N/m", "suspension spring rate at the wheel", positive)
    tyre_stiffness: Number = parameter("N/m", "vertical tyre stiffness", positive)
    damper: AbstractDamper
    tyre_damping: Number = parameter("N s/m", "vertical tyre damping", nonnegative, default=0.0)
    extra_spring: AbstractDamper | None = None
    bump_stop: AbstractDamper | None = None
    friction: AbstractDamper | None = None
    tyre_lifts: bool = eqx.field(static=True, default=False)
    damper_count: eqx.AbstractVar[int]  # pyright: ignore[reportGeneralTypeIssues]  # no field here

    def parts(
        self,
        name: str,
        mount: Point,
        *,
        behind: Any = 0.0,
        left: Any = 0.0,
        beside: bool = False,
        sides: int = 1,
    ) -> tuple[Body, Link, Wheel]:
        """The wheel, the suspension and the tyre under a point of the body.

        Arguments:
            name: of the parts and channels, may be empty.
            mount: point of the body above the wheel.
            behind: distance behind the front axle [m].
            left: distance to the left of the middle [m].
            beside: on the axle of the wheel before it.
            sides: of the vehicle that the corner stands for.
        """
        wheel = Body(prefixed(name, "unsprung"), self.unsprung_mass)
        laws = self.damper, self.extra_spring, self.bump_stop, self.friction
        suspension = Suspension(self.spring_rate, *laws, self.damper_count)
        tyre = self.tyre_stiffness, self.tyre_damping
        standing = Wheel(name, wheel.at(), *tyre, behind, left, (), self.tyre_lifts, beside, sides)
        return wheel, suspension.link(name, mount - wheel.at(), sides=sides), standing


@final
class Corner(AbstractCorner, AbstractPart):
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

    damper_count: int = eqx.field(static=True, default=1)
