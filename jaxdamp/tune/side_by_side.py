"""Several searches on the same metrics at once: their points are simulated side by side, with exact derivatives."""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._jacobian import Mode
from jaxdamp.parameters import FreeParameters
from jaxdamp.simulation import Ride
from jaxdamp.tune.limits import LimitEnd
from jaxdamp.tune.ranges import SearchRange
from jaxdamp.tune.scenario_ride import ScenarioRide
from jaxdamp.tune.searching import DOUBLE, many_at_a_time
from jaxdamp.tune.task import DesignTask


LANES = 16  # points side by side in one call of the compiled program
FORWARD = 5  # parameters for each result, up to which forward derivatives of so many lanes are faster
RADIUS = 0.5  # largest change of a coordinate in the first step; coordinates are one at the start
LEAST_RADIUS = 1e-6
BEND = 0.1  # second derivative of a row by a coordinate at first, relative to its size
SHARE = 1e-4  # of the sum of all objectives in each problem: excludes points that another one beats in one objective
PENALTY = 10.0  # of a violated limit, in units of the objectives


class Computed(NamedTuple):
    """The numbers at a point, and the rows among them that the search follows.

    Attributes:
        values: of all numbers.
        rows: the objectives, then one for each end of a limit: the number, with the sign of the end.
        slopes: derivatives of the rows with respect to the coordinates.
    """

    values: Float[np.ndarray, " numbers"]
    rows: Float[np.ndarray, " rows"]
    slopes: Float[np.ndarray, "rows free"]


@final
class BatchEvaluator:
    """Numbers and derivatives of many points, simulated `LANES` side by side; compiled once.

    Arguments:
        task: with the metrics and the free parameters.

    Attributes:
        points: number of points computed with derivatives.
        improvement: that a search may leave at its end, relative to the range of the objectives.
    """

    def __init__(self, task: DesignTask) -> None:
        self.task, self.points, self.ride = task, 0, task.measured.ride.side_by_side()
        objectives = task.objective.names
        self._differentiated = list(dict.fromkeys([*objectives, *task.limited_names]))
        inputs, modes = len(task.space.start), task.measured.ride.derivatives
        mode: Mode = "forward" if inputs <= FORWARD * len(self._differentiated) else "reverse"
        mode = mode if mode in modes else modes[0]
        numbers = functools.partial(task.numbers, self.ride)
        self._evaluate = many_at_a_time(numbers, task.space.free, task.names, self._differentiated, mode)
        self._rows = [(name, 1.0) for name in objectives]

        @eqx.filter_jit
        def simulate(ride: Ride | ScenarioRide, free: FreeParameters, values: Array) -> Array:
            results = jax.vmap(lambda row: task.numbers(ride, free.build(row)))(values)
            return jnp.stack([results[name] for name in task.names], axis=-1)

        self._simulate = simulate
        self.improvement = 1e-6 if task.tolerance == DOUBLE else 1e-3

    def follow(self, ends: Sequence[LimitEnd]) -> None:
        """Add rows for ends of limits."""
        self._rows += [(end.name, end.sign) for end in ends]

    def at(self, points: Float[np.ndarray, "points free"]) -> list[Computed]:
        """Numbers and derivatives at points given by their coordinates."""
        return [self.rows_of(values, slopes) for values, slopes in self.evaluated(points)]

    def evaluated(self, points: Float[np.ndarray, "points free"]) -> list[tuple[np.ndarray, np.ndarray]]:
        """All numbers, and the derivatives of those with a row by the coordinates, at each point."""
        self.points += len(points)
        unit, results = self.task.space.unit, []
        for part in self._in_lanes(points * unit):
            values, slopes = (np.asarray(a, np.float64) for a in self._evaluate(part))
            results += zip(values, slopes * unit, strict=True)
        return results[: len(points)]

    def rows_of(self, values: np.ndarray, slopes: np.ndarray) -> Computed:
        """The rows of what was evaluated at a point."""
        signs = np.array([sign for _, sign in self._rows])
        of_values = [self.task.names.index(name) for name, _ in self._rows]
        of_slopes = [self._differentiated.index(name) for name, _ in self._rows]
        return Computed(values, signs * values[of_values], signs[:, None] * slopes[of_slopes])

    def numbers_at(
        self, designs: Float[np.ndarray, "points free"], ride: Ride | ScenarioRide
    ) -> dict[str, Float[np.ndarray, " points"]]:
        """All numbers by name, of designs given by their physical values, by a ride and without derivatives."""
        free = self.task.space.free
        parts = [
            np.asarray(self._simulate(ride, free, jnp.asarray(part)), np.float64) for part in self._in_lanes(designs)
        ]
        return dict(zip(self.task.names, np.concatenate(parts)[: len(designs)].T, strict=True))

    def rows_at(self, designs: Float[np.ndarray, "points free"]) -> Float[np.ndarray, "points rows"]:
        """The rows of designs given by their physical values, without derivatives."""
        numbers = self.numbers_at(designs, self.ride)
        return np.stack([sign * numbers[name] for name, sign in self._rows], axis=1)

    def _in_lanes(self, designs: Float[np.ndarray, "points free"]) -> list[np.ndarray]:
        """Designs in groups of `LANES`, the last one filled up."""
        rest = np.repeat(designs[:1], -len(designs) % LANES, axis=0)
        grouped = np.concatenate([designs, rest]).reshape(-1, LANES, designs.shape[1])
        return list(grouped.astype(self.task.space.free.values.dtype))


class Scaling(NamedTuple):
    """Zero and unit of each row: objectives first, then ends of limits, which must not be positive."""

    zero: Float[np.ndarray, " rows"]
    unit: Float[np.ndarray, " rows"]
    objectives: int

    def of(self, rows: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " rows"]:
        """The rows, scaled."""
        return (rows - self.zero) / self.unit

    def merit(self, rows: Float[np.ndarray, " rows"], aim: Float[np.ndarray, " objectives"]) -> float:
        """Largest distance of an objective beyond its aim, with the penalty of violated limits."""
        scaled = self.of(rows)
        own, limits = scaled[: self.objectives], scaled[self.objectives :]
        return float((own - aim).max() + SHARE * own.sum() + PENALTY * limits.max(initial=0.0))


@final
@dataclasses.dataclass
class Lane:
    """One search: towards an aim for the objectives, by quadratic models of all rows within a trust region.

    Attributes:
        aim: value of each scaled objective that is aimed at; the largest excess is minimised.
        at: coordinates.
        now: numbers and derivatives there.
        curvature: estimated second derivatives of each row.
        radius: largest change of a coordinate in the next step.
        steps: number of steps tried.
        open: whether the search goes on.
        converged: whether the models promise no more improvement.
    """

    aim: Float[np.ndarray, " objectives"]
    at: Float[np.ndarray, " free"]
    now: Computed
    curvature: Float[np.ndarray, "rows free free"]
    radius: float = RADIUS
    steps: int = 0
    open: bool = True
    converged: bool = False

    @classmethod
    def begin(cls, aim: np.ndarray, at: np.ndarray, now: Computed) -> "Lane":
        """A search without knowledge of curvature: that of a row is taken as a share of its size."""
        size = BEND * np.abs(now.rows)
        return cls(aim, at, now, size[:, None, None] * np.eye(len(at)))

    def neighbour(self, aim: np.ndarray, at: np.ndarray, now: Computed) -> "Lane":
        """A search that starts from a point near this one, with its curvature."""
        near = Lane(aim, self.at, self.now, self.curvature.copy())
        near.learn(at, now)
        near.at, near.now = at, now
        return near

    def learn(self, at: np.ndarray, computed: Computed) -> None:
        """Update the curvature by the derivatives at another point (damped BFGS, so that it stays positive)."""
        step = at - self.at
        if not np.all(np.isfinite(computed.slopes)) or not step.any():
            return
        for matrix, change in zip(self.curvature, computed.slopes - self.now.slopes, strict=True):
            along = matrix @ step
            old, new = step @ along, step @ change
            share = 1.0 if new >= 0.2 * old else 0.8 * old / (old - new)
            damped = share * change + (1.0 - share) * along
            matrix += np.outer(damped, damped) / (step @ damped) - np.outer(along, along) / old

    def take(self, at: np.ndarray, computed: Computed, promised: float, scaling: Scaling) -> None:
        """Move to a tried point if it is better, and adapt the trust region."""
        before, after = (scaling.merit(c.rows, self.aim) for c in (self.now, computed))
        gain = (before - after) / promised if np.isfinite(after) and np.isfinite(computed.slopes).all() else -1.0
        length = float(np.abs(at - self.at).max())
        self.learn(at, computed)
        self.steps += 1
        if gain < 0.25:
            self.radius = 0.5 * length
        elif gain > 0.75 and length > 0.99 * self.radius:
            self.radius *= 2.0
        if gain > 1e-4:
            self.at, self.now = at, computed
        self.open = self.radius > LEAST_RADIUS


def best_step(lane: Lane, scaling: Scaling, space: SearchRange) -> tuple[np.ndarray, float]:
    """The step to the minimum of the models in the trust region, and the improvement that they promise."""
    import scipy.optimize

    count, free = scaling.objectives, len(lane.at)
    level, unit = scaling.of(lane.now.rows), scaling.unit
    slopes, curvature = lane.now.slopes / unit[:, None], lane.curvature / unit[:, None, None]
    rows, gaps = space.coordinates.order()
    target = np.concatenate([lane.aim, np.zeros(len(level) - count)])
    slack = np.zeros((len(level), 2))  # excess over the aims, and over the limits
    slack[:count, 0] = slack[count:, 1] = 1.0
    weights = np.array([1.0, PENALTY])

    def models(step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        bent = curvature @ step
        return level + slopes @ step + 0.5 * bent @ step, slopes + bent

    def merit(z: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = (a[:count].sum(axis=0) for a in models(z[:free]))
        return weights @ z[free:] + SHARE * value, np.concatenate([SHARE * slope, weights])

    def room(z: np.ndarray) -> np.ndarray:
        return np.concatenate([target + slack @ z[free:] - models(z[:free])[0], rows @ (lane.at + z[:free]) - gaps])

    def room_slope(z: np.ndarray) -> np.ndarray:
        order = np.concatenate([rows, np.zeros((len(rows), 2))], axis=1)
        return np.concatenate([np.concatenate([-models(z[:free])[1], slack], axis=1), order])

    lower, upper = space.lower / space.unit - lane.at, space.upper / space.unit - lane.at
    box = np.clip(lower, -lane.radius, 0.0), np.clip(upper, 0.0, lane.radius)
    bounds = [*zip(*box, strict=True), (None, None), (0.0, None)]
    start = np.concatenate([np.zeros(free), [(level - target)[:count].max(), level[count:].max(initial=0.0)]])
    constraint = {"type": "ineq", "fun": room, "jac": room_slope}
    options = {"ftol": 1e-12, "maxiter": 100}
    solved = scipy.optimize.minimize(
        merit, start, jac=True, method="SLSQP", bounds=bounds, constraints=constraint, options=options
    )
    step = np.clip(solved.x[:free], *box)
    value = models(step)[0]
    reached = (value - target)[:count].max() + SHARE * value[:count].sum() + PENALTY * value[count:].max(initial=0.0)
    return step, scaling.merit(lane.now.rows, lane.aim) - float(reached)


def solve_together(
    lanes: Sequence[Lane],
    evaluator: BatchEvaluator,
    scaling: Scaling,
    max_steps: int,
    progress: Callable[[], None],
) -> None:
    """Run all searches to their ends: one step of each open one at a time, simulated side by side."""
    space = evaluator.task.space
    while True:
        tried = []
        for lane in lanes:
            if not lane.open:
                continue
            step, promised = best_step(lane, scaling, space)
            lane.converged = promised < evaluator.improvement
            lane.open = not lane.converged and lane.steps < max_steps
            if lane.open:
                tried.append((lane, lane.at + step, promised))
        progress()
        if not tried:
            return
        results = evaluator.at(np.stack([at for _, at, _ in tried]))
        for (lane, at, promised), computed in zip(tried, results, strict=True):
            lane.take(at, computed, promised, scaling)
