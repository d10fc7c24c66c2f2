"""A vehicle on a road: `simulate`, its two engines and the `Response`."""

from jaxdamp.simulation.response import Response
from jaxdamp.simulation.run import simulate


__all__ = ["Response", "simulate"]
