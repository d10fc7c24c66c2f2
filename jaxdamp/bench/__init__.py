"""Dyno records: read from files or made by a virtual dyno, in SI and one sign convention.

Stroke and velocity are positive in extension (rebound), force is positive when it resists extension.
"""

from jaxdamp._guesses import answer_guesses
from jaxdamp.bench import programmes
from jaxdamp.bench.analysis import (
    FoldedCycles as FoldedCycles,
    PeakVelocityPoints as PeakVelocityPoints,
    VelocityLoops as VelocityLoops,
    continuous_velocity_loop,
    fold_cycles as fold_cycles,
    last_steady_cycle as last_steady_cycle,
    moving_part as moving_part,
    peak_velocity_points,
    steady_cycles as steady_cycles,
)
from jaxdamp.bench.contradictions import (
    Contradiction as Contradiction,
    contradictions,
    contradictions_in_words as contradictions_in_words,
    pairs_in_words as pairs_in_words,
)
from jaxdamp.bench.damper_records import DamperRecords, read_dampers
from jaxdamp.bench.evaluation.curve import OEM_VELOCITIES as OEM_VELOCITIES, Measurement as Measurement
from jaxdamp.bench.evaluation.evaluate import evaluate
from jaxdamp.bench.evaluation.limits import Limit, LimitCheck as LimitCheck, read_limits
from jaxdamp.bench.evaluation.result import Evaluation as Evaluation
from jaxdamp.bench.evaluation.separation import GasAndFriction as GasAndFriction, separate_gas_and_friction
from jaxdamp.bench.force_velocity import ForceVelocityTable as ForceVelocityTable, are_tables as are_tables, read_table
from jaxdamp.bench.kinematics import Kinematics as Kinematics, read_kinematics
from jaxdamp.bench.motion import white_noise as white_noise
from jaxdamp.bench.preflight.check import Preflight as Preflight, preflight, usable as usable
from jaxdamp.bench.preflight.finding import Finding as Finding, clock_jitter as clock_jitter, mains_lines as mains_lines
from jaxdamp.bench.processing import Steps, low_pass_gain
from jaxdamp.bench.programmes import Excitation as Excitation, RandomTest, SineTest
from jaxdamp.bench.raw import RawColumn, RawTable
from jaxdamp.bench.read import read, read_rides
from jaxdamp.bench.readers import READERS, BenchFiles as BenchFiles, Files as Files
from jaxdamp.bench.ride_record import RideRecord
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.sensors import Sensors
from jaxdamp.bench.sets import BenchSet, as_runs as as_runs
from jaxdamp.bench.settings import (
    by_number as by_number,
    initial_temperature as initial_temperature,
    number_and_unit as number_and_unit,
    refuse_misspelt as refuse_misspelt,
    settings_apart as settings_apart,
)
from jaxdamp.bench.units import ratio as ratio
from jaxdamp.bench.velocity import estimate_velocity
from jaxdamp.bench.virtual_dyno import VirtualDyno
from jaxdamp.bench.waveforms import CommandedExcitation as CommandedExcitation, CommandStep, MultiSineTest, TriangleTest


__all__ = [
    "READERS",
    "BenchRun",
    "BenchSet",
    "CommandStep",
    "DamperRecords",
    "Limit",
    "MultiSineTest",
    "RandomTest",
    "RawColumn",
    "RawTable",
    "RideRecord",
    "Sensors",
    "SineTest",
    "Steps",
    "TriangleTest",
    "VirtualDyno",
    "continuous_velocity_loop",
    "contradictions",
    "estimate_velocity",
    "evaluate",
    "low_pass_gain",
    "peak_velocity_points",
    "preflight",
    "programmes",
    "read",
    "read_dampers",
    "read_kinematics",
    "read_limits",
    "read_rides",
    "read_table",
    "separate_gas_and_friction",
]

answer_guesses(__name__, __all__)
