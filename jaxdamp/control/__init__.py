"""Semi-active dampers: a controller that commands the dampers of a vehicle while it drives.

`Controlled(car, policy)` is a vehicle like any other, for `simulate`, `Ride`, `sweep` and `tune`. A policy demands
forces: `Skyhook`, `Groundhook`, `Hybrid`, `AccelerationDriven`, `PowerDriven`, `StateFeedback`, or one of your own
(`AbstractPolicy`). `docs/control.md` shows them at work.
"""

from jaxdamp.control.controlled import Controlled
from jaxdamp.control.loop import (
    Commands as Commands,
    ControlLoop as ControlLoop,
    ControlState as ControlState,
    Flags as Flags,
    Sampler as Sampler,
    laws_at_levels as laws_at_levels,
)
from jaxdamp.control.policies import (
    AbstractPolicy,
    AccelerationDriven,
    Groundhook,
    Hybrid,
    PowerDriven,
    Signals,
    Skyhook,
    StateFeedback,
)


__all__ = [
    "AbstractPolicy",
    "AccelerationDriven",
    "Controlled",
    "Groundhook",
    "Hybrid",
    "PowerDriven",
    "Signals",
    "Skyhook",
    "StateFeedback",
]
