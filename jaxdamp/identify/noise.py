"""The noise of the measured force, estimated from the residual of a fit: its size and correlation."""

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd


CORRELATED = 3.0  # samples per independent sample above which the residual counts as correlated


def noise_of(
    problem: Problem, found: SearchEnd, force_noise: float | None
) -> tuple[Float[np.ndarray, " samples"], float]:
    """Standard deviation of each weighted residual, and the factor on it due to correlation.

    Correlated samples contain less information than independent ones. If more than `CORRELATED` samples correspond to
    one independent sample, the standard deviation is multiplied by the root of this number, which increases the
    standard errors accordingly.

    Arguments:
        problem: the problem that was minimised.
        found: the minimum.
        force_noise: standard deviation of the measured force [N], if it is known, as independent noise.
    """
    owner, used, sigma = problem.owner, problem.used, problem.sigma
    if force_noise is not None:
        return _with_priors(force_noise / np.array(sigma)[owner], used), 1.0
    dof = max(int(np.count_nonzero(used)) - found.values.size, 1)
    counted = correlation_time([found.residual[used & (owner == i)] for i in np.unique(owner[used])])
    alike = counted > CORRELATED and not problem.is_rounding(found.squares)
    inflation = float(np.sqrt(counted)) if alike else 1.0
    residual = np.where(used, found.residual, 0.0)
    shown = _from_residual(residual, used, owner, len(sigma), dof, problem.each)
    return _with_priors(problem.noise_factor * inflation * shown, used), inflation


def _with_priors(noise: Float[np.ndarray, " samples"], used: Bool[np.ndarray, " samples"]) -> np.ndarray:
    """The mean noise of the records for all other residuals, which are priors or have no weight."""
    return np.where(used, noise, np.mean(noise[used]))


def _from_residual(
    residual: Float[np.ndarray, " samples"],
    used: Bool[np.ndarray, " samples"],
    owner: np.ndarray,
    runs: int,
    dof: int,
    each: bool,
) -> Float[np.ndarray, " samples"]:
    """Standard deviation of each weighted residual, common to all records or (`each`) separate for each."""
    count = np.bincount(owner, used, minlength=runs)
    squares = np.bincount(owner, residual**2, minlength=runs) * (count.sum() / dof)
    if not each:
        return np.full(residual.size, np.sqrt(squares.sum() / count.sum()))
    return np.sqrt(squares / np.maximum(count, 1))[owner]


def correlation_time(residuals: list[Float[np.ndarray, " _"]]) -> float:
    """Number of samples per independent sample, 1 + 2 Σ ρ(k), 1 for white noise.

    ρ is the autocorrelation over all records, summed up to its first zero or negative value.
    """
    length = max(map(len, residuals))
    total = np.zeros(length)
    for residual in residuals:
        spectrum = np.fft.rfft(residual, 2 * len(residual))
        total[: len(residual)] += np.fft.irfft(np.abs(spectrum) ** 2, 2 * len(residual))[: len(residual)]
    if not total[0] > 0:
        return 1.0
    alike = total / total[0]
    ends = np.flatnonzero(alike <= 0)
    return float(1.0 + 2.0 * np.sum(alike[1 : ends[0] if ends.size else None]))
