"""From a dyno file to a better damper, differentiable from end to end."""

from jaxdamp.rig import respond
from jaxdamp.simulation import Response, simulate


__all__ = ["Response", "respond", "simulate"]
