"""The sensors of a virtual bench: noise and faults of its channels."""

from dataclasses import dataclass, field, fields
from typing import TypeVar, final

import numpy as np

from jaxdamp import _checks
from jaxdamp.bench.motion import Samples


T = TypeVar("T")


def _fault(unit: str, default: T) -> T:
    """A field for the size of a fault, with its unit."""
    return field(default=default, metadata={"unit": unit})


@final
@dataclass(frozen=True)
class Sensors:
    """How a machine's force and stroke channels distort what they measure. By default they do not.

    Each channel goes through these in turn: hum and noise, spikes (force only), reversed sign (force only), limits,
    resolution, a channel that sticks.

    Arguments:
        force_noise: standard deviation of the white noise of the load cell [N].
        stroke_noise: and of the stroke sensor [m].
        command_noise: and of the channel of a command that varies, in its unit.
        mains_ripple: amplitude of the mains hum in the force [N].
        stroke_ripple: and in the stroke [m].
        mains_frequency: of the hum [Hz].
        spike_rate: mean number of spikes in the force per second [1/s]. A spike is one sample.
        spike_size: of a spike [N], of either sign.
        force_limit: magnitude at which the force channel is clipped [N]; none if left out.
        stroke_limit: and the stroke channel [m].
        force_resolution: step to which the force is rounded [N]; zero rounds nothing.
        stroke_resolution: and the stroke [m].
        clock_jitter: standard deviation by which an instant of sampling differs from the time written to it [s].
        stamped_jitter: write the instants of sampling as they are; the record is then resampled, as by `bench.read`.
        reversed_force: write the force with the wrong sign.
        force_stuck_from: instant from which the force channel repeats its value [s]; never if left out.
        stroke_stuck_from: and the stroke channel [s].

    Raises:
        ValueError: a negative size, rate or resolution; a limit or mains frequency that is not positive.
    """

    force_noise: float | int = _fault("N", 0.0)
    stroke_noise: float | int = _fault("m", 0.0)
    command_noise: float | int = _fault("", 0.0)
    mains_ripple: float | int = _fault("N", 0.0)
    stroke_ripple: float | int = _fault("m", 0.0)
    mains_frequency: float | int = _fault("Hz", 50.0)
    spike_rate: float | int = _fault("1/s", 0.0)
    spike_size: float | int = _fault("N", 0.0)
    force_limit: float | int | None = _fault("N", None)
    stroke_limit: float | int | None = _fault("m", None)
    force_resolution: float | int = _fault("N", 0.0)
    stroke_resolution: float | int = _fault("m", 0.0)
    clock_jitter: float | int = _fault("s", 0.0)
    stamped_jitter: bool = False
    reversed_force: bool = False
    force_stuck_from: float | int | None = _fault("s", None)
    stroke_stuck_from: float | int | None = _fault("s", None)

    def __post_init__(self) -> None:
        for argument in ("mains_frequency", "force_limit", "stroke_limit"):
            if getattr(self, argument) is not None:
                _checks.positive(argument, getattr(self, argument))
        for each in fields(self):
            if each.metadata and getattr(self, each.name) is not None:
                _checks.nonnegative(each.name, getattr(self, each.name))

    def instants(self, time: Samples, seed: list[int]) -> Samples:
        """The instants [s] at which the samples are taken whose time is written as this."""
        return time + self.clock_jitter * np.random.default_rng([*seed, 1]).standard_normal(len(time))

    def show(self, time: Samples, stroke: Samples, force: Samples, seed: list[int]) -> tuple[Samples, Samples]:
        """What the stroke channel [m] and the force channel [N] show.

        Arguments:
            time: instants as written [s].
            stroke: at the stroke sensor [m].
            force: at the load cell [N].
            seed: of all that is random.
        """
        rng, more = np.random.default_rng(seed), np.random.default_rng([*seed, 2])
        phase = rng.uniform(0, 2 * np.pi, 2)
        hum = 2 * np.pi * self.mains_frequency * time
        stroke = stroke + self.stroke_ripple * np.sin(hum + phase[0])
        stroke = stroke + self.stroke_noise * rng.standard_normal(len(time))
        force = force + self.mains_ripple * np.sin(hum + phase[1]) + self.force_noise * rng.standard_normal(len(time))
        hit = more.random(len(time)) < self.spike_rate * (time[1] - time[0])
        force = force + hit * self.spike_size * more.choice([-1.0, 1.0], len(time))
        force = -force if self.reversed_force else force
        force = _converted(force, self.force_limit, self.force_resolution)
        stroke = _converted(stroke, self.stroke_limit, self.stroke_resolution)
        return _stuck(time, stroke, self.stroke_stuck_from), _stuck(time, force, self.force_stuck_from)

    def shown_command(self, time: Samples, command: Samples, seed: list[int]) -> Samples:
        """What the channel of the command shows, in its unit."""
        return command + self.command_noise * np.random.default_rng([*seed, 3]).standard_normal(len(time))

    def described(self) -> list[str]:
        """The faults that are there, with their sizes."""
        there = [each for each in fields(self) if getattr(self, each.name) != each.default]
        return [described(each.name, getattr(self, each.name), each.metadata.get("unit", "")) for each in there]


def described(name: str, value: float, unit: str) -> str:
    """A setting in words: "force delay 0.003 s"."""
    words = name.replace("_", " ")
    return words if value is True else f"{words} {float(value):g} {unit}".rstrip()


def _converted(values: Samples, limit: float | None, resolution: float) -> Samples:
    """A channel clipped at a limit and rounded to a resolution."""
    if limit is not None:
        values = np.clip(values, -limit, limit)
    return resolution * np.round(values / resolution) if resolution > 0 else values


def _stuck(time: Samples, values: Samples, since: float | None) -> Samples:
    """A channel that repeats its value from an instant on."""
    if since is None or since > time[-1]:
        return values
    first = int(np.searchsorted(time, since))
    return np.where(time >= since, values[first], values)
