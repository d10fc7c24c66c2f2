"""Artefacts of a channel: stretches in which it repeats one value, and lines of the mains."""

import numpy as np
from jaxtyping import Int

from jaxdamp.bench.motion import Samples, white_noise


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


MAINS = (50.0, 60.0)  # Hz
_HARMONICS = 5  # of the mains
_RIPPLE = 3.0  # times the harmonics of the motion beside it


def mains_lines(values: Samples, rate: float, motion: float) -> dict[float, list[tuple[float, float]]]:
    """Frequency [Hz] and amplitude of the lines that a channel has at each mains frequency and its harmonics.

    Arguments:
        values: of the channel.
        rate: its samples per second [Hz].
        motion: frequency of the motion [Hz], whose harmonics are no ripple.
    """
    orders = [(mains, k * mains) for mains in MAINS for k in range(1, _HARMONICS + 1) if rate > 2.2 * k * mains]
    orders = [(mains, line) for mains, line in orders if 8 * motion <= line and len(values) >= 4 * rate / line]
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
