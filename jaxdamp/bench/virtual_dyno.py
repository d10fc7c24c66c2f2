"""The bench as a program: records of a law as a real machine with its faults would write them, channel by channel."""

import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, replace
from typing import Any, final

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp.bench.clock import FEWEST, Part, regular_parts
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.programmes import Excitation
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.sets import BenchSet
from jaxdamp.bench.velocity import estimate_velocity
from jaxdamp.dampers import AbstractDamper, Heated, require_finite_force
from jaxdamp.parameters import modules_inside, parameters
from jaxdamp.rig import Rig


def _fault(unit: str, default: float | None = 0.0) -> Any:
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

    force_noise: float | int = _fault("N")
    stroke_noise: float | int = _fault("m")
    mains_ripple: float | int = _fault("N")
    stroke_ripple: float | int = _fault("m")
    mains_frequency: float | int = _fault("Hz", 50.0)
    spike_rate: float | int = _fault("1/s")
    spike_size: float | int = _fault("N")
    force_limit: float | int | None = _fault("N", None)
    stroke_limit: float | int | None = _fault("m", None)
    force_resolution: float | int = _fault("N")
    stroke_resolution: float | int = _fault("m")
    clock_jitter: float | int = _fault("s")
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

    def described(self) -> list[str]:
        """The faults that are there, with their sizes."""
        there = [each for each in fields(self) if getattr(self, each.name) != each.default]
        return [described(each.name, getattr(self, each.name), each.metadata.get("unit", "")) for each in there]


def described(name: str, value: Any, unit: str) -> str:
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


Channels = Float[np.ndarray, "tests time"]
_PER_CYCLE = 4000  # steps of the law per period of the fastest motion: error of about 1e-6, see the tests
_PER_SAMPLE = 2  # and at least so many per sample, for stiff laws under slow motion


@final
@dataclass(frozen=True, eq=False, init=False)
class VirtualDyno:
    """A test bench for a damper law, with all that a real machine adds and with the faults of its sensors.

    The law is integrated on a grid much finer than the records (at least 4000 steps a period), under the exact stroke
    and velocity; the machine adds its share (`rig`), and the sensors are read (`sensors`). The velocity in the records
    is not the true one but `estimate_velocity` of the measured stroke, as in records read from files. A machine that
    heats the damper begins with the warm-up of each test.

    Rest, run-up and run-down belong to the tests (`SineTest`).

    Arguments:
        law: the damper. Friction that sticks and slips is a law too: `law + dampers.StribeckFriction(...)`.
        sampling_rate: of the records [Hz].
        rig: what the machine adds: gas, friction, moving mass, heat, delay, lag, offsets.
        sensors: noise and faults of the channels.
        temperature_channel: whether the records hold the temperature of the damper [K].
        seed: of all that is random. The noise of a record depends on the seed and its name only, not on the other
            records.
        settings: any field of `Rig` or `Sensors` by its name, for short: `VirtualDyno(law, force_noise=5.0,
            gas_force=-120.0)`.

    Raises:
        ValueError: what `Rig` and `Sensors` refuse; a sampling rate that is not positive.
        TypeError: a name that is none of their fields.

    >>> from jaxdamp.bench import programmes
    >>> from jaxdamp.dampers import Linear
    >>> VirtualDyno(Linear(2500.0), force_noise=2.0).run(programmes.paper_003())["50mm_0.5Hz"]
    BenchRun('50mm_0.5Hz': 6 s at 2000 Hz, 0.5 Hz, 50 mm, up to 0.157 m/s, -398.3 … 398.3 N)
    """

    law: AbstractDamper
    sampling_rate: float | int
    rig: Rig
    sensors: Sensors
    temperature_channel: bool
    seed: int

    def __init__(
        self,
        law: AbstractDamper,
        sampling_rate: float | int = 2000.0,
        *,
        rig: Rig | None = None,
        sensors: Sensors | None = None,
        temperature_channel: bool = False,
        seed: int = 0,
        **settings: Any,
    ) -> None:
        check_module("law", law, (AbstractDamper,), "VirtualDyno(law, force_noise=20.0)")
        rig, sensors = rig or Rig(), sensors or Sensors()
        if temperature_channel and any(isinstance(inside, Heated) for _, inside in modules_inside(law)):
            remedy = (
                "Leave the channel out, or let the machine heat a law without heat: VirtualDyno(law, rig=Rig(...))."
            )
            _checks.refuse("temperature_channel", "be False for a law with its own heat", repr(law), remedy)
        check_module("rig", rig, (Rig,), "VirtualDyno(law, rig=Rig(gas_force=-100.0))")
        _checks.instance("sensors", sensors, Sensors, "be sensors", "Write `bench.Sensors(force_noise=5.0)`.")
        _checks.positive("sampling_rate", sampling_rate)
        for_rig = {name: settings.pop(name) for name in _names(Rig) if name in settings}
        for_sensors = {name: settings.pop(name) for name in _names(Sensors) if name in settings}
        if settings:
            name = next(iter(settings))
            near = _checks.nearest(name, [*_names(Rig), *_names(Sensors)])
            hint = f" Did you mean {near!r}?" if near else ""
            raise TypeError(f"VirtualDyno has no argument {name!r}, and neither Rig nor Sensors such a field.{hint}")
        made = {
            "law": law,
            "rig": replace(rig, **for_rig),
            "sensors": replace(sensors, **for_sensors),
            "sampling_rate": sampling_rate,
            "temperature_channel": temperature_channel,
            "seed": seed,
        }
        for name, value in made.items():
            object.__setattr__(self, name, value)

    def run(
        self, tests: Excitation | Iterable[Excitation], *, progress: Callable[[int, int], None] | None = None
    ) -> BenchSet:
        """Run a test or a programme.

        Arguments:
            tests: one test, or several with different names, see `jaxdamp.bench.programmes`.
            progress: called with the number of tests done and of all tests, after each.

        Returns:
            One record per test.

        Raises:
            ValueError: no test, a test that gives fewer than 20 samples or has fewer than 4 samples a period.
        """
        programme = list(tests) if isinstance(tests, Iterable) else [tests]
        if not programme:
            _checks.refuse("tests", "hold at least one test", "empty")
        for index, test in enumerate(programme):
            must, remedy = "be a test", "Take `bench.SineTest(amplitude=0.02, frequency=2.0)` or `bench.programmes`."
            _checks.instance(f"tests[{index}]", test, Excitation, must, remedy)
            self._check(test)
        names = [test.name for test in programme]
        if len(set(names)) < len(names):
            _checks.refuse("tests", "have different names", ", ".join(names), "Give `name` to tests that are alike.")
        runs: dict[int, BenchRun] = {}
        for members in self._groups(programme):
            for i, grid, force, warm in zip(members, *self._readings([programme[i] for i in members]), strict=True):
                runs[i] = self._record(programme[i], grid, force, warm)
                if progress is not None:
                    progress(len(runs), len(programme))
        return BenchSet(runs[i] for i in range(len(programme)))

    def _check(self, test: Excitation) -> None:
        count, per_period = round(test.duration * self.sampling_rate), self.sampling_rate / test.highest_frequency
        if count < FEWEST or per_period < 4:
            _checks.refuse(
                "sampling_rate",
                f"give {test.name!r} at least {FEWEST} samples and 4 a period",
                f"{self.sampling_rate:g} Hz, which gives {count} and {per_period:.3g}",
                "Sample faster, or record more cycles.",
            )

    def _fine_grid(self, test: Excitation) -> tuple[float, int, int]:
        """Step [s], steps of the warm-up and number of instants of the grid on which the law is integrated.

        The number is rounded up, so that tests of similar length share one compiled function and one call.
        """
        finer = max(_PER_SAMPLE, int(np.ceil(_PER_CYCLE * test.highest_frequency / self.sampling_rate)))
        step = 1 / (self.sampling_rate * finer)
        before = int(np.ceil(test.warm_up / step))
        behind = max(-float(self.rig.force_delay), 0.0) + 6 * self.sensors.clock_jitter
        needed = before + round(test.duration * self.sampling_rate) * finer + int(np.ceil(behind / step))
        unit = 1 << max(needed.bit_length() - 3, 0)
        return step, before, -(-needed // unit) * unit

    def _groups(self, programme: list[Excitation]) -> list[list[int]]:
        """Numbers of the tests whose grids have the same length."""
        counts = [self._fine_grid(test)[2] for test in programme]
        return [[i for i, count in enumerate(counts) if count == length] for length in dict.fromkeys(counts)]

    def _readings(self, tests: list[Excitation]) -> tuple[list[Samples], Channels, Channels]:
        """Fine grids [s] of tests with equal grids; there, force at the load cell [N] and temperature [K]."""
        grids = []
        for test in tests:
            step, before, count = self._fine_grid(test)
            grids.append(step * np.arange(-before, count - before))
        strokes = np.stack([test.stroke(grid) for test, grid in zip(tests, grids, strict=True)])
        velocities = np.stack([test.velocity(grid) for test, grid in zip(tests, grids, strict=True)])
        force, temperature = _exact_readings(self.law, self.rig, np.stack(grids), strokes, velocities)
        return grids, force, temperature

    def _record(self, test: Excitation, grid: Samples, force: Samples, temperature: Samples) -> BenchRun:
        """What the sensors make of the truth."""
        seed = [self.seed, zlib.crc32(test.name.encode())]
        time = np.arange(round(test.duration * self.sampling_rate)) / self.sampling_rate
        taken = self.sensors.instants(time, seed)
        stroke = test.stroke(taken) + float(self.rig.stroke_offset)
        stroke, force = self.sensors.show(time, stroke, np.interp(taken, grid, force), seed)
        made: tuple[str, ...] = (self._note(),)
        if self.sensors.stamped_jitter:
            part = self._stamped(taken, test.name)
            time, stroke, force, made = part.time, part.of(stroke), part.of(force), (*made, *part.notes)
        velocity, how = estimate_velocity(time, stroke)
        warm = np.interp(time, grid, temperature) if self.temperature_channel else None
        notes = (*made, how)
        return BenchRun(test.name, time, stroke, velocity, force, warm, source="virtual dyno", notes=notes)

    def _stamped(self, taken: Samples, name: str) -> Part:
        """Uniform instants for those at which the samples were taken."""
        steps = np.diff(taken) * self.sampling_rate
        if steps.min() <= 0 or len(parts := regular_parts(taken, name)) > 1:
            must = f"be small beside a step, {1 / self.sampling_rate:.3g} s, so that stamps increase and leave no gaps"
            _checks.refuse("clock_jitter", must, self.sensors.clock_jitter)
        return parts[0]

    def _note(self) -> str:
        """The settings of the bench that are not their defaults, in words."""
        machine = [
            described(p.path, p.value, p.unit)
            for p, q in zip(parameters(self.rig), parameters(Rig()), strict=True)
            if p.value != q.value
        ]
        faults = [f"sampled at {self.sampling_rate:g} Hz", *self.sensors.described(), *machine, f"seed {self.seed}"]
        return f"made by the virtual dyno from {type(self.law).__name__}: {', '.join(faults)}"


def _names(kind: type) -> list[str]:
    """The fields of a class."""
    return [field.name for field in fields(kind)]


def _exact_readings(
    law: AbstractDamper, rig: Rig, time: Channels, stroke: Channels, velocity: Channels
) -> tuple[Channels, Channels]:
    """`Rig.readings` for several tests, in float64 whatever the session's precision: its steps are microseconds."""
    with jax.enable_x64(True):
        law_64, rig_64 = jax.tree.map(lambda a: a.astype(np.float64) if eqx.is_inexact_array(a) else a, (law, rig))
        channels = (jax.numpy.asarray(channel) for channel in (time, stroke + rig_64.stroke_offset, velocity))
        force, temperature = map(np.asarray, jax.vmap(lambda t, x, v: rig_64.readings(law_64, t, x, v))(*channels))
    require_finite_force(law, force, "over the whole programme")
    return force, temperature
