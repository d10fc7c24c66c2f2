"""One wheel with its suspension, the building block of all cars, and two of them on an axle."""

from typing import final

import equinox as eqx

from jaxdamp._types import Number, ScalarLike
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import Module, nonnegative, parameter, positive
from jaxdamp.vehicles.parts import AbstractPart, Body, Link, Parts, Point, Wheel, prefixed
from jaxdamp.vehicles.suspension import Suspension


class AbstractCorner(Module):
    """The common fields of a `Corner` and a `QuarterCar`."""

    unsprung_mass: Number = parameter("kg", "mass of wheel and hub", positive, adjustable=False)
    spring_rate: Number = parameter("N/m", "suspension spring rate at the wheel", positive)
    tyre_stiffness: Number = parameter("N/m", "vertical tyre stiffness", positive, adjustable=False)
    damper: AbstractDamper | None
    tyre_damping: Number = parameter("N s/m", "vertical tyre damping", nonnegative, default=0.0, adjustable=False)
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
        behind: ScalarLike | int = 0.0,
        left: ScalarLike | int = 0.0,
        beside: bool = False,
        sides: int = 1,
    ) -> tuple[Body, Link, Wheel]:
        """The wheel, the suspension and the tyre under a point of the body.

        Arguments:
            name: prefix of the names of parts and channels, may be empty.
            mount: point of the body above the wheel.
            behind: distance behind the front axle [m].
            left: distance to the left of the middle [m].
            beside: whether it is on the same axle as the previous wheel.
            sides: number of sides of the vehicle that the corner stands for.
        """
        wheel = Body(prefixed(name, "unsprung"), self.unsprung_mass)
        laws = self.damper, self.extra_spring, self.bump_stop, self.friction
        suspension = Suspension(self.spring_rate, *laws, self.damper_count)
        tyre = self.tyre_stiffness, self.tyre_damping
        standing = Wheel(name, wheel.at(), *tyre, behind, left, (), self.tyre_lifts, beside, sides)
        return wheel, suspension.link(name, mount - wheel.at(), sides=sides), standing


@final
class Corner(AbstractCorner, AbstractPart):
    """Wheel, tyre, spring, damper and optional further laws, all referred to the wheel.

    In side views, a corner is one wheel (`HalfCar`) or a whole axle (`TandemTruck`).

    Arguments:
        unsprung_mass: mass of wheel and hub [kg].
        spring_rate: linear suspension spring at the wheel [N/m].
        tyre_stiffness: vertical tyre stiffness [N/m].
        damper: law at the wheel; `dampers.MotionRatio(law, ratio)` if the damper has another travel than the wheel,
            `dampers.Linkage(law, travel, ratio)` if their ratio changes with the stroke; None for no damper.
        tyre_damping: vertical tyre damping [N s/m].
        extra_spring: law parallel to the linear spring, such as `CubicSpring` or `dampers.GasSpring`.
        bump_stop: law such as `dampers.BumpStop`.
        friction: law such as `dampers.CoulombFriction`.
        tyre_lifts: whether the tyre can lift off.
        damper_count: number of equal dampers, two if the corner is a whole axle with one on each side; the channels of
            force and power are those of one damper.
    """

    damper_count: int = eqx.field(static=True, default=1)


@final
class Axle(AbstractPart):
    """Two equal corners, half a track width left and right of the middle, with an anti-roll bar.

    The energy of the bar is ½ k_R (φ − (z_ul − z_ur)/w)²: its twist is the roll angle of the body relative to the line
    through the wheels.

    Arguments:
        corner: wheel, suspension and tyre of each side.
        track_width: w [m].
        anti_roll_rate: k_R [N m/rad], moment on the body per roll angle.
    """

    corner: Corner
    track_width: Number = parameter("m", "distance between the left and the right wheel", positive, adjustable=False)
    anti_roll_rate: Number = parameter("N m/rad", "stiffness of the anti-roll bar", nonnegative, default=0.0)

    def parts(
        self, name: str, body: Body, *, ahead: ScalarLike | int | None = None, behind: ScalarLike | int = 0.0
    ) -> Parts:
        """Left corner, right corner and anti-roll bar under a body that rolls.

        Arguments:
            name: prefix of the names of the parts, may be empty.
            body: the body above the axle.
            ahead: distance ahead of the centre of gravity [m], for a body that pitches.
            behind: distance behind the front axle [m].
        """
        half = 0.5 * self.track_width
        left, right = (
            self.corner.parts(prefixed(name, side), body.at(ahead, y), behind=behind, left=y, beside=side == "right")
            for side, y in (("left", half), ("right", -half))
        )
        line = (left[0].at() - right[0].at()) * (1.0 / self.track_width)
        bar = Link(prefixed(name, "anti_roll_bar"), body.roll - line, self.anti_roll_rate)
        return (left[0], right[0]), (left[1], right[1], bar), (left[2], right[2])
