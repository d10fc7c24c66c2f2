"""The searches of `minimise`: descents, and how far from an optimum they ended; or every combination of choices."""

import contextlib
import dataclasses
import functools
import itertools
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp.parameters import checked
from jaxdamp.simulation import AbstractEngine, CoarseStepWarning, Exponential, Ride
from jaxdamp.solve import Evaluation, Scaling, SearchState, SequentialQuadratic
from jaxdamp.tune.combinations import Combinations
from jaxdamp.tune.limits import Limit, LimitEnd, limit_ends
from jaxdamp.tune.measuring import LANES, ride_on
from jaxdamp.tune.ranges import MOST_COMBINATIONS
from jaxdamp.tune.scenario_ride import ScenarioRide
from jaxdamp.tune.task import DesignTask, Evaluator, Tolerance, is_white
from jaxdamp.vehicles import AbstractVehicle


NEAR = 1e-3  # how far around an end gradients are sampled, relative to the unit of each coordinate
AT_ZERO = 1e-9  # metric relative to its size at the start: as good as zero
RESTARTS = 2  # with a new estimate of the curvature, if the search ends before an optimum


class Ended(NamedTuple):
    """Where and how a search ended."""

    values: Float[np.ndarray, " free"]  # of the free parameters
    evaluation: Evaluation  # numbers and derivatives there
    history: tuple[float, ...]  # the metric after each step
    out_of_steps: bool  # whether it had used all its steps
    slope_left: Callable[[], float]  # length of the projected scaled gradient, relative to the metric


@final
class Descent:
    """Searches for the smallest value of one objective, side by side."""

    def __init__(self, evaluator: Evaluator, max_steps: int, progress: Callable[[int, float], None]) -> None:
        self.task, self._evaluator, self._max_steps, self._progress = evaluator.task, evaluator, max_steps, progress

    def choose(self, ended: Ended, limits: Sequence[Limit]) -> list[Ended]:
        """Searches with each combination of the choices next to where a search ended, over what else is free."""
        space = self.task.space
        pairs = zip(space.choices, ended.values, strict=True)
        sides = [[value] if choice is None else choice.around(value) for choice, value in pairs]
        combinations = np.array(list(itertools.product(*sides)))
        starts = combinations / space.unit
        several = self.search(starts, self._evaluator.at(starts), limits, space.is_choice)
        return [
            one._replace(values=np.where(space.is_choice, exact, one.values))
            for exact, one in zip(combinations, several, strict=True)
        ]

    def search(
        self,
        starts: Sequence[np.ndarray] | np.ndarray,
        evaluations: Sequence[Evaluation],
        limits: Sequence[Limit],
        fixed: np.ndarray | None = None,
    ) -> list[Ended]:
        """One search from each start, some coordinates being fixed.

        If one ends before an optimum, its estimate of the curvature is wrong or a kink has stopped it: it is started
        again.
        """
        solver = self._solver(float(self._evaluator.sizes(evaluations[0]).max()), limit_ends(limits))
        aim, held = np.zeros(len(self.task.followed)), self.task.space.is_held
        fixed = held if fixed is None else fixed | held
        states = [solver.init(aim, y, now) for y, now in zip(starts, evaluations, strict=True)]
        for state in states:
            state.fixed, state.open = fixed, not fixed.all()
        histories: list[list[float]] = [[] for _ in states]
        rounds = 0

        def note() -> None:
            nonlocal rounds
            rounds += 1
            for state, history in zip(states, histories, strict=True):
                if len(history) < state.steps:
                    history.append(self.task.metric(state.evaluation))
            self._progress(rounds, min(self.task.metric(state.evaluation) for state in states))

        solver.solve(self._evaluator.at, states, note)
        for _ in range(RESTARTS):
            again = [i for i, state in enumerate(states) if self._ended_early(state, solver.scaling)]
            for i in again:
                steps, states[i] = states[i].steps, solver.init(aim, states[i].y, states[i].evaluation)
                states[i].steps, states[i].fixed = steps, fixed
            if again:
                solver.solve(self._evaluator.at, states, note)
        return [self._ended(state, tuple(h), solver.scaling) for state, h in zip(states, histories, strict=True)]

    def _solver(self, level: float, ends: Sequence[LimitEnd]) -> SequentialQuadratic:
        """The solver for an objective of this size, and limits with these ends."""
        tolerance = self.task.tolerance
        count = len(self.task.followed)
        zeros = [*[0.0] * count, *(end.sign * end.value for end in ends)]
        units = [*[level] * count, *(end.scale for end in ends)]
        return SequentialQuadratic(
            self._evaluator.region,
            Scaling(np.array(zeros), np.array(units), count),
            self._max_steps,
            improvement=0.1 * tolerance.rounding,
            rounding=tolerance.rounding,
            feasible=0.1 * tolerance.limit,
        )

    def _ended_early(self, state: SearchState, scaling: Scaling) -> bool:
        left = _slope_left(self._evaluator, state, scaling)
        return not left < self.task.tolerance.slope and state.steps < self._max_steps

    def _ended(self, state: SearchState, history: tuple[float, ...], scaling: Scaling) -> Ended:
        space, out_of_steps = self.task.space, state.steps >= self._max_steps

        @functools.cache  # many gradients where it is a kink, and only of ends that are judged
        def slope_left() -> float:
            left = _slope_left(self._evaluator, state, scaling)
            if left < self.task.tolerance.slope or out_of_steps:
                return left
            return min(left, _slope_left_at_kink(self._evaluator, state, scaling))

        values = np.clip(state.y * space.unit, space.lower, space.upper)
        return Ended(values, state.evaluation, history, out_of_steps, slope_left)


@final
class Driven:
    """All combinations of the choices of a tuning, in place of a descent: a search that ends at each of them."""

    def __init__(
        self, evaluator: Evaluator, points: np.ndarray, impossible: int, progress: Callable[[int, float], None]
    ) -> None:
        self.task, self.ends, self._impossible, least = evaluator.task, list[Ended](), impossible, math.inf
        for part in np.array_split(points, math.ceil(len(points) / LANES)):
            evaluations = evaluator.at(part / self.task.space.unit)
            least = min(least, *map(self.task.metric, evaluations))
            pairs = zip(part, evaluations, strict=True)
            self.ends += [Ended(point, one, (), out_of_steps=False, slope_left=lambda: 0.0) for point, one in pairs]
            progress(len(self.ends), least)

    def search(self, starts: object, evaluations: object, limits: Sequence[Limit]) -> list[Ended]:
        """The end of a search, wherever it would start: the best combination."""
        return [min(self.ends, key=lambda one: rank(self.task, one, limits))]

    def choose(self, ended: Ended, limits: object) -> list[Ended]:
        """That combination: there is none beside it to be tried."""
        return [ended]

    def combinations(self, limits: Sequence[Limit]) -> Combinations:
        """All of them for the result, with the minimised and the limited metrics."""
        task, ranks = self.task, [rank(self.task, one, limits) for one in self.ends]
        order = sorted(range(len(ranks)), key=lambda i: ranks[i])
        ends = [self.ends[i] for i in order]
        each = [task.numbers(one.evaluation.values) for one in ends]
        names = dict.fromkeys([task.objective.name, *task.allowed])
        owners = zip(task.space.free.names, task.space.free.owners, strict=True)
        return Combinations(
            dict(zip(task.space.free.names, np.transpose([one.values for one in ends]), strict=True)),
            {name: np.array([numbers[name] for numbers in each]) for name in names},
            np.array([ranks[i][0] == 0.0 for i in order]),
            {name: task.units[name] for name in names} | {name: p.unit for name, p in owners},
            self._impossible,
        )


def every_combination(evaluator: Evaluator, progress: Callable[[int, float], None]) -> Driven | None:
    """All combinations that the vehicle can have, driven, if choices are all that is free and not too many."""
    space = evaluator.task.space
    choices = [choice.values for choice in space.choices if choice is not None]
    if len(choices) < len(space.choices) or math.prod(map(len, choices)) > MOST_COMBINATIONS:
        return None
    every = list(itertools.product(*choices))
    points = np.array([point for point in every if _is_allowed(evaluator.task, point)])
    if not len(points):
        names = ", ".join(space.free.names)
        _checks.refuse("over", f"have a combination of {names} that the vehicle can have", f"none of {choices}")
    return Driven(evaluator, points, len(every) - len(points), progress)


def _is_allowed(task: DesignTask[AbstractVehicle], point: Sequence[float]) -> bool:
    """Whether a vehicle can have these numbers."""
    try:
        checked(task.space.free.build(jnp.asarray(point, task.space.free.values.dtype)))
    except ValueError:
        return False
    return True


def finer(
    task: DesignTask[AbstractVehicle], designs: Sequence[np.ndarray], asked: AbstractEngine | None
) -> Exponential | None:
    """The engine with the substeps that designs need, if the search took fewer and nobody asked for so many."""
    engine = Exponential() if asked is None else asked
    if is_white(task.road) or not isinstance(engine, Exponential) or engine.substeps is not None:
        return None
    taken = needs = _substeps(task.measured.ride)
    for values in designs:
        design = task.space.free.build(jnp.asarray(values, task.space.free.values.dtype))
        with warnings.catch_warnings(), contextlib.suppress(ValueError):  # of the result, as notes on it say
            warnings.simplefilter("ignore", CoarseStepWarning)
            needs = max(needs, _substeps(ride_on(design, task.road, task.objective, {**task.run, "engine": asked})))
    return dataclasses.replace(engine, substeps=needs) if needs > taken else None


def _substeps(ride: Ride | ScenarioRide) -> int:
    return ride.ride.substeps if isinstance(ride, ScenarioRide) else ride.substeps


def rank(task: DesignTask[AbstractVehicle], ended: Ended, limits: Sequence[Limit]) -> tuple[float, float]:
    """By how much limits are violated at the end of a search, and the metric there; infinite if it has none."""
    numbers = task.numbers(ended.evaluation.values)
    beyond = [max(-limit.margin(numbers[limit.name]), 0.0) for limit in missed(limits, numbers, task.tolerance)]
    pair = float(sum(beyond)), numbers[task.objective.name]
    return (math.inf, math.inf) if any(map(math.isnan, pair)) else pair


def reached(limits: Sequence[Limit], values: Mapping[str, float], tolerance: Tolerance) -> list[Limit]:
    """The limits that are met, and hold the search."""
    return [limit for limit in limits if abs(limit.margin(values[limit.name])) <= tolerance.limit]


def missed(limits: Sequence[Limit], values: Mapping[str, float], tolerance: Tolerance) -> list[Limit]:
    """The violated limits."""
    return [limit for limit in limits if not limit.margin(values[limit.name]) >= -tolerance.limit]


def balanced(
    gradients: Float[np.ndarray, "gradients free"], walls: Float[np.ndarray, "walls free"]
) -> tuple[float, Float[np.ndarray, " walls"]]:
    """Length of the shortest sum of a mean of gradients and of multiples of walls, and these multiples.

    No weight is negative. It is zero where no direction decreases all functions with these gradients, but beyond the
    walls, whose functions must not increase (Karush, Kuhn, Tucker); the multiples are their Lagrange multipliers.
    """
    import scipy.optimize

    heavy = 1e3 * np.linalg.norm(gradients, axis=1).max(initial=0.0)  # weights of gradients add up to one
    if not heavy > 0.0:
        return heavy, np.zeros(len(walls))
    lengths = np.linalg.norm(walls, axis=1)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    rows = np.concatenate([gradients, walls / lengths[:, None]])
    sums = np.repeat([heavy, 0.0], [len(gradients), len(walls)])
    target = np.append(np.zeros(rows.shape[1]), heavy)
    weights, _ = scipy.optimize.nnls(np.append(rows.T, sums[None], axis=0), target)
    return float(np.linalg.norm(weights @ rows)), weights[len(gradients) :] / lengths


def held_by(
    task: DesignTask[AbstractVehicle], evaluation: Evaluation, tight: np.ndarray | Sequence[int], moved: np.ndarray
) -> tuple[float, np.ndarray]:
    """The slope of the metric that is left over the coordinates that move, and the multiplier of each tight limit.

    Of the worst case the slopes of all scenarios that are as bad count.
    """
    count, metric = len(task.followed), task.metric(evaluation)
    alike = evaluation.rows[:count] >= metric - task.tolerance.limit * abs(metric)
    slopes = evaluation.slopes[:, moved]
    return balanced(slopes[:count][alike], slopes[count:][tight])


def _slope_left(evaluator: Evaluator, state: SearchState, scaling: Scaling) -> float:
    """Length of the scaled gradient that bounds and active limits do not balance, relative to the metric.

    Zero where a search ended by itself at a metric of zero, such as a distance from targets that are met.
    """
    task, rows = evaluator.task, state.evaluation.rows
    if state.converged and np.abs(scaling.of(rows)[: scaling.objectives]).max() < AT_ZERO:
        return 0.0
    unbound = np.array([not side for side in task.space.side(state.y * task.space.unit)])
    unbound &= True if state.fixed is None else ~state.fixed
    left, _ = held_by(task, state.evaluation, _tight(evaluator, rows, scaling), unbound)
    return left / max(abs(task.metric(state.evaluation)), 1e-300)


def _tight(evaluator: Evaluator, rows: np.ndarray, scaling: Scaling) -> np.ndarray:
    """Which ends of limits are reached."""
    return -scaling.of(rows)[scaling.objectives :] < evaluator.task.tolerance.limit


def _slope_left_at_kink(evaluator: Evaluator, state: SearchState, scaling: Scaling) -> float:
    """The slope that is left where the metric or a limit has a kink, relative to the metric.

    The length of the shortest convex combination of gradients sampled around the end, balanced by those of active
    limits and bounds: zero at a minimum, also of a function whose gradient jumps there. Away from one all sampled
    gradients point in similar directions, and no combination is short.

    Source: Burke, Lewis, Overton, A robust gradient sampling algorithm for nonsmooth, nonconvex optimization, SIAM J.
    Optim. 15 (2005).
    """
    space, free, region = evaluator.task.space, len(state.y), evaluator.region
    size, count = max(abs(evaluator.task.metric(state.evaluation)), 1e-300), scaling.objectives
    near = state.y + NEAR * np.random.default_rng(0).uniform(-1.0, 1.0, (4 * free + 4, free))
    sampled = [state.evaluation, *evaluator.at(np.clip(near, region.lower, region.upper))]
    tight = _tight(evaluator, state.evaluation.rows, scaling)
    moved = np.ones(free) if state.fixed is None else 1.0 - state.fixed
    gradients = [moved * one.slopes[np.argmax(one.rows[:count])] / size for one in sampled]
    walls = [moved * wall for one in sampled for wall in one.slopes[count:][tight]]
    sides = {"lower": -1.0, "upper": 1.0}
    at_bounds = space.side(state.y * space.unit)
    walls += [sides[side] * row for side, row in zip(at_bounds, np.eye(free), strict=True) if side]
    return balanced(np.stack(gradients), np.reshape(walls, (-1, free)))[0]
