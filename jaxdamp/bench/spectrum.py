"""What in the spectrum of a stroke is motion, and what ripple and noise.

What is above the noise within ten times the frequency of the motion is motion. What is faster is motion if it is 1 % of
the stroke or more, as on roads. Where the stroke repeats from cycle to cycle, it must repeat too, as the corners of
triangles do (0.3 % are enough then), or be a tone that stands out of the spectrum: the rest is noise of the sensor, of
whatever colour. So is what lies at multiples of 50 and 60 Hz, and all that is fast in a stroke that jumps.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp.bench.motion import Samples, cycle_instants


_SLOW = 10.0  # times the frequency of the motion
_FAST_SHARE, _REPEATED_SHARE = 0.01, 0.003  # of the stroke, above which what is faster is motion
_REPEATS = 0.9  # of the power of the slow motion in what is the same in all cycles
_STANDS_OUT = 20.0  # power of a tone, relative to that beside it
_BESIDE = 64  # lines of the spectrum that are beside each other
MAINS = (50.0, 60.0)  # Hz
_JUMP = 6.0  # a step from sample to sample, relative to the RMS of all
_SAID = 0.02  # of the velocity, above which ripple that is left out is named


class Spectrum(NamedTuple):
    """Power of a stroke by frequency, and what in it is motion."""

    rate: float  # Hz
    slowest: float  # Hz, above which motion is fast
    omega: Float[np.ndarray, " lines"]  # per sample
    power: Float[np.ndarray, " lines"]
    floor: float  # of white noise
    seen: Bool[np.ndarray, " lines"]  # above this floor
    motion: Bool[np.ndarray, " lines"]
    has_fast_motion: bool

    def left_out(self, passed: Float[np.ndarray, " lines"] | Bool[np.ndarray, " lines"]) -> str:
        """What a filter leaves out of the velocity above the noise, if that is worth a word; `passed` is its share."""
        velocity = np.where(self.seen, self.omega**2 * self.power, 0.0)
        left = np.sum(np.where(self.motion, 0.0, (1 - passed) ** 2 * velocity))
        ripple = float(np.sqrt(left / max(np.sum(velocity), np.finfo(float).tiny)))
        return f", without ripple above {self.slowest:.3g} Hz of {100 * ripple:.2g} % of it" * (ripple > _SAID)


def spectrum_of(time: Samples, stroke: Samples, frequency: float) -> Spectrum:
    """Tells motion, slow and fast, from ripple and noise; see the text of this module."""
    count, rate = len(stroke), (len(time) - 1) / (time[-1] - time[0])
    power = np.abs(np.fft.rfft((stroke - np.mean(stroke)) * _taper(count, round(rate / frequency)))) ** 2
    frequencies = np.fft.rfftfreq(count, 1 / rate)
    floor = float(np.median(power[len(power) // 2 :])) / np.log(2)
    seen, slow = power > 10 * floor, frequencies < _SLOW * frequency
    fast = seen & ~slow & (not _jumps(stroke))
    for mains in MAINS:  # three lines to either side of its multiples
        fast &= np.abs((frequencies + 0.5 * mains) % mains - 0.5 * mains) > 3 * (frequencies[1] - frequencies[0])
    share = _FAST_SHARE
    if np.any(fast):
        slow_repeats, fast_repeats = _repeating(time, stroke)
        if fast_repeats > 0.5:
            share = _REPEATED_SHARE
        elif slow_repeats > _REPEATS:
            fast &= _stands_out(power, int(np.argmin(slow)))
    has_fast_motion = bool(np.sum(power[fast]) > share**2 * np.sum(power[seen]))
    motion = seen & (slow | fast if has_fast_motion else slow)
    return Spectrum(
        rate, _SLOW * frequency, 2 * np.pi / rate * frequencies, power, floor, seen, motion, has_fast_motion
    )


def _taper(count: int, cycle: int) -> Samples:
    """Rises and falls within a cycle, so that the fast end of a sweep counts like the middle of the record."""
    ends = np.hanning(2 * min(max(cycle, 1), count // 2))
    rise, fall = np.split(ends, 2)
    return np.concatenate([rise, np.ones(count - len(ends)), fall])


def _repeating(time: Samples, stroke: Samples) -> tuple[float, float]:
    """Shares of the power that are the same in all cycles: of the slow part of the stroke, and of the fast one.

    The Fourier series over all n cycles has what repeats in each nth line, and as much noise there as elsewhere. Of one
    cycle or none nothing is known to differ.
    """
    instants = cycle_instants(time, stroke)
    cycles = len(instants) - 1
    if cycles < 2:
        return 0.0, 1.0
    samples = max(len(stroke) // cycles, 4 * int(_SLOW))
    phase = np.arange(cycles * samples) / samples
    warped = np.interp(np.interp(phase, np.arange(cycles + 1), instants), time, stroke)
    power = np.abs(np.fft.rfft(warped)[1:]) ** 2  # its first line is of one period in the whole record
    power = power[: len(power) // cycles * cycles].reshape(-1, cycles)
    repeated, other = power[:, -1], np.sum(power[:, :-1], axis=1)
    first = int(_SLOW) - 1
    slow, fast = (
        float(np.sum((repeated - other / (cycles - 1))[part]) / max(np.sum((repeated + other)[part]), 1e-300))
        for part in (slice(0, first), slice(first, None))
    )
    return slow, fast


def _stands_out(power: Float[np.ndarray, " lines"], first: int) -> Bool[np.ndarray, " lines"]:
    """Which lines, from the first one on, are tones: noise of any colour has lines as high beside each other."""
    fast = power[first:]
    blocks = np.pad(fast, (0, -len(fast) % _BESIDE), mode="edge").reshape(-1, _BESIDE)
    noise = np.quantile(blocks, 0.25, axis=1) / np.log(4 / 3)  # mean of noise from its lower quartile
    tones = np.repeat(noise, _BESIDE)[: len(fast)] * _STANDS_OUT < fast
    return np.concatenate([np.zeros(first, bool), tones])


def _jumps(stroke: Samples) -> bool:
    """Whether the stroke jumps from one sample to the next, as where samples were lost: no motion does."""
    steps = np.abs(np.diff(stroke))
    largest = int(np.argmax(steps))
    turn = np.max(np.abs(np.diff(stroke[max(largest - 1, 0) : largest + 3], 2)), initial=0.0)
    return bool(steps[largest] > _JUMP * np.sqrt(np.mean(steps**2)) and turn > 0.5 * steps[largest])
