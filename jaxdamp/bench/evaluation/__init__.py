"""Dampers as they are bought and sold: forces at stated velocities, rates, gas force, friction, energy, limits."""

from jaxdamp.bench.evaluation.curve import OEM_VELOCITIES
from jaxdamp.bench.evaluation.evaluate import evaluate
from jaxdamp.bench.evaluation.limits import Limit, LimitCheck, read_limits
from jaxdamp.bench.evaluation.measurements import Measurement
from jaxdamp.bench.evaluation.result import Evaluation
from jaxdamp.bench.evaluation.separation import GasAndFriction, separate_gas_and_friction


__all__ = [
    "OEM_VELOCITIES",
    "Evaluation",
    "GasAndFriction",
    "Limit",
    "LimitCheck",
    "Measurement",
    "evaluate",
    "read_limits",
    "separate_gas_and_friction",
]
