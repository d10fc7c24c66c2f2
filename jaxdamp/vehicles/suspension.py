"""A suspension between two points of a vehicle, and a seat on one: a spring, a damper and optional further laws."""

from collections.abc import Sequence
from typing import final

import equinox as eqx

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers import AbstractDamper, AbstractStateless, Traits
from jaxdamp.parameters import Module, nonnegative, parameter, positive
from jaxdamp.vehicles.parts import AbstractPart, Body, Element, Link, Point, maybe_float


@final
class CubicSpring(AbstractStateless):
    """F = k₂ x² + k₃ x³: the nonlinear part of a progressive spring, parallel to its linear rate.

    Its tangent rate is k + 2 k₂ x + 3 k₃ x² with the linear rate k of the vehicle. With k₂ < 0 it is stiffer in
    compression than in extension; the total rate is positive at every stroke if k₂² < 3 k k₃. No energy is dissipated.

    >>> float(CubicSpring(quadratic_stiffness=-1e5, cubic_stiffness=2e6).force_stroke_velocity(-0.1, 0.0))
    -3000.0
    """

    quadratic_stiffness: Number = parameter("N/m²", "k₂, quadratic stiffness", default=0.0, linear=True)
    cubic_stiffness: Number = parameter("N/m³", "k₃, cubic stiffness", nonnegative, default=0.0, linear=True)

    def traits(self) -> Traits:
        """Independent of the velocity."""
        return super().traits()._replace(has_feed_through=False)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m], independent of the velocity."""
        del v
        return (self.quadratic_stiffness + self.cubic_stiffness * x) * x * x


@final
class Suspension(AbstractPart):
    """A spring, a damper and optional parallel laws, between a wheel and the body or under a cab or a seat.

    Arguments:
        spring_rate: rate of the linear spring [N/m].
        damper: law; `dampers.MotionRatio(law, ratio)` if the damper has another travel than the suspension,
            `dampers.Linkage(law, travel, ratio)` if their ratio changes with the stroke.
        extra_spring: law parallel to the linear spring, such as `CubicSpring` or `dampers.GasSpring`.
        bump_stop: law such as `dampers.BumpStop`.
        friction: law such as `dampers.CoulombFriction`.
        damper_count: number of equal dampers; the channels of force and power are those of one.

    >>> from jaxdamp.dampers import BumpStop, Linear
    >>> from jaxdamp.vehicles import Body
    >>> body, axle = Body("sprung", 600.0), Body("unsprung", 60.0)
    >>> suspension = Suspension(45e3, Linear(3000.0), bump_stop=BumpStop(clearance=0.06, stiffness=5e4))
    >>> [element.name for element in suspension.link("", body.at() - axle.at()).elements]
    ['damper', 'bump_stop']
    """

    spring_rate: Number = parameter("N/m", "spring rate", positive)
    damper: AbstractDamper | None = None
    extra_spring: AbstractDamper | None = None
    bump_stop: AbstractDamper | None = None
    friction: AbstractDamper | None = None
    damper_count: int = eqx.field(static=True, default=1)

    @property
    def elements(self) -> tuple[Element, ...]:
        """Its laws."""
        named = [("damper", self.damper, self.damper_count), ("extra_spring", self.extra_spring, 1)]
        named += [("bump_stop", self.bump_stop, 1), ("friction", self.friction, 1)]
        return tuple(Element(name, law, count) for name, law, count in named if law is not None)

    def link(self, name: str, extension: Point, *, sides: int = 1) -> Link:
        """The suspension as a link; its extension is the upper point minus the lower point."""
        return Link(name, extension, self.spring_rate, elements=self.elements, sides=sides)


@final
class SeatMass(AbstractPart):
    """A mass on a spring and a damper, such as seat and driver on the suspension of the seat.

    Arguments:
        mass: mass on the spring [kg].
        spring_rate: rate of the spring under the mass [N/m].
        damper: law under the mass.
        extra_spring: law parallel to the linear spring, such as `dampers.GasSpring`.
        bump_stop: law such as `dampers.BumpStop`.
        friction: law such as `dampers.CoulombFriction`.
    """

    mass: Number = parameter("kg", "mass on the spring", positive, adjustable=False)
    spring_rate: Number = parameter("N/m", "spring rate under the mass", positive)
    damper: AbstractDamper
    extra_spring: AbstractDamper | None = None
    bump_stop: AbstractDamper | None = None
    friction: AbstractDamper | None = None


@final
class Seat(Module):
    """A seat at a point of the body: one mass, or several above each other (seat frame, driver on the cushion).

    Channels: `z_seat`, `seat_acceleration`, `seat_stroke`, `seat_damper_force` and so on for the first mass; the next
    are called `seat_2`, `seat_3`. Its accelerations are among the ride metrics.

    Arguments:
        masses: from below upwards.
        ahead: distance ahead of the centre of gravity [m]; left out on a body that does not pitch.
        left: distance to the left of the centre of gravity [m]; left out on a body that does not roll.
        name: name of the seat.

    >>> from jaxdamp.dampers import Linear
    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> seat = Seat((SeatMass(80.0, 6e3, Linear(600.0)),))
    >>> car = quarter_car_000(seats=(seat,))
    >>> car.coordinates
    ('z_sprung', 'z_unsprung', 'z_seat')
    """

    masses: tuple[SeatMass, ...]
    ahead: Scalar | None = eqx.field(default=None, converter=maybe_float)
    left: Scalar | None = eqx.field(default=None, converter=maybe_float)
    name: str = eqx.field(static=True, default="seat")

    def __check_init__(self) -> None:
        if not self.masses:
            _checks.refuse("masses", "hold one or more", self.masses)


def seat_parts(seats: Sequence[Seat], body: Body) -> tuple[tuple[Body, ...], tuple[Link, ...]]:
    """The bodies and links of seats on a body."""
    bodies: list[Body] = []
    links: list[Link] = []
    for seat in seats:
        below: Point = body.at(seat.ahead, seat.left)
        for number, stage in enumerate(seat.masses, 1):
            name = seat.name if number == 1 else f"{seat.name}_{number}"
            above = Body(name, stage.mass)
            laws = stage.damper, stage.extra_spring, stage.bump_stop, stage.friction
            links.append(Suspension(stage.spring_rate, *laws).link(name, above.at() - below))
            bodies.append(above)
            below = above.at()
    return tuple(bodies), tuple(links)
