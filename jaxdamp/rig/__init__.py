"""The test machine: the force of a law under a prescribed stroke, and what the machine adds to it."""

from jaxdamp.rig.constant_velocity import (
    QuasiStatic as QuasiStatic,
    as_warm_as_it_begins as as_warm_as_it_begins,
    quasi_static,
)
from jaxdamp.rig.dynamic_stiffness import DynamicStiffness as DynamicStiffness, dynamic_stiffness
from jaxdamp.rig.law_numbers import LawNumbers as LawNumbers, is_number as is_number
from jaxdamp.rig.machine import Readings as Readings, Rig, gas_and_friction as gas_and_friction
from jaxdamp.rig.marching import Followed as Followed, march as march, solve_law as solve_law
from jaxdamp.rig.printed import (
    PrintedLaw as PrintedLaw,
    WithPrinted as WithPrinted,
    numbers_on_rig as numbers_on_rig,
    plain_rig as plain_rig,
    printed_forces as printed_forces,
    printed_law as printed_law,
    remember as remember,
    say as say,
)
from jaxdamp.rig.printed_records import (
    PRINTED as PRINTED,
    MachinePlaces as MachinePlaces,
    PrintedRecord as PrintedRecord,
    delayed_samples as delayed_samples,
    lagged_samples as lagged_samples,
)
from jaxdamp.rig.response import (
    AbstractLawEngine as AbstractLawEngine,
    ResponseSettings as ResponseSettings,
    StartsInMotionWarning,
    respond,
)
from jaxdamp.rig.sensor import Sensor


__all__ = [
    "Rig",
    "Sensor",
    "StartsInMotionWarning",
    "dynamic_stiffness",
    "quasi_static",
    "respond",
]
