"""One function over many points: `jaxdamp.sweep`, and samples to sweep over: `points`, `random`, `sobol`."""

from jaxdamp.sweeps.axes import grid as grid, points, random, sobol, without_effect as without_effect
from jaxdamp.sweeps.block_program import block_program
from jaxdamp.sweeps.function import SweepFunction as SweepFunction
from jaxdamp.sweeps.summary import Summary, SweepSummary as SweepSummary
from jaxdamp.sweeps.sweeping import SweepSettings as SweepSettings, sweep


__all__ = [
    "Summary",
    "block_program",
    "points",
    "random",
    "sobol",
    "sweep",
]
