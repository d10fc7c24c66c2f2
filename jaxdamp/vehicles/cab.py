"""The cab of a truck on its own mounts."""

from typing import final

from jaxdamp._types import Number
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import parameter, positive
from jaxdamp.vehicles.parts import AbstractPart, Body, Link
from jaxdamp.vehicles.suspension import Suspension


@final
class Cab(AbstractPart):
    """A cab with heave and pitch on two mounts, front and rear.

    Arguments:
        mass: mass of the cab [kg].
        pitch_inertia: moment of inertia in pitch [kg m²].
        ahead: centre of gravity of the cab ahead of that of the sprung mass [m].
        front_distance: front mount ahead of the centre of gravity of the cab [m].
        rear_distance: rear mount behind the centre of gravity of the cab [m].
        front_rate: spring rate of the front mount, both sides together [N/m].
        rear_rate: spring rate of the rear mount, both sides together [N/m].
        front_damper: law at the front mount, both sides together.
        rear_damper: law at the rear mount, both sides together.
        front_extra_spring: law parallel to the spring of the front mount; as all laws, both sides together.
        rear_extra_spring: law parallel to the spring of the rear mount.
        front_bump_stop: bump stop of the front mount.
        rear_bump_stop: bump stop of the rear mount.
        front_friction: friction of the front mount.
        rear_friction: friction of the rear mount.
    """

    mass: Number = parameter("kg", "mass of the cab", positive, adjustable=False)
    pitch_inertia: Number = parameter("kg m²", "moment of inertia of the cab in pitch", positive, adjustable=False)
    ahead: Number = parameter("m", "cab ahead of the centre of gravity of the sprung mass", adjustable=False)
    front_distance: Number = parameter(
        "m", "front mount ahead of the cab's centre of gravity", positive, adjustable=False
    )
    rear_distance: Number = parameter("m", "rear mount behind the cab's centre of gravity", positive, adjustable=False)
    front_rate: Number = parameter("N/m", "spring rate of the front mount", positive)
    rear_rate: Number = parameter("N/m", "spring rate of the rear mount", positive)
    front_damper: AbstractDamper
    rear_damper: AbstractDamper
    front_extra_spring: AbstractDamper | None = None
    rear_extra_spring: AbstractDamper | None = None
    front_bump_stop: AbstractDamper | None = None
    rear_bump_stop: AbstractDamper | None = None
    front_friction: AbstractDamper | None = None
    rear_friction: AbstractDamper | None = None

    def parts(self, body: Body) -> tuple[tuple[Body], tuple[Link, ...]]:
        """The cab and its mounts on a body."""
        cab = Body("cab", self.mass, pitch_inertia=self.pitch_inertia)
        front = self.front_damper, self.front_extra_spring, self.front_bump_stop, self.front_friction
        rear = self.rear_damper, self.rear_extra_spring, self.rear_bump_stop, self.rear_friction
        mounts = (
            ("cab_front", self.front_distance, Suspension(self.front_rate, *front)),
            ("cab_rear", -self.rear_distance, Suspension(self.rear_rate, *rear)),
        )
        links = tuple(mount.link(name, cab.at(x) - body.at(self.ahead + x), sides=2) for name, x, mount in mounts)
        return (cab,), links
