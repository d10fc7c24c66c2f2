"""Test programmes of a bench: what stroke is run, exactly, with its velocity.

Time zero is the first sample that is kept. Before it, over the test's warm-up, the motion grows smoothly out of rest
at mid-stroke, so that neither a machine nor a law with states starts with a jump. A test with a run-up has no warm-up:
its record shows the motion grow, from rest if there is a rest before it.
"""

from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol, final, runtime_checkable

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp.bench.motion import Samples


@runtime_checkable
class Excitation(Protocol):
    """What the virtual dyno needs to know of a test; bring your own if sine and random do not do."""

    @property
    def name(self) -> str:
        """Name of the record."""
        ...

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        ...

    @property
    def warm_up(self) -> float:
        """Motion before the record [s]."""
        ...

    @property
    def highest_frequency(self) -> float:
        """Highest frequency in the stroke [Hz]."""
        ...

    def stroke(self, time: Samples) -> Samples:
        """Stroke [m] at instants [s]; the warm-up lies before zero."""
        ...

    def velocity(self, time: Samples) -> Samples:
        """Velocity [m/s] at instants [s], the exact derivative of the stroke."""
        ...


def growth(time: Samples, start: float | int, stop: float | int) -> tuple[Samples, Samples]:
    """Envelope s³ (10 - 15 s + 6 s²) from 0 to 1 between two instants, smooth to its curvature, and its rate [1/s]."""
    if stop <= start:
        return np.ones_like(time), np.zeros_like(time)
    s = np.clip((time - start) / (stop - start), 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2 / (stop - start)


class Ramped:
    """A steady motion under an envelope, by what the two ends of a record show beside it."""

    rest_before: float | int = 0.0
    run_up: float | int = 0.0
    run_down: float | int = 0.0
    rest_after: float | int = 0.0
    warm_up: Any  # numbers: fields or properties
    duration: Any

    @abstractmethod
    def _motion(self, time: Samples) -> tuple[Samples, Samples]:
        """Stroke and velocity of the steady motion."""

    def stroke(self, time: Samples) -> Samples:
        """Stroke [m] at instants [s]."""
        return self._envelope(time)[0] * self._motion(time)[0]

    def velocity(self, time: Samples) -> Samples:
        """Velocity [m/s] at instants [s]."""
        grown, rate = self._envelope(time)
        x, v = self._motion(time)
        return grown * v + rate * x

    @property
    def begins_at_rest(self) -> bool:
        """Whether the record shows the beginning of the motion, which then needs no warm-up."""
        return self.run_up > 0

    def _check_ends(self) -> None:
        for pause, ramp in (("rest_before", "run_up"), ("rest_after", "run_down")):
            _checks.nonnegative(pause, getattr(self, pause))
            _checks.nonnegative(ramp, getattr(self, ramp))
            if getattr(self, pause) > 0 and not getattr(self, ramp) > 0:
                remedy = "Between rest and motion the amplitude needs time: the velocity must not jump."
                _checks.refuse(ramp, f"be positive beside a `{pause}`", getattr(self, ramp), remedy)

    def _envelope(self, time: Samples) -> tuple[Samples, Samples]:
        """Share of the steady amplitude at instants [s], and its rate [1/s]."""
        start, stop = -self.warm_up, -self.warm_up / 2
        if self.begins_at_rest:
            start, stop = self.rest_before, self.rest_before + self.run_up
        grown, rate = growth(time, start, stop)
        if not self.run_down > 0:
            return grown, rate
        end = self.duration - self.rest_after
        gone, loss = growth(time, end - self.run_down, end)
        return grown * (1 - gone), rate * (1 - gone) - grown * loss


@final
@dataclass(frozen=True)
class SineTest(Ramped):
    """Stroke x = a sin(2 π f t) from time zero on, or from the end of the run-up.

    Arguments:
        amplitude: a [m], zero to peak.
        frequency: f [Hz].
        cycles: recorded cycles of full amplitude.
        warm_up_cycles: cycles before the record. The amplitude grows over the first half of them, the rest is steady,
            so that laws with states are in steady state when the record begins.
        name: of the record; made of amplitude and frequency if left out.
        rest_before: recorded rest at mid-stroke before the motion [s].
        run_up: recorded time over which the amplitude grows [s]; it replaces the warm-up.
        run_down: recorded time over which the amplitude falls to nothing [s].
        rest_after: recorded rest after the motion [s].

    Raises:
        ValueError: an amplitude, frequency or number of cycles that is not positive; a rest without a ramp beside it.

    >>> test = SineTest(amplitude=0.0075, frequency=15.0)
    >>> test.name, round(test.peak_velocity, 3)
    ('7.5mm_15Hz', 0.707)
    """

    amplitude: float | int
    frequency: float | int
    cycles: float | int = 3
    warm_up_cycles: float | int = 2
    name: str = ""
    rest_before: float | int = 0.0
    run_up: float | int = 0.0
    run_down: float | int = 0.0
    rest_after: float | int = 0.0

    def __post_init__(self) -> None:
        for argument in ("amplitude", "frequency", "cycles"):
            _checks.positive(argument, getattr(self, argument))
        _checks.nonnegative("warm_up_cycles", self.warm_up_cycles)
        self._check_ends()
        if not self.name:
            object.__setattr__(self, "name", f"{1e3 * self.amplitude:g}mm_{self.frequency:g}Hz")

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return self.rest_before + self.run_up + self.cycles / self.frequency + self.run_down + self.rest_after

    @property
    def warm_up(self) -> float:
        """Motion before the record [s]."""
        return 0.0 if self.begins_at_rest else self.warm_up_cycles / self.frequency

    @property
    def highest_frequency(self) -> float:
        """The frequency [Hz]."""
        return self.frequency

    @property
    def peak_velocity(self) -> float:
        """2 π f a [m/s], of the steady motion."""
        return 2 * np.pi * self.frequency * self.amplitude

    def stroke(self, time: Samples) -> Samples:
        """Stroke [m] at instants [s]."""
        grown, _ = self._envelope(time)
        return self.amplitude * grown * np.sin(2 * np.pi * self.frequency * (time - self.rest_before - self.run_up))

    def velocity(self, time: Samples) -> Samples:
        """Velocity [m/s] at instants [s]."""
        grown, rate = self._envelope(time)
        omega = 2 * np.pi * self.frequency
        angle = omega * (time - self.rest_before - self.run_up)
        return self.amplitude * (grown * omega * np.cos(angle) + rate * np.sin(angle))


@final
@dataclass(frozen=True)
class RandomTest(Ramped):
    """Band-limited random stroke within a stroke and a velocity limit, as in paper 001.

    A sum of sines of equal amplitude and random phase, spaced by 1 / duration over the band and scaled so that the
    limit that is met first is touched and the other kept. The same seed gives the same stroke.

    Arguments:
        stroke_limit: largest |x| [m]. Paper 001: 6 mm.
        velocity_limit: largest |v| [m/s]. Paper 001: 0.06 m/s.
        duration: length of the record [s], the run-up and the like included.
        band: lowest and highest frequency [Hz].
        seed: of the phases.
        warm_up: motion before the record [s]; it grows over the first half. None beside a run-up.
        name: of the record; made of the limits and the seed if left out.
        rest_before: recorded rest at mid-stroke before the motion [s].
        run_up: recorded time over which the amplitude grows [s]; it replaces the warm-up.
        run_down: recorded time over which the amplitude falls to nothing [s].
        rest_after: recorded rest after the motion [s].

    Raises:
        ValueError: a limit or duration that is not positive; a band without a line in it; a rest without a ramp beside
            it; ends that leave nothing of the duration.
    """

    stroke_limit: float | int = 0.006
    velocity_limit: float | int = 0.06
    duration: float | int = 20.0
    band: tuple[float | int, float | int] = (0.25, 2.5)
    seed: int = 0
    warm_up: float | int = 2.0
    name: str = ""
    rest_before: float | int = 0.0
    run_up: float | int = 0.0
    run_down: float | int = 0.0
    rest_after: float | int = 0.0
    _lines: Float[np.ndarray, "3 lines"] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for argument in ("stroke_limit", "velocity_limit", "duration"):
            _checks.positive(argument, getattr(self, argument))
        _checks.nonnegative("warm_up", self.warm_up)
        self._check_ends()
        ends = self.rest_before + self.run_up + self.run_down + self.rest_after
        if not ends < self.duration:
            _checks.refuse("duration", f"be longer than rests and ramps together, {ends:g} s", self.duration)
        if self.begins_at_rest:
            object.__setattr__(self, "warm_up", 0.0)
        low, high = self.band
        numbers = np.arange(max(1, np.ceil(low * self.duration)), np.floor(high * self.duration) + 1)
        if len(numbers) < 2:
            _checks.refuse(
                "band",
                f"hold two multiples of 1 / duration, {1 / self.duration:g} Hz",
                self.band,
                "Widen it or test longer.",
            )
        if not self.name:
            limits = f"{1e3 * self.stroke_limit:g}mm_{self.velocity_limit:g}mps"
            object.__setattr__(self, "name", f"random_{limits}_seed{self.seed}")
        phases = np.random.default_rng(self.seed).uniform(0, 2 * np.pi, len(numbers))
        lines = np.stack([2 * np.pi * numbers / self.duration, phases, np.ones(len(numbers))])
        object.__setattr__(self, "_lines", lines)
        # One period on a grid so fine that a peak between two of its points is at most 0.02 % higher.
        grid = np.arange(0, self.duration, 0.02 / (2 * np.pi * high))
        x, v = self._motion(grid)
        lines[2] = 0.9998 * min(self.stroke_limit / np.max(np.abs(x)), self.velocity_limit / np.max(np.abs(v)))

    def _motion(self, time: Samples) -> tuple[Samples, Samples]:
        """The random motion without its beginning; on a grid of which a step divides the period, by one transform."""
        points = _points_of_period(time, self.duration)
        if points > 2 * self.band[1] * self.duration:
            return self._transformed(time, points)
        x, v = np.zeros_like(time), np.zeros_like(time)
        for omega, phase, size in self._lines.T:
            x += size * np.sin(omega * time + phase)
            v += size * omega * np.cos(omega * time + phase)
        return x, v

    def _transformed(self, time: Samples, points: int) -> tuple[Samples, Samples]:
        """The sums of all lines at a whole period of instants, repeated over the time."""
        omega, phase, size = self._lines
        number = np.round(omega * self.duration / (2 * np.pi)).astype(int)
        wave = 0.5 * points * size * np.exp(1j * (omega * time[0] + phase - np.pi / 2))
        spectra = np.zeros((2, points // 2 + 1), dtype=complex)
        spectra[:, number] = wave, 1j * omega * wave
        x, v = np.fft.irfft(spectra, points, axis=1)
        place = np.arange(len(time)) % points
        return x[place], v[place]

    @property
    def highest_frequency(self) -> float:
        """Upper end of the band [Hz]."""
        return self.band[1]

    @property
    def peak_velocity(self) -> float:
        """Largest |v| of the record [m/s]."""
        return float(np.max(np.abs(self.velocity(np.arange(0, self.duration, 0.01 / self.band[1])))))


def _points_of_period(time: Samples, period: float | int) -> int:
    """Number of steps of a uniform grid in a period; 0 if it is no whole number, or the grid is not uniform."""
    if len(time) < 3:
        return 0
    step = (time[-1] - time[0]) / (len(time) - 1)
    points = round(period / step) if step > 0 else 0
    if not points or abs(period / step - points) > 1e-6:
        return 0
    off = np.max(np.abs(time - time[0] - step * np.arange(len(time))))
    return points if off < 1e-6 * step + 1e-12 * np.abs(time).max() else 0


def sines(
    amplitudes: Iterable[float | int], frequencies: Iterable[float | int], *, cycles: float | int = 3
) -> tuple[SineTest, ...]:
    """Every amplitude [m, zero to peak] at every frequency [Hz]."""
    frequencies = tuple(frequencies)
    return tuple(SineTest(a, f, cycles) for a in amplitudes for f in frequencies)


_TABLE_1 = {
    5: (30, 40, 50, 60),
    10: (15, 20, 25, 30, 35),
    15: (10, 15, 20, 25),
    20: (5, 10, 15, 20),
    30: (3, 5, 8, 10, 15),
    50: (0.1, 0.5, 1, 1.5, 2, 3, 5, 10),
}
READINGS = {"peak-to-peak": 0.5, "zero-to-peak": 1.0}


def paper_000_table_1(reading: str = "peak-to-peak", *, cycles: float | int = 3) -> tuple[SineTest, ...]:
    """The 30 sines of paper 000, Table I, named as there: "15mm_15Hz".

    The paper does not say what its "amplitude" is. Read zero to peak, 14 of the 30 tests would be faster than the
    1.5 m/s of its machine (up to 3.14 m/s); read peak to peak, the peak velocities are 0.0157 to 1.571 m/s. So
    the default halves the table's numbers.

    Arguments:
        reading: "peak-to-peak" or "zero-to-peak".
        cycles: recorded cycles of each test.

    >>> tests = paper_000_table_1()
    >>> len(tests), tests[-1].name, tests[-1].amplitude, round(tests[-1].peak_velocity, 3)
    (30, '50mm_10Hz', 0.025, 1.571)
    """
    _checks.one_of("reading", reading, READINGS)
    return tuple(
        SineTest(1e-3 * size * READINGS[reading], float(frequency), cycles, name=f"{size:g}mm_{frequency:g}Hz")
        for size, frequencies in _TABLE_1.items()
        for frequency in frequencies
    )


def qct_545(*, cycles: float | int = 3) -> tuple[SineTest, ...]:
    """The 16 sines that paper 001 ran after QC/T 545-1999: 5 to 20 mm zero to peak at 1 to 2.5 Hz, up to 0.314 m/s."""
    return sines((0.005, 0.010, 0.015, 0.020), (1.0, 1.5, 2.0, 2.5), cycles=cycles)


def paper_003(*, cycles: float | int = 3) -> tuple[SineTest, ...]:
    """The two sines of paper 003, Table 1: 50 mm zero to peak at 0.5 and 0.7 Hz, up to 0.157 and 0.220 m/s."""
    return sines((0.050,), (0.5, 0.7), cycles=cycles)
