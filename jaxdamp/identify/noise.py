"""The noise of the measured force, estimated from the residual of a fit: its size and its autocorrelation."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.special
from jaxtyping import Bool, Float, Int

from jaxdamp._triangles import orthonormal, unit_columns
from jaxdamp.identify.problem import Problem, Robust
from jaxdamp.identify.search import SearchEnd


BY_CHANCE = 1e-4  # probability of levels that differ as much
CORRELATED = 3.0  # samples per independent sample above which residuals are called alike
REPEATED = 0.3  # correlation of the residual with itself one cycle later above which the law misses something
LEAST_OVERLAP = 0.5  # of a cycle, of a record with itself one cycle later
MOST_COEFFICIENTS = 30  # of an autoregression
FEWEST_SAMPLES = 10  # for each coefficient
BLOCK = 64  # lags of an autocorrelation that follow from the last ones in one product
PARTS = 8  # of a cycle, that are left out in turn
FEWEST_RECORDS = 3  # to be left out in turn
PENALTY = 2.0  # decrease of the deviance that each coefficient must give, in logarithms of the number of samples


class Noise(NamedTuple):
    """A model of the noise in the weighted residual of a fit.

    Attributes:
        sigma: standard deviation of each sample; a systematic residual is inflated by its correlation time.
        records: the samples of each record.
        correlations: autocorrelation ρ(0), ρ(1), … of the noise of each record; of length one if it is white.
        variance: of a sample, times the square of the inflation.
        dof: degrees of freedom of the estimated variance, for Student's t.
        inflation: factor on the standard errors due to autocorrelation, root of the mean over the directions of the
            parameters.
        systematic: whether the residual repeats from cycle to cycle.
        root: factor on the rows of derivatives, of a robust loss (`Robust`).
    """

    sigma: Float[np.ndarray, " samples"]
    records: tuple[Int[np.ndarray, " _"], ...]
    correlations: tuple[Float[np.ndarray, " _"], ...]
    variance: float
    dof: float
    inflation: float = 1.0
    systematic: bool = False
    root: Float[np.ndarray, " samples"] | float = 1.0

    @property
    def by_sample(self) -> Float[np.ndarray, " samples"]:
        """The standard deviation beside which each weighted residual counts."""
        return self.sigma / self.root

    @property
    def level(self) -> float:
        """Standard deviation of a sample with its memory, beside which priors count."""
        rows = np.concatenate(self.records)
        shown, whole = _mean_square(self.by_sample[rows]), _mean_square(self.sigma[rows])
        return float(np.sqrt(self.variance * (whole / shown if shown > 0 else 1.0)))

    def with_sigma(self, sigma: Float[np.ndarray, " samples"]) -> "Noise":
        """The same with these standard deviations, which contain the inflation."""
        return self._replace(sigma=sigma, variance=_mean_square(sigma[np.concatenate(self.records)]))

    def covariance_of(self, matrix: Float[np.ndarray, "samples free"]) -> Float[np.ndarray, "free free"]:
        """Aᵀ Σ A with the covariance Σ of the noise: the covariance of the products Aᵀ noise."""
        noisy = matrix * self.sigma[:, None]
        total = noisy.T @ noisy
        for rows, alike in zip(self.records, self.correlations, strict=True):
            if alike.size > 1:
                part = noisy[rows]
                total += part.T @ (_toeplitz_product(alike, part) - part)
        return total

    def of_loss(self, robust: Robust | None, used: Bool[np.ndarray, " samples"]) -> "Noise":
        """The same beside a robust loss; residuals that are not used, priors, have the level of a sample."""
        if robust is not None:
            sigma, before = robust.factor * self.sigma, _mean_square(self.sigma[used])
            wider = _mean_square((sigma / robust.root)[used]) / before if before > 0 else 1.0
            self = self._replace(sigma=sigma, variance=wider * self.variance, root=robust.root)
        return self._replace(sigma=np.where(used, self.sigma, self.level))


def _mean_square(values: Float[np.ndarray, " _"]) -> float:
    return float(np.mean(values**2))


def independent(sigma: Float[np.ndarray, " samples"], used: Bool[np.ndarray, " samples"], free: int) -> Noise:
    """White noise of these standard deviations."""
    rows = np.flatnonzero(used)
    return Noise(sigma, (rows,), (np.ones(1),), 1.0, float(max(rows.size - free, 1))).with_sigma(sigma)


def noise_of(problem: Problem, minimum: SearchEnd, force_noise: float | None) -> Noise:
    """The noise of all residuals; that of records as `_noise_of_records`, that of priors at its level."""
    robust = problem.robust if force_noise is None else None
    return _noise_of_records(problem, minimum, force_noise).of_loss(robust, problem.used)


def _noise_of_records(problem: Problem, minimum: SearchEnd, force_noise: float | None) -> Noise:
    """The noise in the residual of a fit.

    The residual of each record gets an autoregression (Yule-Walker), whose order minimises a criterion like Schwarz's
    with `PENALTY` times its penalty. If all orders are zero, the noise is white, with one level for all records, or
    one for each if their levels differ by more than chance, or the problem or a robust loss weights them so. Otherwise:

    - If the residual repeats from cycle to cycle, it is no noise: the law misses something. It then counts as white
      noise of so few samples as its correlation time leaves, which is the most that its errors can be.
    - Else each record has its own level and autocorrelation. The fit removes some of the noise from the residual: with
      the projection P on the derivatives, the sum of squares has the mean tr Σ − tr PΣ, by which Σ is corrected, and
      Student's t has (tr Σ − tr PΣ) tr Σ / tr Σ² degrees of freedom (Satterthwaite), N − p for white noise.
    """
    owner, used, sigma = problem.owner, problem.used, np.array(problem.sigma)
    records = tuple(np.flatnonzero(used & (owner == i)) for i in range(sigma.size))
    parts = [minimum.residual[rows] for rows in records]
    count = int(np.count_nonzero(used))
    white = independent(np.ones(used.size), used, minimum.values.size)
    if force_noise is not None:
        return white.with_sigma(np.where(used, force_noise / sigma[owner], 1.0))
    correlations = [np.ones(1)] if problem.is_rounding(minimum.squares) else [autocorrelation(part) for part in parts]
    is_white = all(alike.size == 1 for alike in correlations)
    if is_white or repeats(problem, parts):
        each = problem.each or own_levels(problem.robust) or (is_white and levels_differ(problem, parts))
        level = np.sqrt(count / white.dof) * _levels(minimum.residual, records, each)
        if is_white:
            return white.with_sigma(level)
        counted = max(correlation_time([part for part in parts if part.size]), 1.0)
        few = white._replace(dof=max(count / counted - minimum.values.size, 1.0), inflation=float(np.sqrt(counted)))
        return few._replace(systematic=True).with_sigma(np.sqrt(counted) * level)
    noise = Noise(_levels(minimum.residual, records, True), records, tuple(correlations), 0.0, 1.0)
    return _corrected(noise, orthonormal(np.where(used[:, None], minimum.jacobian, 0.0)))


def own_levels(robust: Robust | None) -> bool:
    """Whether records have their own levels because of a robust loss."""
    return robust is not None and robust.each


def levels_differ(problem: Problem, parts: Sequence[Float[np.ndarray, " _"]]) -> bool:
    """Whether the levels of white noise in several records differ by more than chance (Bartlett's test).

    Not of the residuals of a robust fit, whose spikes are no normal noise.
    """
    parts = [part for part in parts if part.any()]
    if len(parts) < 2 or problem.robust is not None:
        return False
    counts, squares = np.array([(part.size, part @ part) for part in parts]).T
    statistic = counts.sum() * np.log(squares.sum() / counts.sum()) - counts @ np.log(squares / counts)
    return bool(statistic > scipy.special.chdtri(counts.size - 1, BY_CHANCE))


def channel_noise(problem: Problem, residual: Float[np.ndarray, " samples"], free: int) -> Noise:
    """The noise of a vehicle: a level for each channel, inflated where over `CORRELATED` samples are alike."""
    used, owner = problem.used, problem.owner
    parts = {int(i): residual[used & (owner == i)] for i in np.unique(owner[used])}
    counted = correlation_time(list(parts.values()))
    alike = counted > CORRELATED and not problem.is_rounding(float(residual @ residual))
    inflation, total = float(np.sqrt(counted)) if alike else 1.0, np.count_nonzero(used)
    widened = inflation * np.sqrt(total / max(total - free, 1))
    sigma = np.ones(residual.size)
    for i, part in parts.items():
        sigma[owner == i] = widened * np.sqrt(np.mean(part**2))
    noise = independent(sigma, used, free)._replace(inflation=inflation)
    return noise.of_loss(problem.robust, used)


def _corrected(noise: Noise, basis: Float[np.ndarray, "samples rank"]) -> Noise:
    """Noise from a residual, corrected for what a fit with these directions has removed from it."""
    removed, whole = float(np.trace(noise.covariance_of(basis))), float(np.sum(noise.sigma**2))
    count = sum(rows.size for rows in noise.records)
    squares = sum(_squares(noise.sigma[r], a) for r, a in zip(noise.records, noise.correlations, strict=True))
    left = max(whole - removed, squares / whole)
    inflation = max(removed / basis.shape[1] / (whole / count), 1.0)
    return noise._replace(
        sigma=noise.sigma * np.sqrt(whole / left),
        variance=inflation * whole**2 / left / count,
        dof=left * whole / squares,
        inflation=float(np.sqrt(inflation)),
    )


def _levels(residual: np.ndarray, records: Sequence[np.ndarray], each: bool) -> Float[np.ndarray, " samples"]:
    """Root of the mean square of the residual, of all records together or (`each`) of each."""
    level = np.zeros(residual.size)
    for rows in records if each else [np.concatenate(records)]:
        level[rows] = np.sqrt(np.mean(residual[rows] ** 2)) if rows.size else 0.0
    return level


def _toeplitz_product(first: Float[np.ndarray, " _"], matrix: Float[np.ndarray, "rows free"]) -> np.ndarray:
    """A matrix multiplied by the symmetric Toeplitz matrix with this first column."""
    if first.size == 1:
        return matrix
    count = len(matrix)
    length = 1 << (2 * count - 1).bit_length()  # a power of two
    circulant = np.zeros(length)
    circulant[:count], circulant[length - count + 1 :] = first, first[:0:-1]
    spectrum = np.fft.rfft(circulant).real[:, None]
    return np.fft.irfft(spectrum * np.fft.rfft(matrix, length, axis=0), length, axis=0)[:count]


def _squares(sigma: Float[np.ndarray, " _"], alike: Float[np.ndarray, " _"]) -> float:
    """Trace of Σ² of a record with one level: the sum of the squared elements of Σ."""
    if not sigma.size:
        return 0.0
    pairs = 2.0 * np.arange(sigma.size - 1, sigma.size - alike.size, -1)
    return float(sigma[0] ** 4 * (sigma.size + pairs @ alike[1:] ** 2))


def _products(residual: Float[np.ndarray, " samples"]) -> Float[np.ndarray, " samples"]:
    """Σ r(t) r(t + k) for every lag k."""
    length = 1 << (2 * residual.size).bit_length()
    return np.fft.irfft(np.abs(np.fft.rfft(residual, length)) ** 2, length)[: residual.size]


def autocorrelation(residual: Float[np.ndarray, " samples"]) -> Float[np.ndarray, " lags"]:
    """Autocorrelation ρ(0), ρ(1), … of the autoregression of a residual, for all its lags; [1] for white noise."""
    count = residual.size
    order = min(MOST_COEFFICIENTS, count // FEWEST_SAMPLES)
    products = _products(residual) if order else np.zeros(1)
    if not products[0] > 0:
        return np.ones(1)
    correlation = products / products[0]
    coefficients, best, error, least = np.ones(1), np.ones(1), 1.0, 0.0
    for k in range(1, order + 1):
        reflection = -float(coefficients @ correlation[k:0:-1]) / error
        padded = np.append(coefficients, 0.0)
        coefficients, error = padded + reflection * padded[::-1], error * (1.0 - reflection**2)
        criterion = count * np.log(max(error, np.finfo(float).tiny)) + PENALTY * k * np.log(count)
        best, least = (coefficients, criterion) if criterion < least else (best, least)
    if best.size == 1:
        return best
    correlation = correlation[: best.size]  # the first lags are those of the residual, the others follow from them
    return _continued(correlation, best, count)


def _continued(
    first: Float[np.ndarray, " _"], coefficients: Float[np.ndarray, " _"], count: int
) -> Float[np.ndarray, " lags"]:
    """Numbers that go on as an autoregression without noise, Σ a(j) x(k − j) = 0, in blocks."""
    order = coefficients.size - 1
    by_last = np.vstack([np.eye(order), np.zeros((BLOCK, order))])  # each number as a sum of the last ones before it
    for k in range(order, order + BLOCK):
        by_last[k] = -coefficients[:0:-1] @ by_last[k - order : k]
    values = np.append(first, np.zeros(-(-(count - first.size) // BLOCK) * BLOCK))
    for begin in range(first.size, values.size, BLOCK):
        values[begin : begin + BLOCK] = by_last[order:] @ values[begin - order : begin]
    return values[:count]


def correlation_time(residuals: Sequence[Float[np.ndarray, " _"]]) -> float:
    """Number of samples per independent sample, 1 + 2 Σ ρ(k), 1 for white noise.

    ρ is the autocorrelation over all records, summed up to its first zero or negative value.
    """
    total = np.zeros(max(map(len, residuals)))
    for residual in residuals:
        total[: len(residual)] += _products(residual)
    if not total[0] > 0:
        return 1.0
    alike = total / total[0]
    ends = np.flatnonzero(alike <= 0)
    return float(1.0 + 2.0 * np.sum(alike[1 : ends[0] if ends.size else None]))


def repeats(problem: Problem, residuals: Sequence[Float[np.ndarray, " _"]]) -> bool:
    """Whether the residual returns from cycle to cycle; yes if no record is long enough to tell."""
    alike, size = 0.0, 0.0
    for run, step, residual in zip(problem.runs, problem.sample_steps, residuals, strict=True):
        cycle = round(1.0 / (step * run.frequency)) if run.frequency > 0 else residual.size
        if residual.size >= (1.0 + LEAST_OVERLAP) * cycle:
            early, late = residual[:-cycle], residual[cycle:]
            alike, size = alike + float(early @ late), size + 0.5 * float(early @ early + late @ late)
    return alike >= REPEATED * size


def spread_over_parts(problem: Problem, minimum: SearchEnd) -> list[float]:
    """The standard error of each free number with what the law misses, by the jackknife.

    Without one part of the records, one Gauss-Newton step from the minimum gives the numbers θ₍b₎; their error is
    √((B − 1)/B Σ (θ₍b₎ − mean)²), the bootstrap's to first order. Parts are the eighths of the cycles of each record,
    all cycles together since what a law misses returns in each, and the records where there are three or more; the
    larger error counts. It says how much the numbers depend on which motion was measured, not how far the law is from
    the damper.
    """
    scaled, scale = unit_columns(minimum.jacobian)
    part, record = np.full(problem.owner.size, -1), np.where(problem.used, problem.owner, -1)
    for i, run in enumerate(problem.runs):
        at = np.flatnonzero(record == i)
        cycle = 1.0 / (problem.sample_steps[i] * run.frequency) if run.frequency > 0 else float(at.size)
        part[at] = PARTS * i + (PARTS * (np.arange(at.size) % cycle) / max(cycle, 1.0)).astype(int).clip(0, PARTS - 1)
    errors = [_jackknife(scaled, minimum.residual, part)]
    if np.unique(record[record >= 0]).size >= FEWEST_RECORDS:
        errors.append(_jackknife(scaled, minimum.residual, record))
    return [float(error) for error in np.max(errors, axis=0) / scale]


def _jackknife(jacobian: np.ndarray, residual: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Standard errors by leaving out each part in turn; samples of a negative part are never left out."""
    whole, right = jacobian.T @ jacobian, jacobian.T @ residual
    steps = []
    for number in np.unique(part[part >= 0]):
        rows = part == number
        left = whole - jacobian[rows].T @ jacobian[rows]
        steps.append(-np.linalg.lstsq(left, right - jacobian[rows].T @ residual[rows], rcond=1e-10)[0])
    values = np.array(steps)
    return np.sqrt((len(steps) - 1) * np.mean((values - values.mean(axis=0)) ** 2, axis=0))
