"""Checks of each channel: clipping, spikes, a channel that sticks, rounding, mains ripple."""

import numpy as np

from jaxdamp.bench.motion import Samples
from jaxdamp.bench.preflight.finding import Examined, Finding, runs_of, step


UNITS = {"stroke": "m", "force": "N"}
MAINS = (50.0, 60.0)  # Hz
COARSE = 1000  # levels over the range, below which rounding is seen in loops
_STUCK = 0.75  # of a period; a clipped half wave is shorter
_SPIKE = 8.0  # standard deviations of the noise
_RIPPLE = 3.0  # times the harmonics of the motion beside it


def clipping(e: Examined) -> list[Finding]:
    """Flat tops: the largest or smallest value again and again, reached with a slope that would have gone on."""
    found = []
    for name, values in e.channels.items():
        for side, extreme in (("largest", values.max()), ("smallest", values.min())):
            flat = [(a, b) for a, b in runs_of(values == extreme) if b > a + 1]
            flat = [pair for pair in flat if _goes_on(values, *pair, e.noise[name]) and not _is_stuck(e, *pair)]
            count = sum(b - a + 1 for a, b in flat)
            if count >= 4:
                share = 100 * count / len(values)
                message = f"the {name} is clipped at {extreme:.4g} {UNITS[name]} ({share:.2g} % of the samples)"
                place = (e.moving.start + flat[0][0], e.moving.start + flat[-1][1])
                remedy = f"Its {side} values are lost: take a larger range of the channel and measure again."
                found += e.finding("error", f"{name} clipped", message, extreme, UNITS[name], place, remedy)
    return found


def _goes_on(values: Samples, first: int, last: int, noise: float) -> bool:
    """Whether the slope into a flat stretch would have led well beyond it, unlike at a rounded peak."""
    length = last - first + 1
    before = values[max(first - max(length // 2, 2), 0) : first]
    if len(before) < 2:
        return False
    slope = abs(values[first] - before[0]) / len(before)
    return bool(slope * length / 2 > max(6.0 * step(values), 3.0 * noise, 1e-6 * np.ptp(values)))


def _is_stuck(e: Examined, first: int, last: int) -> bool:
    return last - first > _STUCK * e.samples_per_cycle


def stuck(e: Examined) -> list[Finding]:
    """A channel that repeats one value while the other one moves."""
    found = []
    for name, other in (("stroke", "force"), ("force", "stroke")):
        values, moves = getattr(e.run, name), getattr(e.run, other)
        still = runs_of(np.diff(values) == 0.0)
        stretches = [(a, b + 1) for a, b in still if _is_stuck(e, a, b + 1)]
        stretches = [(a, b) for a, b in stretches if np.ptp(moves[a : b + 1]) > 0.3 * np.ptp(moves)]
        if stretches:
            first, last = max(stretches, key=lambda pair: pair[1] - pair[0])
            seconds = e.run.time[last] - e.run.time[first]
            message = (
                f"the {name} stays at {values[first]:.4g} {UNITS[name]} for {seconds:.3g} s while the {other} moves"
            )
            remedy = (
                f"Cut the record there (`process(between=...)`), or measure again: is the {name} channel connected?"
            )
            found += e.finding("error", f"{name} stuck", message, e.run.time[first], "s", (first, last), remedy)
    return found


def spikes(e: Examined) -> list[Finding]:
    """Single samples far off a cubic through their neighbours, to which both neighbours lie on the same side."""
    found = []
    for name, values in e.channels.items():
        middle = values[2:-2]
        beside = (4 * (values[1:-3] + values[3:-1]) - (values[:-4] + values[4:])) / 6
        off = middle - beside
        before, behind = middle - values[1:-3], middle - values[3:-1]
        alone = (before * behind > 0) & (np.minimum(np.abs(before), np.abs(behind)) > 0.5 * np.abs(off))
        least = max(_SPIKE * e.noise[name], 20 * float(np.median(np.abs(off))), 1e-6 * np.ptp(values))
        hits = np.flatnonzero(alone & (np.abs(off) > least))
        if len(hits):
            size = float(np.median(np.abs(off[hits])))
            number = f"{len(hits)} spike{'s' * (len(hits) > 1)}"
            message = (
                f"{number} in the {name}, about {size:.3g} {UNITS[name]}, {size / e.noise[name]:.2g} times its noise"
            )
            place = (e.moving.start + int(hits[0]) + 2, e.moving.start + int(hits[-1]) + 2)
            remedy = "Look for a loose plug or a dropped sample; fits weigh spikes by their square."
            found += e.finding("warning", f"{name} spikes", message, size, UNITS[name], place, remedy)
    return found


def quantisation(e: Examined) -> list[Finding]:
    """A channel with so few levels that its steps are seen."""
    found = []
    for name, values in e.channels.items():
        size = step(values)
        levels = np.ptp(values) / size if size > 0 else np.inf
        if levels < COARSE:
            message = f"the {name} comes in steps of {size:.3g} {UNITS[name]}, {levels:.0f} of them over its range"
            remedy = "Take a smaller range or more bits, and write more digits."
            found += e.finding("note", f"{name} quantised", message, size, UNITS[name], None, remedy)
    return found


def ripple(e: Examined) -> list[Finding]:
    """A line at the mains frequency that stands out from the harmonics of the motion beside it, and from the noise."""
    found, rate, motion = [], e.run.sampling_rate, e.run.frequency
    for mains in MAINS:
        for name, values in e.channels.items():
            if rate < 2.2 * mains or 8 * motion > mains or len(values) < 4 * rate / mains:
                continue
            spectrum = _Spectrum(values, rate)
            width = rate / len(values)
            at, size = spectrum.peak(mains, 0.4)
            around = [spectrum.lines(mains + side * 12 * width, 8 * width) for side in (-1, 1)]
            noise = float(np.median(np.concatenate(around)))
            beside = [mains + k * motion for k in (-3, -2, -1, 1, 2, 3) if abs(k * motion) > 0.8 + 2 * width]
            level = max([noise, *(spectrum.peak(frequency, 0.4)[1] for frequency in beside)])
            if size > max(_RIPPLE * level, 6 * noise, 1e-5 * float(np.ptp(values))):
                message = f"{mains:.0f} Hz ripple of {size:.3g} {UNITS[name]} in the {name} (line at {at:.4g} Hz)"
                remedy = f"Mend the earthing, or filter: `process(low_pass={mains / 2:g})` if the motion allows it."
                found += e.finding("warning", f"{name} ripple", message, size, UNITS[name], None, remedy)
    return found


class _Spectrum:
    """Amplitudes of lines under a Hann window, four to each resolved one."""

    def __init__(self, values: Samples, rate: float) -> None:
        window = np.hanning(len(values))
        size = 4 * len(values)
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
