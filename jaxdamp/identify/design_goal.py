"""What a design of experiments makes small, the runs that it chooses from, and the information of a run."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, PyTree

from jaxdamp import _checks
from jaxdamp.bench import BenchRun, Excitation, MultiSineTest, RandomTest, SineTest, TriangleTest
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify.model import law_of
from jaxdamp.identify.preparing import prepare
from jaxdamp.identify.problem import linearised
from jaxdamp.identify.traces import Batch
from jaxdamp.parameters import FreeParameters, match_paths
from jaxdamp.rig import Rig


VAGUE = 1e3  # standard deviation of a parameter without a prior, relative to its value
ROUNDS = 20  # of exchanges at most
WORTH = 1e-9  # relative decrease of a criterion that counts as one
SPREAD = (1.0, 2.3, 5.3)  # frequencies of a multi-sine, relative to the lowest
OCTAVES = 3.0  # width of the band of a random test
FEWEST_CYCLES = 3  # of a run, however slow
LEAST_STROKE = 1e-4  # m, that a machine moves well


@dataclasses.dataclass(frozen=True)
class Goal:
    """What is minimised, in parameters relative to their values."""

    criterion: str
    scale: Float[np.ndarray, " free"]
    before: Float[np.ndarray, "free free"]  # information of the prior
    slopes: Float[np.ndarray, " free"]  # of the function

    @classmethod
    def of(
        cls,
        free: FreeParameters,
        criterion: str,
        function: Callable[[PyTree], PyTree] | None,
        prior: Mapping[str, float] | None,
    ) -> "Goal":
        """The goal of a criterion, with what is known of the parameters before."""
        values = np.abs(np.asarray(free.values, float))
        scale = np.where(values > 0, values, 1.0)
        spread = VAGUE * scale
        paths = [p.path for p in free.owners]
        for name, deviation in (prior or {}).items():
            _checks.positive(f"prior[{name!r}]", deviation)
            spread[np.isin(paths, match_paths(list(dict.fromkeys(paths)), [name]))] = deviation
        slopes = np.zeros(values.size)
        if function is not None:
            slopes = np.asarray(jax.grad(lambda v: jnp.asarray(function(law_of(free.build(v))), float))(free.values))
            if not np.any(slopes):
                _checks.refuse("function", "depend on a free parameter", "one that does not")
        return cls(criterion, scale, np.diag((scale / spread) ** 2), slopes * scale)

    def value(self, matrices: Float[np.ndarray, "*sets free free"]) -> Float[np.ndarray, "*sets"]:
        """The criterion of sums of information, less is better."""
        total = self.before + matrices * np.outer(self.scale, self.scale)
        if self.criterion == "D":
            return np.asarray(-np.linalg.slogdet(total)[1])
        inverse = np.linalg.inv(total)
        if self.criterion == "A":
            return np.asarray(np.trace(inverse, axis1=-2, axis2=-1))
        return np.asarray(np.einsum("i,...ij,j->...", self.slopes, inverse, self.slopes))

    def covariance(self, total: Float[np.ndarray, "free free"]) -> Float[np.ndarray, "free free"]:
        """Of the parameters, in their units."""
        return np.linalg.inv(self.before + total * np.outer(self.scale, self.scale)) * np.outer(self.scale, self.scale)

    def function_error(self, covariance: Float[np.ndarray, "free free"]) -> float | None:
        """Standard error of the function; `None` without one."""
        slopes = self.slopes / self.scale
        return float(np.sqrt(slopes @ covariance @ slopes)) if self.criterion == "c" else None

    def added(self, chosen: Sequence[int], count: int, matrices: np.ndarray) -> list[int]:
        """So many candidates more, each the best beside those before."""
        chosen, total = list(chosen), matrices[list(chosen)].sum(axis=0)
        for _ in range(count):
            best = int(np.argmin(self.value(total + matrices)))
            chosen, total = [*chosen, best], total + matrices[best]
        return chosen

    def exchanged(self, chosen: Sequence[int], matrices: np.ndarray) -> list[int]:
        """Every run replaced by the best candidate, until none is better."""
        chosen = list(chosen)
        now = float(self.value(matrices[chosen].sum(axis=0)))
        for _ in range(ROUNDS):
            before = now
            for place in range(len(chosen)):
                others = matrices[chosen[:place] + chosen[place + 1 :]].sum(axis=0)
                values = self.value(others + matrices)
                best = int(np.argmin(values))
                if values[best] < now - WORTH * abs(now):
                    chosen[place], now = best, float(values[best])
            if now == before:
                break
        return chosen

    def ordered(self, chosen: Sequence[int], matrices: np.ndarray) -> list[int]:
        """The same runs, each the best beside those before."""
        left, order = list(chosen), []
        while left:
            total = matrices[order].sum(axis=0)
            best = left[int(np.argmin(self.value(total + matrices[left])))]
            left.remove(best)
            order.append(best)
        return order


class Information(NamedTuple):
    """What tests say of the free parameters."""

    free: FreeParameters  # the free parameters
    matrices: Float[np.ndarray, "tests free free"]  # Fisher information of each test, in the units of the parameters
    force: Float[np.ndarray, " tests"]  # largest |F| in each test [N]
    power: Float[np.ndarray, " tests"]  # mean F v of each test [W]


def information(
    law: AbstractDamper,
    tests: Sequence[Excitation],
    *,
    rig: Rig | None,
    freeze: Sequence[str],
    tie: Mapping[str, str] | None,
    sampling_rate: float,
    force_noise: float,
) -> Information:
    """What tests would say of the free parameters of a law on a machine, by the model that a fit would use."""
    runs = [_motion(test, number, sampling_rate) for number, test in enumerate(tests)]
    problem = prepare(law, runs, rig=rig, freeze=freeze, tie=tie)
    residual, jacobian = map(np.asarray, linearised(problem.free, problem.free.values, problem.residuals))
    batches = [part for part in problem.residuals if isinstance(part, Batch)]
    weight, measured, velocity = (
        np.concatenate([np.ravel(getattr(batch, name)) for batch in batches])
        for name in ("weight", "force", "velocity")
    )
    force = np.divide(residual, weight, out=np.zeros_like(residual), where=weight > 0) + measured
    rows = [np.flatnonzero(problem.used & (problem.owner == i)) for i in range(len(runs))]
    matrices = np.stack([jacobian[k].T @ jacobian[k] for k in rows]) / force_noise**2
    largest = np.array([np.max(np.abs(force[k])) for k in rows])
    power = np.array([np.mean(force[k] * velocity[k]) for k in rows])
    return Information(problem.free, matrices, largest, power)


def _motion(test: Excitation, number: int, sampling_rate: float) -> BenchRun:
    """A test as a record whose force does not matter."""
    time = np.arange(round(test.duration * sampling_rate)) / sampling_rate
    velocity = test.velocity(time)
    return BenchRun(f"{number}", time, test.stroke(time), velocity, velocity)


@final
@dataclasses.dataclass(frozen=True)
class MachineLimits:
    """What a test machine can do, and what a damper bears.

    Arguments:
        stroke: largest |x| [m], zero to peak.
        velocity: largest |v| [m/s].
        force: largest |F| [N] of the law on its machine.
        power: largest mean power ⟨F v⟩ [W] that a run may turn into heat.
        frequencies: lowest and highest frequency [Hz].

    Raises:
        ValueError: a limit that is not positive; frequencies that do not increase.
    """

    stroke: float | int
    velocity: float | int
    force: float | int = np.inf
    power: float | int = np.inf
    frequencies: tuple[float | int, float | int] = (0.5, 15.0)

    def __post_init__(self) -> None:
        for name in ("stroke", "velocity", "frequencies"):
            _checks.positive(name, np.asarray(getattr(self, name), float))
        for name in ("force", "power"):
            if not getattr(self, name) > 0:
                _checks.refuse(name, "be positive", getattr(self, name))
        if not self.frequencies[0] < self.frequencies[1]:
            _checks.refuse("frequencies", "increase", self.frequencies)


class Point(NamedTuple):
    """Where a candidate lies in the plane of the limits."""

    waveform: str
    stroke: float  # m, zero to peak
    frequency: float  # Hz, the lowest


WAVEFORMS = ("sine", "triangle", "random", "multisine")


def excitation_at(point: Point, limits: MachineLimits, duration: float) -> Excitation | None:
    """The test at a point; `None` if it is outside the limits."""
    waveform, stroke, frequency = point
    low, high = limits.frequencies
    cycles = max(int(duration * frequency), FEWEST_CYCLES)
    name = f"{waveform}_{1e3 * stroke:.3g}mm_{frequency:.3g}Hz"
    widest = {"sine": 1.0, "triangle": 1.0, "random": 2.0**OCTAVES, "multisine": SPREAD[-1]}[waveform]
    if not (LEAST_STROKE <= stroke <= limits.stroke and low <= frequency and frequency * widest <= high):
        return None
    if waveform == "random":
        band = (frequency, frequency * widest)
        return RandomTest(stroke, limits.velocity, cycles / frequency, band, warm_up=1.0 / frequency, name=name)
    if waveform == "multisine":
        lines = tuple(frequency * factor for factor in SPREAD)
        return MultiSineTest(stroke, limits.velocity, lines, cycles / frequency, warm_up=1.0 / frequency, name=name)
    test = (SineTest if waveform == "sine" else TriangleTest)(stroke, frequency, cycles, name=name)
    return test if test.peak_velocity <= limits.velocity * (1.0 + 1e-9) else None


def grid(
    limits: MachineLimits, waveforms: Sequence[str], duration: float, strokes: int, frequencies: int
) -> dict[Point, Excitation]:
    """Tests over the range of a machine: strokes and frequencies in equal ratios, and on the limit of velocity."""
    for waveform in waveforms:
        _checks.one_of("waveforms", waveform, WAVEFORMS)
    rates = np.geomspace(*limits.frequencies, frequencies)
    slowest = limits.velocity / (2 * np.pi * limits.frequencies[1])
    sizes = np.geomspace(max(min(limits.stroke / 10, slowest), LEAST_STROKE), limits.stroke, strokes)
    points = [
        Point(waveform, float(stroke), float(rate))
        for waveform in waveforms
        for rate in rates
        for stroke in dict.fromkeys([*sizes, min(limits.velocity / (2 * np.pi * rate), limits.stroke)])
    ]
    return _within(points, limits, duration)


def near(points: Sequence[Point], ratio: float, limits: MachineLimits, duration: float) -> dict[Point, Excitation]:
    """Tests around some points: strokes and frequencies a ratio larger and smaller, moved inside the limits."""
    factors = (1.0 / ratio, 1.0, ratio)
    around = [
        point._replace(
            stroke=min(point.stroke * a, limits.stroke),
            frequency=float(np.clip(point.frequency * b, *limits.frequencies)),
        )
        for point in dict.fromkeys(points)
        for a in factors
        for b in factors
    ]
    return _within(around, limits, duration)


def _within(points: Sequence[Point], limits: MachineLimits, duration: float) -> dict[Point, Excitation]:
    tests = {point: excitation_at(point, limits, duration) for point in points}
    return {point: test for point, test in tests.items() if test is not None}
