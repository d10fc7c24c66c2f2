"""Vehicles on a test rig: with guides and springs to the ground, or driven by forces on the wheels."""

import dataclasses
from typing import final

import equinox as eqx

from jaxdamp import _checks
from jaxdamp._types import Number, ScalarLike
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import nonnegative, parameter
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import SPRUNG, AbstractPart, Element, Link


CENTRING = 1.0  # N/m, under each wheel: so soft that forces are what moves the vehicle


@final
class ForceDriven(AbstractVehicle):
    """A vehicle without its tyres, on measured forces: its "road" is the force on each wheel in newtons.

    Each tyre is replaced by a spring of 1 N/m, so that a road of z metres pushes with z newtons. The spring centres the
    vehicle, which an error of the forces would carry away, and changes the force by one newton for each metre of
    motion. Forces are those on the wheels minus the static loads, positive up. Tyres have no part in the motion.

    Arguments:
        car: any vehicle without a controller, which goes around this one.

    >>> from jaxdamp.vehicles import presets
    >>> ForceDriven(presets.quarter_car_000()).port_form().road_stiffness.tolist()
    [[0.0], [1.0]]
    """

    car: AbstractVehicle

    def __check_init__(self) -> None:
        _refuse_controlled(self.car, type(self).__name__)

    def frame(self) -> Frame:
        """The parts of the vehicle, on soft springs."""
        frame = self.car.frame()
        soft = {"stiffness": CENTRING, "damping": 0.0, "elements": (), "lifts": False}
        return dataclasses.replace(frame, wheels=tuple(dataclasses.replace(wheel, **soft) for wheel in frame.wheels))


@final
class Guide(AbstractPart):
    """What holds a body to the ground: friction of a linear guide, a spring of a cable, a dashpot.

    Its channels begin with `{body}_guide`: `sprung_guide_stroke`, and the force `sprung_guide_friction_force` of the
    law.

    Arguments:
        law: law of the height of the body above the ground, such as `dampers.CoulombFriction`.
        body: name of the body.
        ahead: of the centre of gravity of the body [m], for bodies that pitch.
        stiffness: of a spring to the ground [N/m].
        damping: of a dashpot to the ground [N s/m].
    """

    law: AbstractDamper | None = None
    body: str = eqx.field(static=True, default=SPRUNG)
    ahead: ScalarLike | int | None = None
    stiffness: Number = parameter("N/m", "stiffness of the spring to the ground", nonnegative, default=0.0)
    damping: Number = parameter("N s/m", "coefficient of the dashpot to the ground", nonnegative, default=0.0)

    def link(self, frame: Frame) -> Link:
        """The guide as a link from the ground to its body."""
        elements = () if self.law is None else (Element("friction", self.law),)
        point = frame.body(self.body).at(self.ahead)
        return Link(f"{self.body}_guide", point, self.stiffness, self.damping, elements)


@final
class Guided(AbstractVehicle):
    """A vehicle whose bodies run in guides, or are held to the ground: a quarter-car rig.

    Arguments:
        car: any vehicle without a controller, which goes around this one.
        guides: of its bodies, one for each.

    >>> from jaxdamp.dampers import CoulombFriction
    >>> from jaxdamp.vehicles import presets
    >>> rig = Guided(presets.quarter_car_mathworks(), (Guide(CoulombFriction(30.0, 0.01)),))
    >>> rig.layout.ports
    ('damper', 'sprung_guide_friction')
    """

    car: AbstractVehicle
    guides: tuple[Guide, ...]

    def __check_init__(self) -> None:
        _refuse_controlled(self.car, type(self).__name__)

    def frame(self) -> Frame:
        """The parts of the vehicle and the guides."""
        frame = self.car.frame()
        return dataclasses.replace(frame, links=(*frame.links, *[guide.link(frame) for guide in self.guides]))


def _refuse_controlled(car: AbstractVehicle, around: str) -> None:
    """Refuse a vehicle whose controller would not be seen from outside."""
    _checks.instance("car", car, AbstractVehicle, "be a vehicle", "Such as `vehicles.presets.quarter_car_000()`.")
    if car.passive is not car:
        remedy = f"Put the controller around: `Controlled({around}(vehicle, ...), policy)`."
        _checks.refuse("car", "be without a controller", f"a {type(car).__name__}", remedy)
