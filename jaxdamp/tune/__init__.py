"""From a ride metric to a better damper: `minimise`."""

from jaxdamp.tune.minimising import minimise
from jaxdamp.tune.result import Change, TuneResult


__all__ = ["Change", "TuneResult", "minimise"]
