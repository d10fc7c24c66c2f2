"""A vehicle driven by measured wheel forces instead of a road."""

import dataclasses
from typing import final

from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.frame import Frame


CENTRING = 1.0  # N/m, under each wheel: so soft that forces are what moves the vehicle


@final
class ForceDriven(AbstractVehicle):
    """A vehicle without its tyres, on measured forces: its "road" is the force on each wheel in newtons.

    Each tyre is replaced by a spring of 1 N/m, so that a road of z metres pushes with z newtons. The spring centres the
    vehicle, which an error of the forces would carry away, and changes the force by one newton for each metre of
    motion. Forces are those on the wheels minus the static loads, positive up. Tyres have no part in the motion.

    Arguments:
        car: any vehicle.

    >>> from jaxdamp.vehicles import presets
    >>> ForceDriven(presets.quarter_car_000()).port_form().road_stiffness.tolist()
    [[0.0], [1.0]]
    """

    car: AbstractVehicle

    def frame(self) -> Frame:
        """The parts of the vehicle, on soft springs."""
        frame = self.car.frame()
        soft = {"stiffness": CENTRING, "damping": 0.0, "elements": (), "lifts": False}
        return dataclasses.replace(frame, wheels=tuple(dataclasses.replace(wheel, **soft) for wheel in frame.wheels))
