"""Tests of a bench during which the command of the damper changes: steps of a coil current, at random levels too."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, final, runtime_checkable

import numpy as np

from jaxdamp import _checks
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.programmes import Excitation, growth
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
