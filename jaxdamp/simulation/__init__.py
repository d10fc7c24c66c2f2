"""A vehicle on a road: `simulate`, which gives a `Response`; `Ride`, which gathers its metrics only; and the engines.

Engines are `Exponential` and `Adaptive`; one of your own derives from `AbstractFixedStep` (`docs/own_engine.md`).
"""

from jaxdamp.simulation.adaptive import Adaptive
from jaxdamp.simulation.energy import absorbed_by as absorbed_by, energy_balance
from jaxdamp.simulation.engine import AbstractEngine, AbstractObserver as AbstractObserver, Outcome as Outcome
from jaxdamp.simulation.equations import Equations, RoadInput, StepState as StepState, settled
from jaxdamp.simulation.exponential import Exponential
from jaxdamp.simulation.fixed_step import AbstractFixedStep
from jaxdamp.simulation.harmonic import HarmonicResponse as HarmonicResponse, harmonic_response
from jaxdamp.simulation.many_designs import Designs as Designs
from jaxdamp.simulation.notes import (
    far_outside as far_outside,
    named_laws as named_laws,
    over_runs as over_runs,
    range_sentences as range_sentences,
)
from jaxdamp.simulation.observer import MetricObserver as MetricObserver, recorded as recorded
from jaxdamp.simulation.response import Response as Response
from jaxdamp.simulation.ride import Ride
from jaxdamp.simulation.ride_metrics import (
    comfort,
    comfort_table as comfort_table,
    metrics_table as metrics_table,
    ride_metrics,
)
from jaxdamp.simulation.run import simulate
from jaxdamp.simulation.settings import (
    RUN as RUN,
    SIMULATION as SIMULATION,
    Run as Run,
    SimulationSettings as SimulationSettings,
)
from jaxdamp.simulation.stability import MOST as MOST, substeps_needed
from jaxdamp.simulation.stationary import (
    DEVIATIONS as DEVIATIONS,
    refuse_without_stationary_motion as refuse_without_stationary_motion,
    stationary_notes as stationary_notes,
)
from jaxdamp.simulation.step_size import CoarseStepWarning, RunCheck as RunCheck, TracedStepWarning
from jaxdamp.simulation.stepper import AbstractStepper, ControlledStepper as ControlledStepper, Controller as Controller
from jaxdamp.simulation.wheels import (
    AxleTiming as AxleTiming,
    axle_timing as axle_timing,
    moves_axles as moves_axles,
)


__all__ = [
    "AbstractEngine",
    "AbstractFixedStep",
    "AbstractStepper",
    "Adaptive",
    "CoarseStepWarning",
    "Equations",
    "Exponential",
    "Ride",
    "RoadInput",
    "TracedStepWarning",
    "comfort",
    "energy_balance",
    "harmonic_response",
    "ride_metrics",
    "settled",
    "simulate",
    "substeps_needed",
]
