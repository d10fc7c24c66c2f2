"""The test machine: the force of a law under a prescribed stroke, and what the machine adds to it."""

from jaxdamp.rig.constant_velocity import (
    LawNumbers as LawNumbers,
    QuasiStatic as QuasiStatic,
    is_number as is_number,
    numbers_of as numbers_of,
    quasi_static,
)
from jaxdamp.rig.dynamic_stiffness import DynamicStiffness as DynamicStiffness, dynamic_stiffness
from jaxdamp.rig.machine import Readings as Readings, Rig, gas_and_friction as gas_and_friction
from jaxdamp.rig.marching import Followed as Followed, march as march, solve_law as solve_law
from jaxdamp.rig.response import AbstractLawEngine as AbstractLawEngine, StartsInMotionWarning, respond
from jaxdamp.rig.sensor import Sensor


__all__ = [
    "Rig",
    "Sensor",
    "StartsInMotionWarning",
    "dynamic_stiffness",
    "quasi_static",
    "respond",
]
