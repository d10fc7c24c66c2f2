"""The noise in the residual of a vehicle: each channel has its own level and correlation."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.identify.noise import CORRELATED, correlation_time
from jaxdamp.identify.problem import Problem


class ChannelNoise(NamedTuple):
    """The noise of the weighted residual.

    Attributes:
        sigma: standard deviation of each sample, which contains the inflation.
        inflation: factor on the standard errors because residuals are alike from sample to sample; 1 if they are not.
    """

    sigma: Float[np.ndarray, " samples"]
    inflation: float


def channel_noise(problem: Problem, residual: Float[np.ndarray, " samples"], free: int) -> ChannelNoise:
    """The standard deviation of each channel, inflated where more than `CORRELATED` samples count as one.

    Arguments:
        problem: the problem that was solved.
        residual: the weighted residual.
        free: count of free numbers, for the degrees of freedom.
    """
    used, owner = problem.used, problem.owner
    parts = {int(i): residual[used & (owner == i)] for i in np.unique(owner[used])}
    counted = correlation_time(list(parts.values()))
    alike = counted > CORRELATED and not problem.is_rounding(float(residual @ residual))
    inflation, total = float(np.sqrt(counted)) if alike else 1.0, np.count_nonzero(used)
    widened = inflation * np.sqrt(total / max(total - free, 1))
    sigma = np.ones(residual.size)
    for i, part in parts.items():
        sigma[owner == i] = widened * np.sqrt(np.mean(part**2))
    return ChannelNoise(sigma, inflation)
