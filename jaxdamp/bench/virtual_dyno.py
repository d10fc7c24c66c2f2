"""The bench as a program: records of a law as a real machine with its faults would write them, channel by channel."""

import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from typing import final

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
from jaxdamp.bench.sensors import Sensors, described
from jaxdamp.bench.sets import BenchSet
from jaxdamp.bench.velocity import estimate_velocity
from jaxdamp.bench.waveforms import CommandedExcitation
from jaxdamp.dampers import AbstractDamper, Heated, check_commands, require_finite_force
from jaxdamp.parameters import modules_inside, parameters
from jaxdamp.rig import PRINTED, PrintedRecord, Rig, numbers_on_rig, printed_forces


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

    Rest, run-up and run-down belong to the tests (`SineTest`). A test with a command (`CommandStep`) sets the damper,
    behind the lag of its actuator (`command_lag`), and the record holds the command that was set as a channel.

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
        **settings: object,
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
            ValueError: no test, a test that gives fewer than 20 samples or has fewer than 4 samples a period; a test
                with a command for a law that takes none, or with steps shorter than two samples.
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
        if isinstance(test, CommandedExcitation):
            check_commands(f"command of {test.name!r}", self.law, test.command(np.arange(count) / self.sampling_rate))
            if test.shortest_rise * self.sampling_rate < 2:
                must = f"be at least two samples of {test.name!r}, {2 / self.sampling_rate:g} s"
                _checks.refuse("rise", must, test.shortest_rise, "A record cannot show a faster step: sample faster.")

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
        """Numbers of the tests whose grids have the same length, with a command or without."""
        kinds = [(self._fine_grid(test)[2], isinstance(test, CommandedExcitation)) for test in programme]
        return [[i for i, kind in enumerate(kinds) if kind == alike] for alike in dict.fromkeys(kinds)]

    def _readings(self, tests: list[Excitation]) -> tuple[list[Samples], Channels, Channels]:
        """Fine grids [s] of tests with equal grids; there, force at the load cell [N] and temperature [K].

        They are `Rig.readings` in float64 whatever the session's precision, because the steps are microseconds.
        """
        grids = []
        for test in tests:
            step, before, count = self._fine_grid(test)
            grids.append(step * np.arange(-before, count - before))
        pairs = [*zip(tests, grids, strict=True)]
        time, velocity = np.stack(grids), np.stack([test.velocity(grid) for test, grid in pairs])
        stroke = np.stack([test.stroke(grid) for test, grid in pairs])
        commands = [test.command(grid) for test, grid in pairs if isinstance(test, CommandedExcitation)]
        with jax.enable_x64(True):
            given = self.law, self.rig
            law, rig = jax.tree.map(lambda a: a.astype(np.float64) if eqx.is_inexact_array(a) else a, given)
            stroke = stroke + float(rig.stroke_offset)
            force = None if commands else _printed(law, rig, time, stroke, velocity)
            temperature = np.full(time.shape, float(rig.reference_temperature))
            if force is None:
                command = np.stack(commands) if commands else None
                channels = jax.tree.map(jax.numpy.asarray, (time, stroke, velocity, command))
                readings = jax.vmap(lambda t, x, v, u: rig.readings(law, t, x, v, command=u))(*channels)
                force, temperature = map(np.asarray, readings)
        require_finite_force(self.law, force, "over the whole programme")
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
        run = BenchRun(test.name, time, stroke, velocity, force, warm, source="virtual dyno", notes=notes)
        if not isinstance(test, CommandedExcitation):
            return run
        command = self.sensors.shown_command(time, test.command(time), seed)
        return replace(run, command_channel=command, command_unit=test.command_unit)

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
            if float(p.value) != float(q.value)
        ]
        faults = [f"sampled at {self.sampling_rate:g} Hz", *self.sensors.described(), *machine, f"seed {self.seed}"]
        return f"made by the virtual dyno from {type(self.law).__name__}: {', '.join(faults)}"


def _names(kind: type) -> list[str]:
    return [field.name for field in fields(kind)]


def _printed(law: AbstractDamper, rig: Rig, time: Channels, stroke: Channels, velocity: Channels) -> Channels | None:
    """The force by printed C, where the steps of the states take the time; None where XLA computes it."""
    effects = rig.effects()
    if law.initial_state().size == 0 or not set(effects) <= set(PRINTED):
        return None
    steps, one, none = np.diff(time[:, :2])[:, 0], np.ones(time.shape[1]), np.zeros(time.shape[1])
    motions = zip(steps.tolist(), stroke, velocity, strict=True)
    rows = [PrintedRecord(dt, x, v, one, none, 1, effects) for dt, x, v in motions]
    forces = printed_forces([numbers_on_rig(law, rig)] * len(rows), rows)
    return None if forces is None else np.stack(forces)
