"""Control charts of a production line: individual values (Shewhart), EWMA and CUSUM, with their average run lengths."""

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar, final

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks


NODES = 96  # of the quadrature by which run lengths are computed
Values = Float[np.ndarray, " dampers"]


class AbstractChart(ABC):
    """A chart of numbers with the mean 0 and the standard deviation 1 while the process is in control."""

    name: ClassVar[str]  # as it is called

    @abstractmethod
    def statistics(self, scores: Values) -> tuple[Values, Values]:
        """What is drawn, above and below the centre, after each number; numbers that are missing change nothing.

        Arguments:
            scores: distances from the centre in standard deviations, NaN or infinite where there is none.
        """

    @property
    @abstractmethod
    def limit(self) -> float:
        """From which size a statistic is a signal, in standard deviations."""

    @abstractmethod
    def average_run_length(self, shift: float = 0.0) -> float:
        """Mean number of dampers until a signal, if the mean has shifted by so many standard deviations.

        For independent normal numbers whose mean and standard deviation are known, from the centre on.

        Arguments:
            shift: of the mean; 0 gives the run length between false alarms.
        """


@final
@dataclasses.dataclass(frozen=True)
class Shewhart(AbstractChart):
    """Individual values, with limits at `width` standard deviations: for single large deviations.

    Arguments:
        width: of the limits on each side, 3 as a rule.

    >>> round(Shewhart().average_run_length(), 1), round(Shewhart().average_run_length(1.0), 1)
    (370.4, 43.9)
    """

    name: ClassVar[str] = "individuals"
    width: float = 3.0

    def __post_init__(self) -> None:
        _checks.positive("width", self.width)

    def statistics(self, scores: Values) -> tuple[Values, Values]:
        """The numbers themselves."""
        return scores, scores

    @property
    def limit(self) -> float:
        """The width."""
        return self.width

    def average_run_length(self, shift: float = 0.0) -> float:
        """1/P(signal)."""
        return 1.0 / (_normal(shift - self.width) + _normal(-shift - self.width))


@final
@dataclasses.dataclass(frozen=True)
class Ewma(AbstractChart):
    """Exponentially weighted moving average z = λ x + (1 − λ) z, with limits ± L √(λ/(2 − λ)): for slow drift.

    The limits are those of a long line from the first damper on (ISO 7870-6; Lucas and Saccucci, Technometrics 1990).

    Arguments:
        weight: λ, of the latest damper, above 0 and at most 1.
        width: L, of the limits, in standard deviations of z.

    >>> chart = Ewma(0.2, 2.962)
    >>> round(chart.average_run_length()), round(chart.average_run_length(1.0), 1)
    (500, 10.5)
    """

    name: ClassVar[str] = "EWMA"
    weight: float = 0.2
    width: float = 3.0

    def __post_init__(self) -> None:
        _checks.positive("width", self.width)
        if not 0.0 < self.weight <= 1.0:
            _checks.refuse("weight", "be above 0 and at most 1", self.weight, "0.05 to 0.3 are usual.")

    def statistics(self, scores: Values) -> tuple[Values, Values]:
        """The average after each number."""
        z, after = 0.0, np.empty(scores.size)
        for i, score in enumerate(scores):
            z = z + self.weight * (score - z) if math.isfinite(score) else z
            after[i] = z
        return after, after

    @property
    def limit(self) -> float:
        """L √(λ/(2 − λ))."""
        return self.width * math.sqrt(self.weight / (2.0 - self.weight))

    def average_run_length(self, shift: float = 0.0) -> float:
        """By the integral equation of Crowder (Technometrics 1987)."""

        def density(to: np.ndarray, start: np.ndarray) -> np.ndarray:
            return _density((to - (1.0 - self.weight) * start) / self.weight - shift) / self.weight

        return _run_length(density, -self.limit, self.limit)


@final
@dataclasses.dataclass(frozen=True)
class Cusum(AbstractChart):
    """Cumulative sums C⁺ = max(0, C⁺ + x − k), C⁻ = max(0, C⁻ − x − k), with a signal above h: for lasting shifts.

    The tabular form for individual values (ISO 7870-4; Page, Biometrika 1954). It answers a shift of 2 k fastest. Sums
    grow up to 2 h only, so that the chart comes back soon after the cause was mended; that changes no first signal.

    Arguments:
        reference: k, in standard deviations.
        decision: h, in standard deviations.

    >>> chart = Cusum(0.5, 5.0)
    >>> round(chart.average_run_length()), round(chart.average_run_length(1.0), 1)
    (465, 10.4)
    """

    name: ClassVar[str] = "CUSUM"
    reference: float = 0.5
    decision: float = 5.0

    def __post_init__(self) -> None:
        _checks.positive("decision", self.decision)
        _checks.nonnegative("reference", self.reference)

    def statistics(self, scores: Values) -> tuple[Values, Values]:
        """C⁺ and −C⁻ after each number."""
        high, low, after, most = 0.0, 0.0, np.empty((2, scores.size)), 2.0 * self.decision
        for i, score in enumerate(scores):
            if math.isfinite(score):
                high = min(max(0.0, high + score - self.reference), most)
                low = min(max(0.0, low - score - self.reference), most)
            after[:, i] = high, -low
        return after[0], after[1]

    @property
    def limit(self) -> float:
        """The decision interval h."""
        return self.decision

    def average_run_length(self, shift: float = 0.0) -> float:
        """By the integral equation of each side (Page), of which the rates of signals add."""
        sides = (self._one_side(shift), self._one_side(-shift))
        return 1.0 / sum(1.0 / side for side in sides)

    def _one_side(self, shift: float) -> float:
        def density(to: np.ndarray, start: np.ndarray) -> np.ndarray:
            return _density(to - start + self.reference - shift)

        return _run_length(density, 0.0, self.decision, lambda start: _normal(self.reference - start - shift))


def _run_length(
    density: Callable[[np.ndarray, np.ndarray], np.ndarray],
    low: float,
    high: float,
    at_zero: Callable[[float], float] = lambda start: 0.0,
) -> float:
    """L(0) of L(u) = 1 + L(0) P(u) + ∫ L(y) f(y | u) dy, by Gauss-Legendre quadrature.

    f(y | u) is the `density`, P(u) the probability to return to exactly zero; there is no signal from `low` to `high`.
    """
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    nodes, weights = 0.5 * (high - low) * nodes + 0.5 * (high + low), 0.5 * (high - low) * weights
    starts = np.append(nodes, 0.0)
    matrix = np.zeros((NODES + 1, NODES + 1))
    matrix[:, :-1] = density(nodes[None, :], starts[:, None]) * weights
    matrix[:, -1] = [at_zero(float(start)) for start in starts]
    return float(np.linalg.solve(np.eye(NODES + 1) - matrix, np.ones(NODES + 1))[-1])


def _normal(x: float) -> float:
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def _density(x: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi)


def signals(chart: AbstractChart, scores: Sequence[float] | np.ndarray) -> np.ndarray:
    """After which scores (distances from the centre in standard deviations) a chart signals.

    1 above its limit, −1 below it, 0 within or where a number is missing.
    """
    scores = np.asarray(scores, np.float64)
    high, low = chart.statistics(scores)
    there = np.isfinite(scores)
    return np.where(there & (high > chart.limit), 1, np.where(there & (low < -chart.limit), -1, 0))
