"""Semi-active dampers: a controller that commands the dampers of a vehicle while it drives.

`Controlled(car, policy)` is a vehicle like any other, for `simulate`, `Ride`, `sweep` and `tune`. A policy demands
forces: `Skyhook`, `BandSkyhook`, `ModalSkyhook`, `Groundhook`, `HybridHook`, `AccelerationDriven`, `PowerDriven`,
`StateFeedback`, or one of your own (`AbstractPolicy`); of all dampers together `Preview`, `VehicleFeedback`, or one of
your own (`AbstractVehiclePolicy`). `lqr` finds the gains of a linear feedback. `docs/control.md` shows them at work.
"""

from jaxdamp.control.actuator import RateLimit
from jaxdamp.control.controlled import Controlled
from jaxdamp.control.levels import laws_at_levels as laws_at_levels, outer_forces as outer_forces
from jaxdamp.control.loop import (
    Commands as Commands,
    ControlLoop as ControlLoop,
    ControlState as ControlState,
    Flags as Flags,
    Sampler as Sampler,
    where as where,
)
from jaxdamp.control.optimal import lqr
from jaxdamp.control.policies import (
    AbstractPolicy,
    AccelerationDriven,
    BandSkyhook,
    Groundhook,
    HybridHook,
    ModalSkyhook,
    PowerDriven,
    Signals,
    Skyhook,
    StateFeedback,
)
from jaxdamp.control.sensors import Differentiated, Integrated, Sensors, SignalSensor, Subtracted
from jaxdamp.control.together import AbstractVehiclePolicy, Preview, VehicleFeedback


__all__ = [
    "AbstractPolicy",
    "AbstractVehiclePolicy",
    "AccelerationDriven",
    "BandSkyhook",
    "Controlled",
    "Differentiated",
    "Groundhook",
    "HybridHook",
    "Integrated",
    "ModalSkyhook",
    "PowerDriven",
    "Preview",
    "RateLimit",
    "Sensors",
    "SignalSensor",
    "Signals",
    "Skyhook",
    "StateFeedback",
    "Subtracted",
    "VehicleFeedback",
    "lqr",
]
