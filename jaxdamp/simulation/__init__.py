"""A vehicle on a road: `simulate`, its two engines, the `Response`; and `Ride`, which keeps the metrics only."""

from jaxdamp.simulation.range_notes import named_laws, range_sentences
from jaxdamp.simulation.response import Response
from jaxdamp.simulation.ride import Ride
from jaxdamp.simulation.run import simulate
from jaxdamp.simulation.stationary import DEVIATIONS
from jaxdamp.simulation.step_size import CoarseStepWarning
from jaxdamp.simulation.tables import comfort_table, metrics_table
from jaxdamp.simulation.wheels import AxleTiming, moves_axles


__all__ = [
    "DEVIATIONS",
    "AxleTiming",
    "CoarseStepWarning",
    "Response",
    "Ride",
    "comfort_table",
    "metrics_table",
    "moves_axles",
    "named_laws",
    "range_sentences",
    "simulate",
]
