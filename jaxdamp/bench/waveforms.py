"""Further tests of a bench: triangles, sums of a few sines, and commands of the damper that step."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, final, runtime_checkable

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.programmes import Excitation, Ramped, growth
from jaxdamp.bench.units import COMMAND_UNITS


@runtime_checkable
class CommandedExcitation(Excitation, Protocol):
    """A test that sets the command of the damper as well as its stroke."""

    @property
    def command_unit(self) -> str:
        """Unit of the command."""
        ...

    @property
    def shortest_rise(self) -> float:
        """The least time in which the command changes [s], which a record has to resolve."""
        ...

    def command(self, time: Samples) -> Samples:
        """Command at instants [s]; before zero the first one."""
        ...


@final
@dataclass(frozen=True)
class CommandStep:
    """A test under a command that steps from level to level, each held for a time, from the first again after the last.

    A step is smooth, s³ (10 − 15 s + 6 s²) over its rise, as current sources are. It begins when the hold ends. The
    command is that which is set and measured; behind it the damper may have an actuator with a lag
    (`VirtualDyno(law, command_lag=8e-3)`).

    Arguments:
        test: the motion, such as a `SineTest`.
        levels: the commands one after the other, in `unit`.
        hold: from one step to the next [s].
        rise: duration of a step [s].
        unit: of the command, "A", "V" or "%".
        name: of the record; that of the motion with "_steps" if left out.

    Raises:
        ValueError: fewer than two levels, levels that are not finite, a rise that is not positive or longer than the
            hold, another unit.

    >>> from jaxdamp.bench import SineTest
    >>> test = CommandStep(SineTest(0.01, 2.0), levels=(0.0, 1.0), hold=0.3)
    >>> test.name, [round(float(u), 3) for u in test.command(np.array([-1.0, 0.29, 0.3025, 0.4, 0.7]))]
    ('10mm_2Hz_steps', [0.0, 0.0, 0.5, 1.0, 0.0])
    """

    test: Excitation
    levels: Sequence[float | int]
    hold: float | int = 0.4
    rise: float | int = 5e-3
    unit: str = "A"
    name: str = ""

    def __post_init__(self) -> None:
        must, remedy = "be a test of a motion", "Take `bench.SineTest(amplitude=0.02, frequency=2.0)`."
        _checks.instance("test", self.test, Excitation, must, remedy)
        object.__setattr__(self, "levels", tuple(map(float, self.levels)))
        _checks.finite("levels", np.array(self.levels))
        if len(self.levels) < 2:
            _checks.refuse("levels", "be two or more", self.levels, "Leave `CommandStep` out for a held command.")
        for argument in ("hold", "rise"):
            _checks.positive(argument, getattr(self, argument))
        if self.rise > self.hold:
            _checks.refuse("rise", f"be at most the hold, {self.hold:g} s", self.rise)
        _checks.one_of("unit", self.unit, COMMAND_UNITS)
        if not self.name:
            object.__setattr__(self, "name", f"{self.test.name}_steps")

    @classmethod
    def random(
        cls,
        test: Excitation,
        low: float | int,
        high: float | int,
        *,
        seed: int = 0,
        hold: float | int = 0.2,
        rise: float | int = 5e-3,
        unit: str = "A",
        name: str = "",
    ) -> "CommandStep":
        """A test under random levels, uniform between two, enough for the whole record.

        Arguments:
            test: the motion.
            low: least command.
            high: largest command.
            seed: of the levels.
            hold: as above [s].
            rise: as above [s].
            unit: as above.
            name: as above.
        """
        if not low < high:
            _checks.refuse("low", "be less than `high`", f"{low} with high {high}")
        _checks.positive("hold", hold)
        count = max(int(np.ceil(test.duration / hold)), 2)
        levels = np.random.default_rng(seed).uniform(low, high, count)
        return cls(test, tuple(levels), hold, rise, unit, name or f"{test.name}_random_seed{seed}")

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return self.test.duration

    @property
    def warm_up(self) -> float:
        """Motion before the record [s]."""
        return self.test.warm_up

    @property
    def highest_frequency(self) -> float:
        """Highest frequency in the stroke [Hz]."""
        return self.test.highest_frequency

    @property
    def command_unit(self) -> str:
        """Unit of the command."""
        return self.unit

    @property
    def shortest_rise(self) -> float:
        """Duration of a step [s]."""
        return float(self.rise)

    def stroke(self, time: Samples) -> Samples:
        """Stroke [m] at instants [s]."""
        return self.test.stroke(time)

    def velocity(self, time: Samples) -> Samples:
        """Velocity [m/s] at instants [s]."""
        return self.test.velocity(time)

    def command(self, time: Samples) -> Samples:
        """Command at instants [s]."""
        levels, number = np.array(self.levels), np.maximum(np.floor(time / self.hold).astype(int), 0)
        before = levels[np.maximum(number - 1, 0) % len(levels)]
        risen, _ = growth(time - number * self.hold, 0.0, self.rise)
        return before + (levels[number % len(levels)] - before) * risen


@final
@dataclass(frozen=True)
class TriangleTest(Ramped):
    """Triangle of rounded turns: stroke x = a asin(k sin 2πft)/asin k, of nearly constant velocity between its ends.

    Arguments:
        amplitude: a [m], zero to peak.
        frequency: f [Hz].
        cycles: recorded cycles.
        sharpness: k, between 0 (a sine) and 1 (corners, where the velocity jumps, and `estimate_velocity` overshoots).
        warm_up_cycles: cycles before the record, over half of which the amplitude grows.
        name: of the record; made of amplitude and frequency if left out.

    Raises:
        ValueError: an amplitude, frequency or number of cycles that is not positive; a sharpness beyond 0 to 0.999.

    >>> test = TriangleTest(amplitude=0.02, frequency=1.0)
    >>> test.name, round(test.peak_velocity, 4)
    ('triangle_20mm_1Hz', 0.101)
    """

    amplitude: float | int
    frequency: float | int
    cycles: float | int = 3
    sharpness: float = 0.9
    warm_up_cycles: float | int = 2
    name: str = ""

    def __post_init__(self) -> None:
        for argument in ("amplitude", "frequency", "cycles", "sharpness"):
            _checks.positive(argument, getattr(self, argument))
        _checks.nonnegative("warm_up_cycles", self.warm_up_cycles)
        if self.sharpness > 0.999:
            _checks.refuse("sharpness", "be at most 0.999", self.sharpness, "A corner would need infinite force.")
        if not self.name:
            object.__setattr__(self, "name", f"triangle_{1e3 * self.amplitude:g}mm_{self.frequency:g}Hz")

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return self.cycles / self.frequency

    @property
    def warm_up(self) -> float:
        """Motion before the record [s]."""
        return self.warm_up_cycles / self.frequency

    @property
    def highest_frequency(self) -> float:
        """Frequency of a sine that turns as sharply [Hz]."""
        return float(self.frequency / np.sqrt(1.0 - self.sharpness**2))

    @property
    def peak_velocity(self) -> float:
        """Velocity at mid-stroke [m/s]."""
        return float(self.amplitude * 2 * np.pi * self.frequency * self.sharpness / np.arcsin(self.sharpness))

    def _motion(self, time: Samples) -> tuple[Samples, Samples]:
        k, omega = self.sharpness, 2 * np.pi * self.frequency
        sine, cosine, scale = np.sin(omega * time), np.cos(omega * time), self.amplitude / np.arcsin(self.sharpness)
        return scale * np.arcsin(k * sine), scale * k * omega * cosine / np.sqrt(1.0 - (k * sine) ** 2)


@final
@dataclass(frozen=True)
class MultiSineTest(Ramped):
    """Several frequencies at once, each with the same peak velocity, within a stroke and a velocity limit.

    The phases are Schroeder's, φ_k = −π k² / n, for low peaks; the motion is scaled so that it touches one of the
    limits.

    Arguments:
        stroke_limit: largest |x| [m].
        velocity_limit: largest |v| [m/s].
        frequencies: of the sines [Hz].
        duration: length of the record [s].
        warm_up: motion before the record [s]; it grows over the first half.
        name: of the record; made of the limits and frequencies if left out.

    Raises:
        ValueError: a limit, duration or frequency that is not positive; no frequency.

    >>> test = MultiSineTest(0.02, 0.5, (1.0, 3.0, 9.0), duration=4.0)
    >>> round(test.peak_velocity, 3)
    0.306
    """

    stroke_limit: float | int
    velocity_limit: float | int
    frequencies: tuple[float | int, ...]
    duration: float | int = 5.0
    warm_up: float | int = 2.0
    name: str = ""
    _lines: Float[np.ndarray, "3 lines"] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for argument in ("stroke_limit", "velocity_limit", "duration", "frequencies"):
            _checks.positive(argument, np.asarray(getattr(self, argument)))
        _checks.nonnegative("warm_up", self.warm_up)
        if not self.frequencies:
            _checks.refuse("frequencies", "hold at least one", "empty")
        if not self.name:
            lines = "+".join(f"{f:g}" for f in self.frequencies)
            object.__setattr__(self, "name", f"multisine_{1e3 * self.stroke_limit:g}mm_{lines}Hz")
        omega, number = 2 * np.pi * np.array(self.frequencies, float), np.arange(len(self.frequencies))
        lines = np.stack([omega, -np.pi * number**2 / len(number), 1.0 / omega])
        object.__setattr__(self, "_lines", lines)
        x, v = self._motion(self._grid)
        lines[2] *= min(self.stroke_limit / np.max(np.abs(x)), self.velocity_limit / np.max(np.abs(v)))

    @property
    def _grid(self) -> Samples:
        return np.arange(-self.warm_up, self.duration, 0.02 / (2 * np.pi * self.highest_frequency))

    def _motion(self, time: Samples) -> tuple[Samples, Samples]:
        omega, phase, size = self._lines[:, :, None]
        angle = omega * time + phase
        return np.sum(size * np.sin(angle), axis=0), np.sum(size * omega * np.cos(angle), axis=0)

    @property
    def highest_frequency(self) -> float:
        """The highest of the frequencies [Hz]."""
        return float(max(self.frequencies))

    @property
    def peak_velocity(self) -> float:
        """Largest |v| [m/s]."""
        return float(np.max(np.abs(self._motion(self._grid)[1])))
