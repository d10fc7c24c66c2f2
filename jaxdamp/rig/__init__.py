"""The test machine: the force of a law under a prescribed stroke, and what the machine adds to it."""

from jaxdamp.rig.constant_velocity import QuasiStatic, quasi_static
from jaxdamp.rig.machine import Readings, Rig
from jaxdamp.rig.marching import march, solve_law
from jaxdamp.rig.response import AbstractLawEngine, StartsInMotionWarning, respond
from jaxdamp.rig.sensor import Sensor


__all__ = [
    "AbstractLawEngine",
    "QuasiStatic",
    "Readings",
    "Rig",
    "Sensor",
    "StartsInMotionWarning",
    "march",
    "quasi_static",
    "respond",
    "solve_law",
]
