"""One record of a test bench."""

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, final

import numpy as np
from jaxtyping import ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._tables import Contents, plain
from jaxdamp._types import Figure
from jaxdamp.bench import clock
from jaxdamp.bench.headers import COMMAND_HEADER
from jaxdamp.bench.motion import cycle_instants, cycle_works, dominant_frequency, motion_amplitude
from jaxdamp.bench.processing import BESIDE, Origin, Steps, choose_cycles, cut_between, processed
from jaxdamp.bench.units import COMMAND_UNITS
from jaxdamp.bench.velocity import estimate_velocity


FILE_MARK = "# jaxdamp bench record: stroke and velocity positive in extension, force positive resisting it"
NOTE_MARK = "# note: "
COMMAND_MARK = "# command: "
SETTINGS_MARK = "# settings: "
INTEGRATED_MARK = "# stroke: integrated from the velocity"
_HEADERS = {"time": "time [s]", "stroke": "stroke [m]", "velocity": "velocity [m/s]", "force": "force [N]"}


@final
@dataclass(frozen=True, repr=False, eq=False)
class BenchRun:
    """One record of a bench: one excitation of one damper at one setting.

    Stroke and velocity are positive in extension (rebound), the force is positive when it resists extension. The
    arrays are copies and cannot be written to; whatever was done to the measured data stands in the notes.

    Arguments:
        name: of the record, by which a set finds it.
        time: instants [s], uniform and increasing, shape (time,).
        stroke: as measured [m], shape (time,).
        velocity: [m/s], shape (time,).
        force: [N], shape (time,).
        temperature: [K], shape (time,), if it was measured.
        command: what was set on the damper for this record and held: coil current, voltage, clicks, in a unit of your
            choice; for laws that take a command (`dampers.with_command`).
        command_channel: what was set instead if it varies during the record, as measured, shape (time,).
        command_unit: unit of this channel: "A", "V" or "%".
        settings: what else is known, by name: clicks, the test, the temperature at the start ("80 degC"), a parameter
            of the law with its unit, such as `{"gas.pressure": "20 bar"}`, which fits take as known for this record.
        source: the file, or what else the record comes from.
        notes: sentences on what was done to the data.
        stroke_is_integrated: the stroke was integrated from the velocity, so that its zero is the middle of the motion
            and no place in the damper.
        units: of the numbers in the file, by channel, as they were stated and brought to SI; empty for other records.
        of_points: each sample is a point of a force-velocity table and stands for itself; time and stroke are made up.

    Raises:
        ValueError: channels of different lengths, fewer than 20 samples, NaN, time not uniform, constant stroke; a
            command that is held beside one that varies.

    >>> time = np.arange(1000) / 1000
    >>> run = BenchRun.from_arrays("3 Hz", time, 0.01 * np.sin(6 * np.pi * time), 300 * np.cos(6 * np.pi * time))
    >>> run
    BenchRun('3 Hz': 1 s at 1000 Hz, 3 Hz, 10 mm, up to 0.188 m/s, -300 … 300 N)
    >>> round(run.work_per_cycle, 2)  # π · 300 N · 0.01 m
    9.42
    """

    name: str
    time: Float[np.ndarray, " time"]
    stroke: Float[np.ndarray, " time"]
    velocity: Float[np.ndarray, " time"]
    force: Float[np.ndarray, " time"]
    temperature: Float[np.ndarray, " time"] | None = None
    command: float | None = None
    source: str = ""
    notes: tuple[str, ...] = ()
    settings: Mapping[str, float | int | str] = field(default_factory=dict)
    stroke_is_integrated: bool = False
    command_channel: Float[np.ndarray, " time"] | None = None
    command_unit: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    of_points: bool = False
    _origin: Origin | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        where = f"record {self.name!r}"
        for channel in (*_HEADERS, *(name for name in BESIDE if getattr(self, name) is not None)):
            values = clock.channel_of(channel, getattr(self, channel), len(self.time))
            clock.check_numbers(values, channel, where)
            values.setflags(write=False)
            object.__setattr__(self, channel, values)
        if self.command is not None:
            _checks.finite("command", np.asarray(self.command))
            object.__setattr__(self, "command", float(self.command))
            if self.command_channel is not None:
                remedy = "Leave out the number, or the channel if it only shows what was held."
                _checks.refuse("command", "be left out beside a `command_channel`", f"{self.command:g}", remedy)
        if self.command_channel is not None:
            _checks.one_of("command_unit", self.command_unit, COMMAND_UNITS)
        object.__setattr__(self, "notes", tuple(self.notes))
        if not self.of_points:
            clock.check_count(len(self.time), where)
        clock.check_time(self.time, where)
        clock.check_stroke(self.stroke, where)

    @classmethod
    def from_arrays(
        cls,
        name: str,
        time: ArrayLike,
        stroke: ArrayLike,
        force: ArrayLike,
        velocity: ArrayLike | None = None,
        *,
        temperature: ArrayLike | None = None,
        command: float | ArrayLike | None = None,
        command_unit: str = "",
        source: str = "",
        notes: Iterable[str] = (),
    ) -> "BenchRun":
        """A record from arrays in SI and the library's sign; without a velocity it is derived from the stroke.

        A command that is an array, in its unit, is a channel that varies.
        """
        notes, count = tuple(notes), np.size(time)
        stroke, force = clock.channel_of("stroke", stroke, count), clock.channel_of("force", force, count)
        if velocity is None:
            velocity, how = estimate_velocity(time, stroke)
            notes = (*notes, how)
        velocity, time = clock.channel_of("velocity", velocity, count), clock.channel_of("time", time, count)
        warm = None if temperature is None else clock.channel_of("temperature", temperature, count)
        varies = np.ndim(command) > 0 if command is not None else False
        held = None if varies or command is None else float(np.asarray(command))
        return cls(
            name,
            time,
            stroke,
            velocity,
            force,
            warm,
            held,
            source,
            notes,
            command_channel=clock.channel_of("command", command, count) if varies and command is not None else None,
            command_unit=command_unit if varies else "",
        )

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.time)

    @property
    def sampling_rate(self) -> float:
        """Samples per second [Hz]."""
        return float((len(self.time) - 1) / (self.time[-1] - self.time[0]))

    @property
    def duration(self) -> float:
        """Number of samples over sampling rate [s]."""
        return len(self.time) / self.sampling_rate

    @property
    def commands(self) -> Float[np.ndarray, " time"] | None:
        """The command at every sample, measured or held; None if neither is known."""
        if self.command_channel is None and self.command is not None:
            return np.full(len(self), self.command)
        return self.command_channel

    def held_at(self, command: float | int) -> "BenchRun":
        """The same record with a command that is held, whatever its channel shows."""
        return replace(self, command=float(command), command_channel=None, command_unit="")

    @cached_property
    def fingerprint(self) -> bytes:
        """A digest of the samples, the same for a record that is read again, copied or renamed."""
        return clock.digest(self.time, self.stroke, self.velocity, self.force)

    @cached_property
    def frequency(self) -> float:
        """Frequency of the motion [Hz]: one over the median time between passages of mid-stroke in one direction."""
        return dominant_frequency(self.time, self.stroke)

    @cached_property
    def amplitude(self) -> float:
        """Half the range of the stroke [m], zero to peak, smoothed over a twentieth of a period."""
        return motion_amplitude(self.time, self.stroke, self.frequency)

    @cached_property
    def cycles(self) -> int:
        """Number of full cycles, from one passage of mid-stroke to the next in the same direction."""
        return max(len(self.cycle_instants) - 1, 0)

    @cached_property
    def cycle_instants(self) -> Float[np.ndarray, " instants"]:
        """Instants [s] at which full cycles begin and, last, at which the last one ends."""
        return cycle_instants(self.time, self.stroke)

    @property
    def peak_velocity(self) -> float:
        """Largest magnitude of the velocity [m/s]."""
        return float(np.max(np.abs(self.velocity)))

    @property
    def dissipated_energy(self) -> float:
        """Work ∫ F v dt of the whole record [J]."""
        return float(np.trapezoid(self.force * self.velocity, self.time))

    @cached_property
    def work_per_cycle(self) -> float:
        """Median over the full cycles of the work ∮ F v dt [J]; the whole record's if it has no full cycle.

        The median leaves the first and last cycles, in which a machine runs up and down, without influence.
        """
        works = cycle_works(self.time, self.force * self.velocity, self.cycle_instants)
        return float(np.median(works)) if len(works) else self.dissipated_energy

    @property
    def raw(self) -> "BenchRun":
        """The record before all processing and cutting; itself if nothing was done to it."""
        return self if self._origin is None else self._origin.raw

    @property
    def steps(self) -> Steps:
        """The steps of processing that were done."""
        return Steps() if self._origin is None else self._origin.steps

    def process(self, **steps: Any) -> "BenchRun":
        """A record with further steps of processing, each named in its notes; `raw` stays as it is.

        The steps of this record and the further ones are done in one fixed order, that of the arguments, so the order
        in which they are asked for does not matter; where it would, the call is refused.

        Arguments:
            steps: those of `bench.Steps`: `delay`, `low_pass`, `between`, `moving`, `skip_cycles`, `last_cycles`,
                `without`, `mean_cycle`.

        Raises:
            ValueError: a step that this record cannot have, such as more cycles than there are, or a filter behind
                `between` or `last_cycles`, which would begin anew at the cut.

        >>> time = np.arange(3000) / 1000
        >>> stroke = 0.01 * np.sin(2 * np.pi * 2 * np.clip(time - 0.5, 0.0, 2.0))
        >>> run = BenchRun.from_arrays("2 Hz", time, stroke, np.cos(12.566 * time))
        >>> part = run.process(low_pass=100.0).process(moving=True)
        >>> part.notes[-1]
        'rest cut off: 0.491 s before and 0.49 s after the motion'
        >>> part.raw is run
        True
        """
        origin = Origin(self, self, Steps()) if self._origin is None else self._origin
        more = Steps(**steps)
        if origin.base is not origin.raw:
            for step in ("delay", "low_pass"):
                if getattr(more, step) is not None:
                    remedy = "Begin with `run.raw`, and cut by `process(between=...)` or `process(last_cycles=...)`."
                    why = "be asked for before a record is cut, since it needs what lies beyond the cut"
                    _checks.refuse(step, why, getattr(more, step), remedy)
        together = origin.steps.and_then(more)
        return processed(origin.base, together)._from(Origin(origin.raw, origin.base, together))

    def _from(self, origin: Origin | None) -> "BenchRun":
        object.__setattr__(self, "_origin", origin)
        return self

    def _cut(self, part: "BenchRun") -> "BenchRun":
        """A part of the record as a record of its own, which still knows the raw one."""
        return part._from(Origin(self.raw, part, Steps()))

    def between(self, start: float | int, stop: float | int) -> "BenchRun":
        """The part of the record with start ≤ time < stop [s]; the velocity is not computed anew."""
        return self._cut(cut_between(self, start, stop))

    def last_cycles(self, count: int = 1) -> "BenchRun":
        """The last full cycles of the record, from one passage of mid-stroke to another."""
        return self._cut(choose_cycles(self, 0, count))

    def summary(self) -> Contents:
        """The figures of the record in SI, one row of the set's table."""
        return {
            "name": self.name,
            "command": self.command,
            "samples": len(self),
            "sampling_rate": self.sampling_rate,
            "cycles": self.cycles,
            "frequency": self.frequency,
            "amplitude": self.amplitude,
            "peak_velocity": self.peak_velocity,
            "largest_force": float(self.force.max()),
            "smallest_force": float(self.force.min()),
            "work_per_cycle": self.work_per_cycle,
        }

    def describe(self) -> str:
        """What the record is and what was done to its data, in words."""
        lines = [
            f"{self.name}",
            f"  source       {self.source or 'arrays'}",
            f"  samples      {len(self)} at {self.sampling_rate:.6g} Hz, {self.duration:.4g} s, {self.cycles} cycles",
            f"  motion       {self.frequency:.4g} Hz, {1e3 * self.amplitude:.4g} mm zero to peak, "
            f"up to {self.peak_velocity:.4g} m/s",
            f"  force        {self.force.min():.4g} … {self.force.max():.4g} N",
            f"  work         {self.work_per_cycle:.4g} J per cycle",
        ]
        if self.temperature is not None:
            warm = self.temperature - 273.15
            lines.append(f"  temperature  {warm.min():.1f} … {warm.max():.1f} °C")
        if self.command is not None:
            lines.append(f"  command      {self.command:g}")
        if (channel := self.command_channel) is not None:
            lines.append(f"  command      {channel.min():.4g} … {channel.max():.4g} {self.command_unit}".rstrip())
        lines += [f"  {key:<12} {value}" for key, value in self.settings.items()]
        return "\n".join(lines + [f"  - {note}" for note in self.notes])

    def __repr__(self) -> str:
        return (
            f"BenchRun({self.name!r}: {self.duration:.4g} s at {self.sampling_rate:.6g} Hz, {self.frequency:.4g} Hz, "
            f"{1e3 * self.amplitude:.4g} mm, up to {self.peak_velocity:.3g} m/s, "
            f"{self.force.min():.4g} … {self.force.max():.4g} N)"
        )

    def plot(self) -> Figure:
        """Loops over velocity and stroke, and the channels over time (`plots.records`)."""
        from jaxdamp import plots

        return plots.records(self)

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the record with units in its header; `read` gives back the same numbers to the last bit."""
        channels = [getattr(self, channel) for channel in _HEADERS]
        header = list(_HEADERS.values())
        if self.temperature is not None:
            channels, header = [*channels, self.temperature], [*header, "temperature [K]"]
        if self.command_channel is not None:
            channels, header = [*channels, self.command_channel], [*header, f"{COMMAND_HEADER} [{self.command_unit}]"]
        command = [] if self.command is None else [f"{COMMAND_MARK}{self.command!r}"]
        settings = [SETTINGS_MARK + json.dumps(plain(self.settings))] if self.settings else []
        integrated = [INTEGRATED_MARK] * self.stroke_is_integrated
        notes = [NOTE_MARK + " ".join(note.split()) for note in self.notes]
        lines = [FILE_MARK, *command, *settings, *integrated, *notes, ",".join(header)]
        lines += [",".join(map(repr, row)) for row in np.stack(channels, axis=1).tolist()]
        path = Path(path)
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path
