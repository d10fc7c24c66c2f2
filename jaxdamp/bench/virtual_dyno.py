"""The bench as a program: records of a law as a real machine with its faults would write them."""

import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import final

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.programmes import Excitation
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.sampling import FEWEST
from jaxdamp.bench.sets import BenchSet
from jaxdamp.bench.velocity import estimate_velocity
from jaxdamp.dampers import AbstractDamper, require_finite_force
from jaxdamp.rig import respond


_PER_CYCLE = 4000  # steps of the law per period of the fastest motion: error of about 1e-6, see the tests
_PER_SAMPLE = 2  # and at least so many per sample, for stiff laws under slow motion


@final
@dataclass(frozen=True, eq=False)
class VirtualDyno:
    """A test bench for a damper law, with the faults of sensors.

    The law is integrated on a grid much finer than the records (at least 4000 steps a period), under the exact stroke
    and velocity; then the sensors are read. The velocity in the records is not the true one but `estimate_velocity` of
    the measured stroke, as in records read from files.

    Arguments:
        law: the damper.
        sampling_rate: of the records [Hz].
        force_noise: standard deviation of the white noise of the load cell [N].
        stroke_noise: of the stroke sensor [m].
        force_delay: by which the force channel lags behind the stroke channel [s].
        force_offset: zero error of the load cell [N].
        mains_ripple: amplitude of the mains hum in the force [N].
        stroke_ripple: and in the stroke [m].
        mains_frequency: of the hum [Hz].
        gas_force: constant force of the gas [N]. It pushes the rod out, so it is negative in our sign.
        friction: Coulomb friction of the seal [N], F = friction · tanh(v / friction_velocity).
        friction_velocity: where the friction is fully there [m/s].
        seed: of all noise. The noise of a record depends on the seed and its name only, not on the other records.

    Raises:
        ValueError: a negative noise, rate, delay or friction, or a positive gas force.

    >>> from jaxdamp.bench import programmes
    >>> from jaxdamp.dampers import Linear
    >>> VirtualDyno(Linear(2500.0), force_noise=2.0).run(programmes.paper_003())["50mm_0.5Hz"]
    BenchRun('50mm_0.5Hz': 6 s at 2000 Hz, 0.5 Hz, 50 mm, up to 0.157 m/s, -398.3 … 398.3 N)
    """

    law: AbstractDamper
    sampling_rate: float | int = 2000.0
    force_noise: float | int = 0.0
    stroke_noise: float | int = 0.0
    force_delay: float | int = 0.0
    force_offset: float | int = 0.0
    mains_ripple: float | int = 0.0
    stroke_ripple: float | int = 0.0
    mains_frequency: float | int = 50.0
    gas_force: float | int = 0.0
    friction: float | int = 0.0
    friction_velocity: float | int = 0.005
    seed: int = 0

    def __post_init__(self) -> None:
        check_module("law", self.law, (AbstractDamper,), "VirtualDyno(law, force_noise=20.0)")
        for argument in ("sampling_rate", "mains_frequency", "friction_velocity"):
            _checks.positive(argument, getattr(self, argument))
        for argument in ("force_noise", "stroke_noise", "force_delay", "mains_ripple", "stroke_ripple", "friction"):
            _checks.nonnegative(argument, getattr(self, argument))
        _checks.finite("force_offset", self.force_offset)
        if not self.gas_force <= 0:
            remedy = "It pushes the rod out, while our force counts positive when it resists extension."
            _checks.refuse("gas_force", "be negative or zero", self.gas_force, remedy)

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
            forces = self._forces([programme[i] for i in members])
            for i, grid, force in zip(members, *forces, strict=True):
                runs[i] = self._record(programme[i], grid, force)
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
        needed = before + round(test.duration * self.sampling_rate) * finer
        unit = 1 << max(needed.bit_length() - 3, 0)
        return step, before, -(-needed // unit) * unit

    def _groups(self, programme: list[Excitation]) -> list[list[int]]:
        """Numbers of the tests whose grids have the same length."""
        counts = [self._fine_grid(test)[2] for test in programme]
        return [[i for i, count in enumerate(counts) if count == length] for length in dict.fromkeys(counts)]

    def _forces(self, tests: list[Excitation]) -> tuple[list[Samples], list[Samples]]:
        """Fine grids [s] of tests with equal grids, and the true forces [N] there."""
        grids = []
        for test in tests:
            step, before, count = self._fine_grid(test)
            grids.append(step * np.arange(-before, count - before))
        strokes = [test.stroke(grid) for test, grid in zip(tests, grids, strict=True)]
        velocities = [test.velocity(grid) for test, grid in zip(tests, grids, strict=True)]
        forces = _exact_response(self.law, np.stack(grids), np.stack(strokes), np.stack(velocities))
        seal = [self.friction * np.tanh(velocity / self.friction_velocity) for velocity in velocities]
        return grids, [force + rub + self.gas_force for force, rub in zip(forces, seal, strict=True)]

    def _record(self, test: Excitation, grid: Samples, true_force: Samples) -> BenchRun:
        """What the sensors make of the truth."""
        rng = np.random.default_rng([self.seed, zlib.crc32(test.name.encode())])
        time = np.arange(round(test.duration * self.sampling_rate)) / self.sampling_rate
        phase = rng.uniform(0, 2 * np.pi, 2)
        hum = 2 * np.pi * self.mains_frequency * time
        stroke = test.stroke(time) + self.stroke_ripple * np.sin(hum + phase[0])
        stroke = stroke + self.stroke_noise * rng.standard_normal(len(time))
        force = np.interp(time - self.force_delay, grid, true_force) + self.force_offset
        force = force + self.mains_ripple * np.sin(hum + phase[1]) + self.force_noise * rng.standard_normal(len(time))
        velocity, how = estimate_velocity(time, stroke)
        return BenchRun(test.name, time, stroke, velocity, force, source="virtual dyno", notes=(self._note(), how))

    def _note(self) -> str:
        """The settings of the bench that are not zero, in words."""
        parts = {
            "force noise {:g} N": self.force_noise,
            "stroke noise {:g} m": self.stroke_noise,
            "force delay {:g} s": self.force_delay,
            "force offset {:g} N": self.force_offset,
            f"{self.mains_frequency:g} Hz ripple {{:g}} N in the force": self.mains_ripple,
            f"{self.mains_frequency:g} Hz ripple {{:g}} m in the stroke": self.stroke_ripple,
            "gas force {:g} N": self.gas_force,
            "friction {:g} N": self.friction,
        }
        faults = [text.format(value) for text, value in parts.items() if value]
        settings = ", ".join([f"sampled at {self.sampling_rate:g} Hz", *faults, f"seed {self.seed}"])
        return f"made by the virtual dyno from {type(self.law).__name__}: {settings}"


def _exact_response(
    law: AbstractDamper,
    time: Float[np.ndarray, "tests time"],
    stroke: Float[np.ndarray, "tests time"],
    velocity: Float[np.ndarray, "tests time"],
) -> Float[np.ndarray, "tests time"]:
    """`respond` for several tests, in float64 whatever the session's precision: its steps are microseconds."""
    with jax.enable_x64(True):
        exact = jax.tree.map(lambda leaf: leaf.astype(np.float64) if eqx.is_inexact_array(leaf) else leaf, law)
        channels = (jax.numpy.asarray(channel) for channel in (time, stroke, velocity))
        forces = np.asarray(jax.vmap(lambda t, x, v: respond(exact, t, x, v))(*channels))
    require_finite_force(law, forces, "over the whole programme")
    return forces
