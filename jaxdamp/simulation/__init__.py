"""A vehicle on a road: `simulate`, its two engines, the `Response`; and `Ride`, which keeps the metrics only."""

from jaxdamp.simulation.response import Response
from jaxdamp.simulation.ride import Ride
from jaxdamp.simulation.run import simulate


__all__ = ["Response", "Ride", "simulate"]
