"""What is gathered of the points of a block, and merged exactly: in any order it is what all points together give.

Sums are integers, in units far below the smallest number, so that no rounding depends on the blocks.
"""

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import final

import numpy as np

from jaxdamp._tables import Contents


UNIT = 1200  # sums are in units of 2^-1200, those of squares of 2^-2400; the smallest number is 2^-1074
DIGITS = 53  # of the mantissa of a number
FIRST = 8  # weights of the objectives with which a few good points thin out the others
Sizes = Mapping[str, int]


def _total(whole: np.ndarray, power: np.ndarray) -> int:
    """Σ whole · 2^power, exactly; the powers are not negative."""
    powers, place = np.unique(power, return_inverse=True)
    high, low = np.zeros(powers.size, np.int64), np.zeros(powers.size, np.int64)
    np.add.at(high, place, whole >> 32)
    np.add.at(low, place, whole & 0xFFFFFFFF)
    pieces = zip(high.tolist(), low.tolist(), powers.tolist(), strict=True)
    return sum(((h << 32) + rest) << p for h, rest, p in pieces)


def exact_sums(values: np.ndarray) -> tuple[int, int]:
    """The sum of finite numbers and that of their squares, in units of 2^-1200 and 2^-2400.

    >>> total, squares = exact_sums(np.array([1e300, 0.1, -1e300, 0.1]))
    >>> total / 2**1200, exact_sums(np.array([3.0, 4.0]))[1] / 2**2400
    (0.2, 25.0)
    """
    mantissa, exponent = np.frexp(values.astype(np.float64))
    whole, power = np.ldexp(mantissa, DIGITS).astype(np.int64), exponent.astype(np.int64) - DIGITS + UNIT
    upper, lower = np.abs(whole) >> 27, np.abs(whole) & (2**27 - 1)
    parts, powers = (upper * upper, 2 * upper * lower, lower * lower), (2 * power + 54, 2 * power + 27, 2 * power)
    return _total(whole, power), _total(np.concatenate(parts), np.concatenate(powers))


def front(values: np.ndarray) -> np.ndarray:
    """The points, shape (points, objectives), that no other one equals or beats in all objectives and beats in one.

    Of equal points all are there. In increasing order.

    >>> front(np.array([[1.0, 3.0], [2.0, 2.0], [2.0, 2.0], [3.0, 3.0]]))
    array([0, 1, 2])
    """
    left = np.arange(len(values))
    if len(values) > FIRST:
        spread = np.ptp(values, axis=0)
        scaled = values / np.where(spread > 0, spread, 1.0)
        for weights in np.random.default_rng(0).random((FIRST, values.shape[1])):
            best = values[left[np.argmin(scaled[left] @ weights)]]
            left = left[~_beaten(best, values[left])]
    left, chosen = left[np.lexsort(values[left].T[::-1])], []
    while left.size:  # the first in lexical order: whatever would beat it was before it
        best = values[left[0]]
        same = np.all(values[left] == best, axis=1)
        chosen += left[same].tolist()
        left = left[~same & ~_beaten(best, values[left])]
    return np.array(sorted(chosen), np.int64)


def _beaten(best: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.all(best <= values, axis=1) & np.any(best < values, axis=1)


@final
@dataclasses.dataclass(frozen=True)
class Chosen:
    """Some points with all their results that are one number."""

    index: np.ndarray  # of the points in the sweep
    values: Mapping[str, np.ndarray]

    def of(self, places: np.ndarray) -> "Chosen":
        """Some of them."""
        return Chosen(self.index[places], {name: column[places] for name, column in self.values.items()})

    def joined(self, other: "Chosen") -> "Chosen":
        """These and others."""
        columns = {name: np.concatenate([column, other.values[name]]) for name, column in self.values.items()}
        return Chosen(np.concatenate([self.index, other.index]), columns)

    def first(self, name: str, count: int, sign: float) -> "Chosen":
        """Those with the smallest results, or with a negative sign the largest; of equal ones the earlier points."""
        finite = np.flatnonzero(np.isfinite(self.values[name]))
        column = sign * self.values[name][finite]
        if finite.size > count:
            near = column <= np.partition(column, count - 1)[count - 1]
            finite, column = finite[near], column[near]
        return self.of(finite[np.lexsort((self.index[finite], column))[:count]])

    def front(self, objectives: Sequence[str]) -> "Chosen":
        """The Pareto set of objectives that are all to be small, in the order of the points."""
        table = np.stack([self.values[name] for name in objectives], axis=1)
        finite = np.flatnonzero(np.all(np.isfinite(table), axis=1))
        best = self.of(finite[front(table[finite])])
        return best.of(np.argsort(best.index))


@final
@dataclasses.dataclass(frozen=True)
class Kept:
    """Which points and histograms are gathered: as `sweeps.Summary`, checked."""

    histograms: Mapping[str, np.ndarray]  # edges of the bins
    smallest: Sizes
    largest: Sizes
    pareto: tuple[str, ...]

    def chosen(self, points: Chosen) -> dict[str, Chosen]:
        """The points that stay, by "smallest", "largest" with a name, and "pareto"."""
        rows = {f"smallest {name}": points.first(name, count, 1.0) for name, count in self.smallest.items()}
        rows |= {f"largest {name}": points.first(name, count, -1.0) for name, count in self.largest.items()}
        return rows | ({"pareto": points.front(self.pareto)} if self.pareto else {})

    def again(self, key: str, points: Chosen) -> Chosen:
        """Those that stay of the points of two blocks."""
        kind, _, name = key.partition(" ")
        if kind == "pareto":
            return points.front(self.pareto)
        sizes, sign = (self.smallest, 1.0) if kind == "smallest" else (self.largest, -1.0)
        return points.first(name, sizes[name], sign)


@final
@dataclasses.dataclass(frozen=True)
class Figures:
    """Number, exact sums and ends of a result."""

    count: int = 0
    total: int = 0
    squares: int = 0
    minimum: float = math.inf
    maximum: float = -math.inf

    @classmethod
    def of(cls, values: np.ndarray) -> "Figures":
        """Of the values that are finite."""
        values = values[np.isfinite(values)].astype(np.float64)
        return cls(values.size, *exact_sums(values), float(values.min()), float(values.max())) if values.size else cls()

    def __add__(self, other: "Figures") -> "Figures":
        ends = min(self.minimum, other.minimum), max(self.maximum, other.maximum)
        return Figures(self.count + other.count, self.total + other.total, self.squares + other.squares, *ends)

    def numbers(self) -> tuple[float, float, float, float, float]:
        """Count, mean, standard deviation (of all values, not of a sample), minimum, maximum; NaN without a value."""
        if not self.count:
            return 0.0, math.nan, math.nan, math.nan, math.nan
        mean = float(Fraction(self.total, self.count << UNIT))
        variance = Fraction(self.count * self.squares - self.total**2, self.count**2 << 2 * UNIT)
        return float(self.count), mean, math.sqrt(variance), self.minimum, self.maximum


@final
@dataclasses.dataclass(frozen=True)
class Gathered:
    """What is kept of some points of a sweep."""

    points: int
    failed: int
    reasons: Mapping[str, int]
    figures: Mapping[str, Figures]
    histograms: Mapping[str, np.ndarray]
    chosen: Mapping[str, Chosen]

    @classmethod
    def of(
        cls, summary: Kept, names: Sequence[str], indices: np.ndarray, stored: Mapping[str, np.ndarray]
    ) -> "Gathered":
        """Of the results of a block."""
        columns = {name: np.asarray(stored[name], np.float64) for name in names}
        reasons, counts = np.unique(np.asarray(stored["reason"], str), return_counts=True)
        why = {str(r): int(n) for r, n in zip(reasons, counts, strict=True) if r}
        return cls(
            indices.size,
            int(np.count_nonzero(stored["failed"])),
            why,
            {name: Figures.of(column) for name, column in columns.items()},
            {name: _counted(columns[name], edges) for name, edges in summary.histograms.items()},
            summary.chosen(Chosen(indices, columns)),
        )

    def merged(self, other: "Gathered", summary: Kept) -> "Gathered":
        """Of these points and of others."""
        reasons = dict(self.reasons)
        for reason, count in other.reasons.items():
            reasons[reason] = reasons.get(reason, 0) + count
        return Gathered(
            self.points + other.points,
            self.failed + other.failed,
            reasons,
            {name: figures + other.figures[name] for name, figures in self.figures.items()},
            {name: counts + other.histograms[name] for name, counts in self.histograms.items()},
            {key: summary.again(key, some.joined(other.chosen[key])) for key, some in self.chosen.items()},
        )

    def to_text(self) -> str:
        """As JSON, from which exactly this is read back."""
        return json.dumps(dataclasses.asdict(self), default=lambda array: array.tolist())

    @classmethod
    def from_text(cls, text: str) -> "Gathered":
        """Out of what `to_text` gives."""
        read: Contents = json.loads(text)
        read["figures"] = {name: Figures(**figures) for name, figures in read["figures"].items()}
        read["histograms"] = {name: np.array(counts, np.int64) for name, counts in read["histograms"].items()}
        read["chosen"] = {
            key: Chosen(
                np.array(some["index"], np.int64), {k: np.array(v, np.float64) for k, v in some["values"].items()}
            )
            for key, some in read["chosen"].items()
        }
        return cls(**read)


def _counted(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """How many values lie below all bins, in each, and above them; the last bin has its upper edge, as in NumPy."""
    values = values[np.isfinite(values)]
    place = np.searchsorted(edges, values, side="right")
    place[values == edges[-1]] = edges.size - 1
    return np.bincount(place, minlength=edges.size + 1)
