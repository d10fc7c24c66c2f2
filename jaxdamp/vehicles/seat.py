"""A seat and its driver on the body of any vehicle."""

from collections.abc import Sequence
from typing import Any, final

import equinox as eqx

from jaxdamp import _checks
from jaxdamp._types import Number
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import Module, as_float, parameter, positive
from jaxdamp.vehicles.parts import AbstractPart, Body, Link, Point
from jaxdamp.vehicles.suspension import Suspension


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
    ahead: Any = eqx.field(default=None, converter=lambda v: None if v is None else as_float(v))
    left: Any = eqx.field(default=None, converter=lambda v: None if v is None else as_float(v))
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
