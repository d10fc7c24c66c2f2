"""A finding, what all checks of a record share, and artefacts of a channel: repeated values, lines of the mains."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Int

from jaxdamp import _checks
from jaxdamp.bench.analysis import FoldedCycles, fold_cycles, steady_cycles
from jaxdamp.bench.contradictions import ALIKE, SAME_SHAPE
from jaxdamp.bench.motion import Samples, mean_curve, moving_span, white_noise
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.spectrum import MAINS


SHARE = 0.3  # of the cycles: what is there more often is the damper's, such as friction that turns
_BY_CHANCE = 0.01  # expected number of such repetitions in the record, below which they are no chance
_CLEAR = 8.0  # standard deviations of the noise


def runs_of(mask: np.ndarray) -> Int[np.ndarray, "stretches 2"]:
    """First and last index of each stretch where a mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return np.stack([edges[::2], edges[1::2] - 1], axis=1)


def gaps(values: Samples, velocity: Samples, moving: slice, cycles: int) -> Int[np.ndarray, "stretches 2"]:
    """First and last sample of each stretch of equal values in the motion that is no chance and no clipping.

    Neighbours are equal by chance with a probability of q / (2 √π σ + |slope|), with the resolution q, the noise σ and
    the change per sample. Where that is near one, as in a coarse channel, a stretch counts that ends with a jump which
    only it makes.
    """
    at = runs_of(np.diff(values[moving]) == 0.0)
    at = at[(at[:, 0] > 0) & (at[:, 1] < len(values[moving]) - 3)]
    if not len(at):
        return at
    x, v = values[moving], velocity[moving]
    first, last = at[:, 0], at[:, 1] + 1
    resolution, noise, length = _resolution(x, int(np.sum(last - first)), len(at)), white_noise(x), last - first
    outside, into, out = x[last + 1] - x[first - 1], x[first] - x[first - 1], x[last + 1] - x[last]
    chance = resolution / np.maximum(2 * np.sqrt(np.pi) * noise + np.abs(outside) / (length + 2), resolution)
    lost = (len(x) * chance**length < _BY_CHANCE) & (np.abs(outside) > resolution) & (noise > 2.0 * resolution)
    edge = np.maximum(_CLEAR * np.sqrt(2.0) * noise, 4.0 * resolution)
    extreme = (x[first] == x.max()) | (x[first] == x.min())
    smooth = np.maximum(np.abs(into), np.abs(out)) < 2.0 * edge
    clipped = extreme & (smooth | (np.count_nonzero(extreme) > 2)) & (x[first] != 0.0)
    usual = np.abs(x[np.minimum(last + 2, len(x) - 1)] - x[last + 1])
    jumps = (length > 2) & (np.abs(out) > np.maximum(edge, 3.0 * usual))
    fastest = float(np.max(np.abs(v)))
    jumps &= np.abs(v[last] - v[first]) > 0.1 * fastest  # at constant velocity a force may well be constant
    if np.count_nonzero(jumps) > max(1, SHARE * cycles):
        jumps[:] = False
    return at[(lost | jumps) & ~clipped] + moving.start + np.array([0, 1])


def _resolution(values: Samples, still: int, stretches: int) -> float:
    """The step of the numbers as they were written: of their decimals, or of a converter; rounding of floats else.

    A converter shows by values that recur: of n values on m levels, about n² / 2m do. Those of the stretches of equal
    neighbours do not count.
    """
    some = values[:: max(len(values) // 2000, 1)]
    largest, decimals = float(np.max(np.abs(some))), 1e-15
    for digits in range(12):
        unit = 10.0 ** (np.ceil(np.log10(max(largest, 1e-300))) - digits)
        if np.all(np.abs(some / unit - np.round(some / unit)) < 1e-3):
            decimals = unit / largest
            break
    count, distinct = len(values), len(np.unique(values))
    recurring = max(count - distinct - still - stretches, 0)
    span = float(np.ptp(np.quantile(values, (0.01, 0.99))))
    levels = distinct if distinct < 0.7 * count else count**2 / (2.0 * max(recurring, 1e-3))
    coarse = span / levels if recurring > 3 else 0.0
    return max(float(decimals) * largest, coarse)


_HARMONICS = 5  # of the mains
_PERIODS = 20  # of a line, at least: the noise is that of so many lines beside it, which must not be of zero frequency
_RIPPLE = 3.0  # times the harmonics of the motion beside it


def mains_lines(values: Samples, rate: float, motion: float) -> dict[float, list[tuple[float, float]]]:
    """Frequency [Hz] and amplitude of the lines that a channel has at each mains frequency and its harmonics.

    Arguments:
        values: of the channel.
        rate: its samples per second [Hz].
        motion: frequency of the motion [Hz], whose harmonics are no ripple.
    """
    orders = [(mains, k * mains) for mains in MAINS for k in range(1, _HARMONICS + 1) if rate > 2.2 * k * mains]
    orders = [(mains, line) for mains, line in orders if 8 * motion <= line and len(values) >= _PERIODS * rate / line]
    if not orders:
        return {}
    spectrum, lines = _Spectrum(values, rate), {}
    width, span = rate / len(values), float(np.ptp(np.quantile(values, (0.001, 0.999))))
    for mains, line in orders:
        peak, size = spectrum.peak(line, 0.4)
        noise = float(np.median(np.concatenate([spectrum.lines(line + s * 12 * width, 8 * width) for s in (-1, 1)])))
        multiples = [line + k * motion for k in (-3, -2, -1, 1, 2, 3) if abs(k * motion) > 0.8 + 2 * width]
        level = max([noise, *(spectrum.peak(at, 0.4)[1] for at in multiples if at < 0.5 * rate - 1.0)])
        if size > max(_RIPPLE * level, 6 * noise, 1e-5 * span):
            lines.setdefault(mains, []).append((peak, size))
    return lines


class _Spectrum:
    """Amplitudes of lines under a Hann window, four to each resolved one; two in a long record."""

    def __init__(self, values: Samples, rate: float) -> None:
        window = np.hanning(len(values))
        size = (4 if len(values) < 200_000 else 2) * len(values)
        self._step = rate / size
        self._lines = np.abs(np.fft.rfft((values - values.mean()) * window, size)) * 2 / window.sum()

    def lines(self, frequency: float, reach: float) -> Samples:
        """The lines within a reach of a frequency [Hz]."""
        first, last = (max(int(np.ceil((frequency + side * reach) / self._step)), 0) for side in (-1, 1))
        return self._lines[first : last + 1]

    def peak(self, frequency: float, reach: float) -> tuple[float, float]:
        """Frequency [Hz] and amplitude of the largest line within a reach of a frequency."""
        lines = self.lines(frequency, reach)
        first = max(int(np.ceil((frequency - reach) / self._step)), 0)
        best = int(np.argmax(lines))
        return (first + best) * self._step, float(lines[best])


SEVERITIES = ("error", "warning", "note")
CLEAR = 6.0  # standard errors from which an effect is there
BINS = 60  # of the velocity, for the mean curve of the force
FEWEST_CYCLES = 3  # from which a scatter over cycles can be told


@dataclass(frozen=True)
class Finding:
    """Something odd about a record, or about several together.

    Arguments:
        severity: "error": nothing computed from the record can be trusted; "warning": results are wrong to some
            degree; "note": to know.
        name: of the artefact, such as "rest before".
        records: names of the records that it concerns, most often one.
        message: what was seen, in words.
        size: of the artefact in `unit`; None where it has none.
        unit: of the size, SI.
        between: start and end of the place in the record [s]; None for the whole record.
        remedy: what to do.
    """

    severity: str
    name: str
    records: tuple[str, ...]
    message: str
    size: float | None = None
    unit: str = ""
    between: tuple[float, float] | None = None
    remedy: str = ""

    def __post_init__(self) -> None:
        _checks.one_of("severity", self.severity, SEVERITIES)

    @property
    def record(self) -> str:
        """The names of the records in words."""
        return ", ".join(self.records)

    @property
    def sentence(self) -> str:
        """What is odd in which records, and what to do."""
        return f"{self.record}: {self.message}. {self.remedy}".rstrip()

    def __str__(self) -> str:
        return f"{self.severity}: {self.sentence}"


class Examined:
    """A record with what several checks need of it, computed once."""

    def __init__(self, run: BenchRun) -> None:
        self.run = run
        first, last = moving_span(run.time, run.stroke, run.frequency)
        self.moving = slice(first, last + 1)  # the samples of the motion, without rest before and after

    @cached_property
    def cycles(self) -> FoldedCycles | None:
        """The steady cycles; none in a record without a full one, or of a motion that does not repeat."""
        return fold_cycles(self.run) if self.run.cycles and self.repeats else None

    @cached_property
    def repeats(self) -> bool:
        """Whether the motion repeats from cycle to cycle, unlike a random one or a sweep.

        Three steady cycles, or half of all, must agree in stroke within 10 % of the amplitude (RMS) and in period
        within 5 %. Fewer cycles repeat if the velocity changes its sign no more often than twice a cycle and thrice at
        the ends.
        """
        count = self.run.cycles
        if count < FEWEST_CYCLES:
            velocity = self.run.velocity[self.moving]
            signs = np.sign(velocity[np.abs(velocity) > 0.05 * self.run.peak_velocity])
            return int(np.count_nonzero(np.diff(signs))) <= 2 * count + 3
        if len(steady_cycles(self.run)) < min(FEWEST_CYCLES, 0.5 * count):
            return False
        cycles = fold_cycles(self.run)
        mean = cycles.stroke.mean(axis=0)
        alike = np.sqrt(np.mean((cycles.stroke - mean) ** 2)) < SAME_SHAPE * 0.5 * np.ptp(mean)
        return bool(alike and np.std(cycles.periods) < ALIKE * np.mean(cycles.periods))

    @cached_property
    def noise(self) -> dict[str, float]:
        """Standard deviation of the white noise of each channel over the motion, and at least its rounding."""
        return {name: max(white_noise(values), step(values) / np.sqrt(12)) for name, values in self.channels.items()}

    @cached_property
    def jitter(self) -> float:
        """Standard deviation by which the instants of sampling differ from those written [s]; 0 where it is not clear.

        The variance of the fifth differences of the stroke, σ² + τ² v², is compared between the fast and the slow half.
        Few large differences, of spikes or lost samples, count no more than ten times the median.
        """
        stroke = self.channels["stroke"]
        if len(stroke) < 200 or step(stroke) > 0:
            return 0.0
        squares = np.diff(stroke, 5) ** 2 / 252.0
        speed = np.abs(self.run.velocity[self.moving])[2:-3]
        low, high = np.quantile(speed, (0.3, 0.7))
        fast, slow = (
            np.minimum(part, 10.0 * np.median(part)) for part in (squares[speed > high], squares[speed < low])
        )
        more, less = float(fast.mean()), float(slow.mean())
        # Differences are correlated over some five samples, so that a fifth of them counts.
        uncertain = np.sqrt(2 * 5 * (more**2 / len(fast) + less**2 / len(slow)))
        if more - less < CLEAR * uncertain or more < 1.5 * less or more < (1e-6 * np.ptp(stroke)) ** 2:
            return 0.0
        difference = np.mean(speed[speed > high] ** 2) - np.mean(speed[speed < low] ** 2)
        return float(np.sqrt((more - less) / difference))

    @cached_property
    def gaps(self) -> dict[str, np.ndarray]:
        """First and last sample of the stretches in which each channel repeats one value, shape (stretches, 2)."""
        run = self.run
        return {name: gaps(getattr(run, name), run.velocity, self.moving, run.cycles) for name in self.channels}

    @cached_property
    def mains(self) -> dict[str, dict[float, list[tuple[float, float]]]]:
        """Frequency [Hz] and amplitude of the lines of the mains in each channel, by mains frequency [Hz]."""
        rate, motion = self.run.sampling_rate, self.run.frequency
        return {name: mains_lines(values, rate, motion) for name, values in self.channels.items()}

    @cached_property
    def above_curve(self) -> Samples:
        """The force less its mean at the velocity of each sample [N], over the motion: what is not a curve of it."""
        velocity, force = self.run.velocity[self.moving], self.run.force[self.moving]
        centres, means = mean_curve(velocity, force, float(velocity.min()), float(velocity.max()), BINS)
        there = np.isfinite(means)
        return force - np.interp(velocity, centres[there], means[there])

    @property
    def channels(self) -> dict[str, Samples]:
        """Stroke and force over the motion."""
        return {"stroke": self.run.stroke[self.moving], "force": self.run.force[self.moving]}

    @property
    def samples_per_cycle(self) -> float:
        """Samples in a period."""
        return self.run.sampling_rate / self.run.frequency

    def finding(
        self,
        severity: str,
        name: str,
        message: str,
        size: float | int | None = None,
        unit: str = "",
        samples: tuple[int, int] | None = None,
        remedy: str = "",
    ) -> list[Finding]:
        """One finding of this record; its place is given by the first and the last sample."""
        place = None if samples is None else (float(self.run.time[samples[0]]), float(self.run.time[samples[1]]))
        size = None if size is None else float(size)
        return [Finding(severity, name, (self.run.name,), message, size, unit, place, remedy)]


def clock_jitter(run: BenchRun) -> float:
    """Standard deviation by which the instants of sampling of a record differ from those written [s]; 0 if unclear.

    Arguments:
        run: the record.
    """
    return Examined(run).jitter


def step(values: Samples) -> float:
    """The step that all values are multiples of apart, if there is one; zero else.

    It is the smallest difference between two values, when nearly all other differences are multiples of it and the
    values repeat much more often than they would by chance.
    """
    levels = np.unique(values)
    if len(levels) > 0.8 * len(values) or len(levels) < 3:
        return 0.0
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * np.ptp(levels)]
    smallest = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    multiples = gaps / smallest
    regular = np.abs(multiples - np.round(multiples)) < 0.1
    return smallest if len(gaps) and np.mean(regular) > 0.95 else 0.0
