"""Records as printed C takes them: behind the delay of a machine, between samples by cubics, with its moving mass."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float


PRINTED = ("delay", "inertia", "lag", "command_lag")  # effects of a machine that are computed here
Samples = Float[np.ndarray, " time"]


class MachineNumbers(NamedTuple):
    """The numbers of a machine that act here."""

    delay: float  # s
    mass: float  # kg
    lag: float  # s


class MachinePlaces(NamedTuple):
    """Where the numbers delay, mass and lag stand, or their derivatives: −1 where there are none."""

    delay: int
    mass: int
    lag: int


class Motion(NamedTuple):
    """A stroke and its velocity at the samples and at so many parts of each interval, or derivatives of these."""

    stroke: Samples
    velocity: Samples
    fine_stroke: Float[np.ndarray, " fine"]
    fine_velocity: Float[np.ndarray, " fine"]

    @classmethod
    def refined(cls, stroke: Samples, velocity: Samples, dt: float, parts: int) -> "Motion":
        """`marching.finer` by NumPy."""
        x, v = np.ascontiguousarray(stroke), np.ascontiguousarray(velocity)
        if parts == 1:
            return cls(x, v, x, v)
        return cls(x, v, _refined(x, dt * v, parts), _refined(v, slopes(v), parts))

    def at_parts(self) -> "Motion":
        """The same, whose samples are the parts."""
        return self._replace(stroke=self.fine_stroke, velocity=self.fine_velocity)

    def places(self) -> list[int]:
        """Where the arrays are in memory, which must hold them meanwhile."""
        return [array.ctypes.data for array in self]


class Record(NamedTuple):
    """What the function of a record takes."""

    motion: Motion
    by_delay: Motion | None  # its derivatives by the delay; None if there is none
    parts: int
    step: float  # s, of a part
    weight: Samples
    force: Samples
    used: int  # samples, as `PrintedRecord.used`


@dataclasses.dataclass(frozen=True)
class PrintedRecord:
    """A record of a batch, with what its machine adds.

    Attributes:
        dt: time step [s].
        stroke: measured stroke [m].
        velocity: of it [m/s].
        weight: of each sample in the residual; zero for those that are left out.
        force: measured force [N].
        parts: into which the step is divided.
        effects: of the machine, some of `PRINTED`.
    """

    dt: float
    stroke: Samples
    velocity: Samples
    weight: Samples
    force: Samples
    parts: int
    effects: tuple[str, ...]

    @functools.cached_property
    def used(self) -> int:
        """The number of samples up to the last one with a weight."""
        return int(np.flatnonzero(self.weight > 0)[-1]) + 1 if np.any(self.weight > 0) else 0

    @functools.cached_property
    def still(self) -> Record:
        """The record without a machine, weighted."""
        motion = Motion.refined(self.stroke, self.velocity, self.dt, self.parts)
        return Record(motion, None, self.parts, self.dt / self.parts, self.weight, self.force, self.used)

    def on_machine(self, delay: float) -> Record:
        """The record later by a delay [s], its force without a weight; at every part of a step before a lag."""
        motions = [(self.stroke, self.velocity)]
        if "delay" in self.effects:
            (x, by_x), (v, by_v) = (delayed_samples(values, delay / self.dt) for values in motions[0])
            motions = [(x, v), (by_x / self.dt, by_v / self.dt)]
        first, *others = (Motion.refined(x, v, self.dt, self.parts) for x, v in motions)
        parts, step = self.parts, self.dt / self.parts
        if "lag" in self.effects:
            first, *others = (each.at_parts() for each in (first, *others))
            parts = 1
        count, fine = first.stroke.size, self.parts // parts
        used = max((self.used - 1) * fine + 1, 0)
        return Record(first, others[0] if others else None, parts, step, np.ones(count), np.zeros(count), used)

    def shown(
        self,
        forces: Float[np.ndarray, "fine columns"],
        record: Record,
        numbers: MachineNumbers,
        columns: MachinePlaces,
    ) -> Float[np.ndarray, "time columns"]:
        """What the force channel shows of forces, the last column, and their derivatives, the others.

        Arguments:
            forces: of the law in the record, which are changed.
            record: `on_machine`.
            numbers: of the machine.
            columns: of the derivatives by them.
        """
        if "inertia" in self.effects:
            acceleration = slopes(record.motion.velocity)[: len(forces)] / (record.step * record.parts)
            forces[:, -1] += numbers.mass * acceleration
            _add(forces, columns.mass, acceleration)
            if record.by_delay is not None:
                change = slopes(record.by_delay.velocity)[: len(forces)] / (record.step * record.parts)
                _add(forces, columns.delay, numbers.mass * change)
        if "lag" not in self.effects:
            return forces
        forces, by_samples = lagged_samples(forces, numbers.lag / record.step)
        _add(forces, columns.lag, by_samples / record.step)
        return forces[:: self.parts]

    def missed(self, shown: Float[np.ndarray, "time columns"]) -> Float[np.ndarray, "time columns"]:
        """The weighted difference from what was measured, the last column, and its derivatives, in the same place."""
        weight = self.weight[: len(shown)]
        shown[:, -1] -= self.force[: len(shown)]
        shown *= weight[:, None]
        shown[~(weight > 0)] = 0.0  # beside a force that is no number too
        return shown


def _add(forces: Float[np.ndarray, "time columns"], column: int, change: Samples) -> None:
    """Add to the derivatives by a number, if it is free."""
    if column >= 0:
        forces[:, column] += change


def delayed_samples(values: Samples, samples: float) -> tuple[Samples, Samples]:
    """`sensor.delayed` of values by NumPy, and its derivative by the number of samples."""
    last = len(values) - 1
    wanted = np.arange(len(values)) - samples
    places = np.clip(wanted, 0.0, last)
    before = np.clip(places.astype(int), 0, last - 1)
    s, rises = places - before, slopes(values)
    ends = (values[before], rises[before], values[before + 1], rises[before + 1])
    inside = 0.5 * ((wanted >= 0) & (wanted <= last)) + 0.5 * ((wanted > 0) & (wanted < last))
    return _hermite(ends, s), -inside * _slope_of_hermite(ends, s)


def lagged_samples(
    values: Float[np.ndarray, "time columns"], samples: float
) -> tuple[Float[np.ndarray, "time columns"], Samples]:
    """`sensor.lagged` of values, column by column, and the derivative of the last one by the number of samples."""
    there = samples > 1e-3
    decay = np.exp(-1.0 / samples) if there else 0.0
    by_decay = decay / samples**2 if there else 0.0
    mean, by_mean = samples * (1.0 - decay), 1.0 - decay - samples * by_decay
    fed = np.concatenate([values[:1], (1.0 - mean) * values[1:] + (mean - decay) * values[:-1]])
    later = _decaying(fed, decay)
    last, shown = values[:, -1], later[:, -1]
    change = np.append(0.0, by_decay * shown[:-1] + (by_mean - by_decay) * last[:-1] - by_mean * last[1:])
    return later, _decaying(change, decay)


def _decaying(fed: np.ndarray, decay: float) -> np.ndarray:
    """Y of y[k] = decay · y[k-1] + fed[k], along the first axis."""
    from scipy.linalg import solve_banded  # `scipy.signal` has filters, and takes half a second to import

    lines = np.ones((2, len(fed)))
    lines[1] = -decay
    return np.asarray(solve_banded((1, 0), lines, fed, check_finite=False))


def slopes(values: Samples) -> Samples:
    """`marching.slopes` by NumPy, for a step of one."""
    if values.size < 5:
        return np.gradient(values)
    inner = (values[:-4] - 8.0 * values[1:-3] + 8.0 * values[3:-1] - values[4:]) / 12.0
    edge = np.array([[-25.0, 48.0, -36.0, 16.0, -3.0], [-3.0, -10.0, 18.0, -6.0, 1.0]]) / 12.0
    return np.concatenate([edge @ values[:5], inner, -(edge @ values[:-6:-1])[::-1]])


def _hermite(ends: Sequence[np.ndarray], s: np.ndarray) -> np.ndarray:
    """The cubic at a share s of an interval, from value and rise at its start and at its end."""
    start, start_rise, stop, stop_rise = ends
    between = start_rise * (s * (1 - s) ** 2) + stop_rise * (s * s * (s - 1))
    return start * ((1 + 2 * s) * (1 - s) ** 2) + stop * (s * s * (3 - 2 * s)) + between


def _slope_of_hermite(ends: Sequence[np.ndarray], s: np.ndarray) -> np.ndarray:
    start, start_rise, stop, stop_rise = ends
    return 6.0 * s * (1 - s) * (stop - start) + start_rise * (1 - s) * (1 - 3 * s) + stop_rise * s * (3 * s - 2)


def _refined(values: Samples, rises: Samples, parts: int) -> Float[np.ndarray, " fine"]:
    """The values at so many parts of each interval, from the rises over one at the samples."""
    ends = (values[:-1, None], rises[:-1, None], values[1:, None], rises[1:, None])
    return np.append(np.ravel(_hermite(ends, (np.arange(parts) / parts)[None, :])), values[-1])
