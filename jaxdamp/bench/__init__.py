"""Dyno records: read from files or made by a virtual dyno, in SI and one sign convention.

Stroke and velocity are positive in extension (rebound), force is positive when it resists extension.
"""

from jaxdamp._guesses import answer_guesses
from jaxdamp.bench import programmes
from jaxdamp.bench.analysis import (
    FoldedCycles,
    PeakVelocityPoints,
    VelocityLoops,
    continuous_velocity_loop,
    fold_cycles,
    last_steady_cycle,
    moving_part,
    peak_velocity_points,
    steady_cycles,
)
from jaxdamp.bench.contradictions import Contradiction, contradictions, contradictions_in_words
from jaxdamp.bench.evaluation import (
    OEM_VELOCITIES,
    Evaluation,
    GasAndFriction,
    Limit,
    LimitCheck,
    Measurement,
    evaluate,
    read_limits,
    separate_gas_and_friction,
)
from jaxdamp.bench.preflight import Finding, Preflight, preflight, usable
from jaxdamp.bench.processing import Steps, low_pass_gain
from jaxdamp.bench.programmes import Excitation, RandomTest, SineTest
from jaxdamp.bench.raw import RawColumn, RawTable
from jaxdamp.bench.read import read, read_rides
from jaxdamp.bench.readers import READERS
from jaxdamp.bench.ride_record import RideRecord
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.sensors import Sensors
from jaxdamp.bench.sets import BenchSet, as_runs
from jaxdamp.bench.velocity import estimate_velocity
from jaxdamp.bench.virtual_dyno import VirtualDyno
from jaxdamp.bench.waveforms import MultiSineTest, TriangleTest


__all__ = [
    "OEM_VELOCITIES",
    "READERS",
    "BenchRun",
    "BenchSet",
    "Contradiction",
    "Evaluation",
    "Excitation",
    "Finding",
    "FoldedCycles",
    "GasAndFriction",
    "Limit",
    "LimitCheck",
    "Measurement",
    "MultiSineTest",
    "PeakVelocityPoints",
    "Preflight",
    "RandomTest",
    "RawColumn",
    "RawTable",
    "RideRecord",
    "Sensors",
    "SineTest",
    "Steps",
    "TriangleTest",
    "VelocityLoops",
    "VirtualDyno",
    "as_runs",
    "continuous_velocity_loop",
    "contradictions",
    "contradictions_in_words",
    "estimate_velocity",
    "evaluate",
    "fold_cycles",
    "last_steady_cycle",
    "low_pass_gain",
    "moving_part",
    "peak_velocity_points",
    "preflight",
    "programmes",
    "read",
    "read_limits",
    "read_rides",
    "separate_gas_and_friction",
    "steady_cycles",
    "usable",
]

answer_guesses(__name__, __all__)
