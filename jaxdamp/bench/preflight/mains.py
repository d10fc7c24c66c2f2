"""Lines of the mains in a channel."""

import numpy as np

from jaxdamp.bench.motion import Samples


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
    spectrum, found = _Spectrum(values, rate), {}
    width, span = rate / len(values), float(np.ptp(np.quantile(values, (0.001, 0.999))))
    for mains, line in orders:
        at, size = spectrum.peak(line, 0.4)
        noise = float(np.median(np.concatenate([spectrum.lines(line + s * 12 * width, 8 * width) for s in (-1, 1)])))
        beside = [line + k * motion for k in (-3, -2, -1, 1, 2, 3) if abs(k * motion) > 0.8 + 2 * width]
        beside = [frequency for frequency in beside if frequency < 0.5 * rate - 1.0]
        level = max([noise, *(spectrum.peak(frequency, 0.4)[1] for frequency in beside)])
        if size > max(_RIPPLE * level, 6 * noise, 1e-5 * span):
            found.setdefault(mains, []).append((at, size))
    return found


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
