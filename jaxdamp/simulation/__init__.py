"""A vehicle on a road: `simulate`, which gives a `Response`; `Ride`, which gathers its metrics only; and the engines.

Engines are `Exponential` and `Adaptive`; one of your own derives from `AbstractFixedStep` (`docs/own_engine.md`).
"""

from jaxdamp.simulation.adaptive import Adaptive
from jaxdamp.simulation.energy import absorbed_by, energy_balance
from jaxdamp.simulation.engine import AbstractEngine, AbstractObserver as AbstractObserver, Outcome
from jaxdamp.simulation.equations import Equations, RoadInput, StepState, settled
from jaxdamp.simulation.exponential import Exponential
from jaxdamp.simulation.fixed_step import AbstractFixedStep, AbstractStepper
from jaxdamp.simulation.harmonic import HarmonicResponse as HarmonicResponse, harmonic_response
from jaxdamp.simulation.observer import MetricObserver as MetricObserver
from jaxdamp.simulation.range_notes import named_laws as named_laws, range_sentences as range_sentences
from jaxdamp.simulation.recorder import recorded as recorded
from jaxdamp.simulation.response import Response
from jaxdamp.simulation.ride import Ride
from jaxdamp.simulation.ride_metrics import comfort, ride_metrics
from jaxdamp.simulation.run import simulate
from jaxdamp.simulation.stability import substeps_needed
from jaxdamp.simulation.stationary import DEVIATIONS as DEVIATIONS, stationary_notes as stationary_notes
from jaxdamp.simulation.step_size import CoarseStepWarning, RunCheck as RunCheck, TracedStepWarning
from jaxdamp.simulation.tables import comfort_table, metrics_table
from jaxdamp.simulation.wheels import AxleTiming as AxleTiming, moves_axles as moves_axles


__all__ = [
    "AbstractEngine",
    "AbstractFixedStep",
    "AbstractStepper",
    "Adaptive",
    "CoarseStepWarning",
    "Equations",
    "Exponential",
    "Outcome",
    "Response",
    "Ride",
    "RoadInput",
    "StepState",
    "TracedStepWarning",
    "absorbed_by",
    "comfort",
    "comfort_table",
    "energy_balance",
    "harmonic_response",
    "metrics_table",
    "ride_metrics",
    "settled",
    "simulate",
    "substeps_needed",
]
# What the other packages of the library import, and what is only returned: a user writes none of these.
__shared__ = [
    "DEVIATIONS",
    "AbstractObserver",
    "AxleTiming",
    "HarmonicResponse",
    "MetricObserver",
    "RunCheck",
    "moves_axles",
    "named_laws",
    "range_sentences",
    "recorded",
    "stationary_notes",
]
