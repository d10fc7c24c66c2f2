"""The cab of a truck on mounts of its own."""

from typing import final

from jaxdamp._types import Number
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import parameter, positive
from jaxdamp.vehicles.parts import AbstractPart, Body, Element, Link


@final
class Cab(AbstractPart):
    """A cab with heave and pitch on two mounts, front and rear.

    Arguments:
        mass: [kg].
        pitch_inertia: [kg m²].
        ahead: centre of gravity of the cab ahead of that of the sprung mass [m].
        front_distance: front mount ahead of the centre of gravity of the cab [m].
        rear_distance: rear mount behind it [m].
        front_rate: spring rate of the front mount, both sides together [N/m].
        rear_rate: of the rear mount [N/m].
        front_damper: law at the front mount, both sides together.
        rear_damper: law at the rear mount, both sides together.
    """

    mass: Number = parameter("kg", "mass of the cab", positive)
    pitch_inertia: Number = parameter("kg m²", "moment of inertia of the cab in pitch", positive)
    ahead: Number = parameter("m", "cab ahead of the centre of gravity of the sprung mass")
    front_distance: Number = parameter("m", "front mount ahead of the cab's centre of gravity", positive)
    rear_distance: Number = parameter("m", "rear mount behind the cab's centre of gravity", positive)
    front_rate: Number = parameter("N/m", "spring rate of the front mount", positive)
    rear_rate: Number = parameter("N/m", "spring rate of the rear mount", positive)
    front_damper: AbstractDamper
    rear_damper: AbstractDamper

    def parts(self, body: Body) -> tuple[tuple[Body], tuple[Link, ...]]:
        """The cab and its mounts on a body."""
        cab = Body("cab", self.mass, pitch_inertia=self.pitch_inertia)
        mounts = (
            ("cab_front", self.front_distance, self.front_rate, self.front_damper),
            ("cab_rear", -self.rear_distance, self.rear_rate, self.rear_damper),
        )
        links = tuple(
            Link(name, cab.at(x) - body.at(self.ahead + x), rate, elements=(Element("damper", law),), sides=2)
            for name, x, rate, law in mounts
        )
        return (cab,), links
