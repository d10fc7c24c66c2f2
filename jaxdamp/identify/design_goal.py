"""What a design of experiments makes small, and what the runs that it chooses from say of the parameters."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp.bench import BenchRun, CommandedExcitation, Excitation
from jaxdamp.dampers import AbstractDamper, command_paths
from jaxdamp.identify.design_candidates import MachineLimits, Point, beyond, refuse_all
from jaxdamp.identify.model import law_of
from jaxdamp.identify.preparing import prepare
from jaxdamp.identify.problem import linearised
from jaxdamp.identify.traces import signals
from jaxdamp.parameters import FreeParameters, get, match_paths
from jaxdamp.rig import Rig


VAGUE = 1e3  # standard deviation of a parameter without a prior, relative to its scale
ROUNDS = 20  # of exchanges at most
WORTH = 1e-9  # relative decrease of a criterion that counts as one


@dataclasses.dataclass(frozen=True)
class Goal:
    """What is minimised, in parameters relative to their scale."""

    criterion: str
    scale: Float[np.ndarray, " free"]  # that a change of each number is compared with
    before: Float[np.ndarray, "free free"]  # information of the prior
    slopes: Float[np.ndarray, " free"]  # of the function

    @classmethod
    def of(
        cls,
        information: "Information",
        criterion: str,
        function: Callable[[PyTree], PyTree] | None,
        prior: Mapping[str, float] | None,
    ) -> "Goal":
        """The goal of a criterion, with what is known of the parameters before.

        A zero is no size to compare with: in its place is the largest value of its vector, else its prior, else the
        change that moves the force by its RMS.
        """
        free = information.free
        values, paths = np.abs(np.asarray(free.values, float)), np.array([p.path for p in free.owners])
        deviations = np.full(values.size, np.nan)
        for name, deviation in (prior or {}).items():
            _checks.positive(f"prior[{name!r}]", deviation)
            deviations[np.isin(paths, match_paths(list(dict.fromkeys(paths.tolist())), [name]))] = deviation
        stated = np.isfinite(deviations)
        scale = np.where(values > 0, values, [np.max(values[paths == path]) for path in paths])
        scale = np.where(scale > 0, scale, np.where(stated, deviations, information.large))
        spread = np.where(stated, deviations, VAGUE * scale)
        slopes = np.zeros(values.size) if function is None else _slopes(function, free)
        return cls(criterion, scale, np.diag((scale / spread) ** 2), slopes * scale)

    def value(self, matrices: Float[np.ndarray, "*sets free free"]) -> Float[np.ndarray, "*sets"]:
        """The criterion of sums of information, less is better."""
        if self.criterion == "D":
            return np.asarray(-np.linalg.slogdet(self._relative(matrices))[1])
        sizes, axes = self._principal(matrices)
        if self.criterion == "A":
            return np.asarray(np.sum(1.0 / sizes, axis=-1))
        return np.asarray(np.sum(np.einsum("i,...ij->...j", self.slopes, axes) ** 2 / sizes, axis=-1))

    def covariance(self, total: Float[np.ndarray, "free free"]) -> Float[np.ndarray, "free free"]:
        """Of the parameters, in their units."""
        sizes, axes = self._principal(total)
        return (axes / sizes) @ axes.T * np.outer(self.scale, self.scale)

    def _relative(self, matrices: Float[np.ndarray, "*sets free free"]) -> Float[np.ndarray, "*sets free free"]:
        """Information of the relative parameters, with that of the prior."""
        return self.before + matrices * np.outer(self.scale, self.scale)

    def _principal(
        self, matrices: Float[np.ndarray, "*sets free free"]
    ) -> tuple[Float[np.ndarray, "*sets free"], Float[np.ndarray, "*sets free free"]]:
        """Principal values and axes of the information: never less than the prior's, which rounding could lose."""
        sizes, axes = np.linalg.eigh(self._relative(matrices))
        return np.maximum(sizes, np.diag(self.before).min()), axes

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


def _slopes(function: Callable[[PyTree], PyTree], free: FreeParameters) -> Float[np.ndarray, " free"]:
    """Derivatives of a function of a law, which is one number, by the free parameters."""

    def number(values: Float[Array, " free"]) -> Float[Array, ""]:
        value = function(law_of(free.build(values)))
        if getattr(value, "shape", () if isinstance(value, int | float) else None) != ():
            remedy = "Let it return one of them or their mean, such as `lambda law: law.force_velocity(0.5)`."
            _checks.refuse("function", "return one number", f"one that returns {_checks.described(value)}", remedy)
        return jnp.asarray(value, float)

    slopes = np.asarray(jax.grad(number)(free.values))
    if not np.any(slopes):
        _checks.refuse("function", "depend on a free parameter", "one that does not")
    return slopes


class Information(NamedTuple):
    """What tests say of the free parameters."""

    free: FreeParameters  # the free parameters
    matrices: Float[np.ndarray, "tests free free"]  # Fisher information of each test, in the units of the parameters
    force: Float[np.ndarray, " tests"]  # largest |F| in each test [N]
    power: Float[np.ndarray, " tests"]  # mean F v of each test [W]
    large: Float[np.ndarray, " free"]  # change of each parameter that moves the force by its RMS, 1 if none does


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
    paths = command_paths(law)
    held = float(get(law, paths[0])) if paths and any(isinstance(t, CommandedExcitation) for t in tests) else None
    runs = [_motion(test, number, sampling_rate, held) for number, test in enumerate(tests)]
    problem = prepare(law, runs, rig=rig, freeze=freeze, tie=tie)
    residual, jacobian = map(np.asarray, linearised(problem.free, problem.free.values, problem.residuals))
    weight, measured, velocity = signals(problem.residuals, "weight", "force", "velocity")
    force = np.divide(residual, weight, out=np.zeros_like(residual), where=weight > 0) + measured
    rows = [np.flatnonzero(problem.used & (problem.owner == i)) for i in range(len(runs))]
    matrices = np.stack([jacobian[k].T @ jacobian[k] for k in rows]) / force_noise**2
    largest = np.array([np.max(np.abs(force[k])) for k in rows])
    power = np.array([np.mean(force[k] * velocity[k]) for k in rows])
    moved, level = np.linalg.norm(jacobian, axis=0), np.linalg.norm(force * weight)
    large = np.divide(level, moved, out=np.ones(moved.shape), where=moved * level > 0)
    return Information(problem.free, matrices, largest, power, large)


def _motion(test: Excitation, number: int, sampling_rate: float, held: float | None) -> BenchRun:
    """A test as a record whose force does not matter; a test that sets no command has the one that is held."""
    time = np.arange(round(test.duration * sampling_rate)) / sampling_rate
    velocity, channel, unit = test.velocity(time), None, ""
    if held is not None and isinstance(test, CommandedExcitation):
        channel, unit, held = test.command(time), test.command_unit, None
    motion = (f"{number}", time, test.stroke(time), velocity, velocity)
    return BenchRun(*motion, command=held, command_channel=channel, command_unit=unit)


@dataclasses.dataclass(frozen=True)
class Pool:
    """Candidates with their information."""

    keys: list[Point | int]  # points of a grid, or numbers
    tests: list[Excitation]
    matrices: Float[np.ndarray, "tests free free"]
    free: FreeParameters
    left_out: tuple[str, ...]  # those with too much force or heat, in words

    @classmethod
    def of(cls, candidates: Mapping[Any, Excitation], information: Information, limits: MachineLimits | None) -> "Pool":
        """Those within the limits of force and heat."""
        over = [
            ""
            if limits is None or (force <= limits.force and power <= limits.power)
            else beyond(test, limits, force, power)
            for test, force, power in zip(candidates.values(), information.force, information.power, strict=True)
        ]
        left_out = tuple(filter(None, over))
        if len(left_out) == len(over):
            refuse_all(left_out)
        within = [item for item, words in zip(candidates.items(), over, strict=True) if not words]
        matrices = information.matrices[[not words for words in over]]
        return cls([k for k, _ in within], [t for _, t in within], matrices, information.free, left_out)

    def joined(self, other: "Pool") -> "Pool":
        """Both together."""
        matrices = np.concatenate([self.matrices, other.matrices])
        return Pool(self.keys + other.keys, self.tests + other.tests, matrices, self.free, self.left_out)
