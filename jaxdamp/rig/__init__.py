"""The test machine: the force of a law under a prescribed stroke, and what the machine adds to it."""

from jaxdamp.rig.constant_velocity import QuasiStatic, quasi_static
from jaxdamp.rig.machine import Readings, Rig
from jaxdamp.rig.response import AbstractLawEngine, march, respond, solve_law
from jaxdamp.rig.sensor import Sensor


__all__ = [
    "AbstractLawEngine",
    "QuasiStatic",
    "Readings",
    "Rig",
    "Sensor",
    "march",
    "quasi_static",
    "respond",
    "solve_law",
]
