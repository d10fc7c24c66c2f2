"""What explains the records of a vehicle: the vehicle, its sensors, how it begins, the bench of its damper."""

from typing import final

from jaxdamp._types import Vector
from jaxdamp.parameters import Module, check_parameters, parameter, readable
from jaxdamp.rig import Rig, Sensor
from jaxdamp.vehicles import AbstractVehicle


@final
class InitialMotion(Module):
    """How a record begins: displacements and rates of all coordinates, beside rest on the first heights.

    Arguments:
        position: displacement of each coordinate from the equilibrium [m, rad].
        rate: rate of each coordinate [m/s, rad/s].
    """

    position: Vector = parameter("", "displacement of a coordinate at the first sample, in m or rad")
    rate: Vector = parameter("", "rate of a coordinate at the first sample, in m/s or rad/s")

    def __check_init__(self) -> None:
        check_parameters(self)


@final
class VehicleTest(Module):
    """A vehicle with the sensors of its records; paths of parameters begin with `vehicle.`, `sensors.` and so on.

    Arguments:
        vehicle: the vehicle.
        sensors: the sensor of a channel, by the channel's name; channels without one are shown as they are.
        starts: the initial motion of each record; empty if all begin at rest.
        rig: the test machine of the bench records of its damper, if it adds to the force.
    """

    vehicle: AbstractVehicle
    sensors: dict[str, Sensor]
    starts: tuple[InitialMotion, ...] = ()
    rig: Rig | None = None

    def __repr__(self) -> str:
        return readable(self)
