"""From a dyno file to a better damper, differentiable from end to end."""

from jaxdamp.rig import respond


__all__ = ["respond"]
