"""Dampers as they are bought and sold: forces at stated velocities, rates, gas force, friction, energy, limits."""

from jaxdamp.bench.evaluation.curve import OEM_VELOCITIES as OEM_VELOCITIES, Measurement as Measurement
from jaxdamp.bench.evaluation.evaluate import evaluate as evaluate
from jaxdamp.bench.evaluation.limits import (
    Limit as Limit,
    LimitCheck as LimitCheck,
    read_limits as read_limits,
)
from jaxdamp.bench.evaluation.result import Evaluation as Evaluation
from jaxdamp.bench.evaluation.separation import (
    GasAndFriction as GasAndFriction,
    separate_gas_and_friction as separate_gas_and_friction,
)
