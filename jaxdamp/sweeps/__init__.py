"""One function over many points: `jaxdamp.sweep`, and samples to sweep over: `points`, `random`, `sobol`."""

from jaxdamp.sweeps.axes import points, random, sobol
from jaxdamp.sweeps.effects import without_effect
from jaxdamp.sweeps.function import SweepFunction
from jaxdamp.sweeps.running import sweep


__all__ = ["SweepFunction", "points", "random", "sobol", "sweep", "without_effect"]
