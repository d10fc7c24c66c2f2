"""Several searches on the same metrics at once: their points are simulated side by side, with exact derivatives."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._jacobian import Mode, value_and_jacobian
from jaxdamp.parameters import FreeParameters
from jaxdamp.tune.ranges import SearchRange
from jaxdamp.tune.searching import DOUBLE, SINGLE, Measured


LANES = 16  # points side by side in one call of the compiled program
FORWARD = 5  # parameters for each result, up to which forward derivatives of so many lanes are faster
RADIUS = 0.5  # largest change of a coordinate in the first step; coordinates are one at the start
LEAST_RADIUS = 1e-6
BEND = 0.1  # second derivative of a metric by a coordinate at first, relative to its size
SHARE = 1e-4  # of the sum of all objectives in each problem: excludes points that another one beats in one objective
PENALTY = 10.0  # of a violated limit, in units of the objectives


class Computed(NamedTuple):
    """Metrics at a point, and the derivatives of the first of them with respect to the coordinates."""

    values: Float[np.ndarray, " metrics"]
    slopes: Float[np.ndarray, "rows free"]


@final
class BatchEvaluator:
    """Metrics and derivatives of many points, simulated `LANES` side by side; compiled once.

    Arguments:
        ride: the metrics of a vehicle by name.
        space: the free parameters.
        names: of all metrics.
        rows: number of metrics that are differentiated, the first ones.
        modes: the modes of differentiation that pass through the ride.

    Attributes:
        points: number of points computed.
        tolerance: as in a search of `minimise`.
        improvement: that a search may leave at its end, relative to the range of the objectives.
    """

    def __init__(
        self, ride: Measured, space: SearchRange, names: Sequence[str], rows: int, modes: Sequence[Mode]
    ) -> None:
        self._free, self._unit, self.points = space.free, space.unit, 0
        columns, chosen = [str(i) for i in range(len(space.start))], list(names)[:rows]
        mode: Mode = "forward" if len(columns) <= FORWARD * rows else "reverse"
        mode = mode if mode in modes else modes[0]

        @eqx.filter_jit
        def evaluate(free: FreeParameters, values: Array) -> tuple[Array, Array]:
            def one(point: dict[str, Array]) -> dict[str, Array]:
                found = ride(free.build(jnp.stack([point[name] for name in columns])))
                return {name: found[name] for name in names}

            point = {name: values[:, i] for i, name in enumerate(columns)}
            found, slopes = value_and_jacobian(jax.vmap(one), point, mode, of=chosen)
            rows = [jnp.stack([slopes[name][column] for column in columns], axis=-1) for name in chosen]
            return jnp.stack([found[name] for name in names], axis=-1), jnp.stack(rows, axis=1)

        @eqx.filter_jit
        def simulate(free: FreeParameters, values: Array) -> Array:
            found = jax.vmap(lambda row: ride(free.build(row)))(values)
            return jnp.stack([found[name] for name in names], axis=-1)

        self._evaluate, self._simulate = evaluate, simulate
        double = self._free.values.dtype == np.float64
        self.tolerance, self.improvement = (DOUBLE, 1e-6) if double else (SINGLE, 1e-3)

    def at(self, points: Float[np.ndarray, "points free"]) -> list[Computed]:
        """Metrics and derivatives at points given by their coordinates."""
        self.points += len(points)
        found = []
        for part in self._in_lanes(points * self._unit):
            values, slopes = self._evaluate(self._free, part)
            found += zip(np.asarray(values, np.float64), np.asarray(slopes, np.float64) * self._unit, strict=True)
        return [Computed(*pair) for pair in found[: len(points)]]

    def values_at(self, designs: Float[np.ndarray, "points free"]) -> Float[np.ndarray, "points metrics"]:
        """Metrics of designs given by their physical values."""
        found = [np.asarray(self._simulate(self._free, part), np.float64) for part in self._in_lanes(designs)]
        return np.concatenate(found)[: len(designs)]

    def _in_lanes(self, designs: Float[np.ndarray, "points free"]) -> list[Array]:
        """Designs in groups of `LANES`, the last one filled up."""
        rest = np.repeat(designs[:1], -len(designs) % LANES, axis=0)
        grouped = np.concatenate([designs, rest]).reshape(-1, LANES, designs.shape[1])
        return [jnp.asarray(group, self._free.values.dtype) for group in grouped]


class Scaling(NamedTuple):
    """Zero and unit of each differentiated metric: objectives first, then limits, which must not be positive."""

    zero: Float[np.ndarray, " rows"]
    unit: Float[np.ndarray, " rows"]
    objectives: int

    def of(self, values: Float[np.ndarray, " metrics"]) -> Float[np.ndarray, " rows"]:
        """The differentiated metrics, scaled."""
        return (values[: len(self.zero)] - self.zero) / self.unit

    def merit(self, values: Float[np.ndarray, " metrics"], aim: Float[np.ndarray, " objectives"]) -> float:
        """Largest distance of an objective beyond its aim, with the penalty of violated limits."""
        scaled = self.of(values)
        own, limits = scaled[: self.objectives], scaled[self.objectives :]
        return float((own - aim).max() + SHARE * own.sum() + PENALTY * limits.max(initial=0.0))


@final
@dataclasses.dataclass
class Lane:
    """One search: towards an aim for the objectives, by quadratic models of all metrics within a trust region.

    Attributes:
        aim: value of each scaled objective that is aimed at; the largest excess is minimised.
        at: coordinates.
        now: metrics and derivatives there.
        curvature: estimated second derivatives of each differentiated metric.
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
        """A search without knowledge of curvature: that of a metric is taken as a share of its size."""
        size = BEND * np.abs(now.values[: len(now.slopes)])
        return cls(aim, at, now, size[:, None, None] * np.eye(len(at)))

    def neighbour(self, aim: np.ndarray, at: np.ndarray, now: Computed) -> "Lane":
        """A search that starts from a point near this one, with its curvature."""
        near = Lane(aim, self.at, self.now, self.curvature.copy())
        near.learn(at, now)
        near.at, near.now = at, now
        return near

    def learn(self, at: np.ndarray, found: Computed) -> None:
        """Update the curvature by the derivatives at another point (damped BFGS, so that it stays positive)."""
        step = at - self.at
        if not np.all(np.isfinite(found.slopes)) or not step.any():
            return
        for matrix, change in zip(self.curvature, found.slopes - self.now.slopes, strict=True):
            along = matrix @ step
            old, new = step @ along, step @ change
            share = 1.0 if new >= 0.2 * old else 0.8 * old / (old - new)
            damped = share * change + (1.0 - share) * along
            matrix += np.outer(damped, damped) / (step @ damped) - np.outer(along, along) / old

    def take(self, at: np.ndarray, found: Computed, promised: float, scaling: Scaling) -> None:
        """Move to a tried point if it is better, and adapt the trust region."""
        before, after = (scaling.merit(c.values, self.aim) for c in (self.now, found))
        gain = (before - after) / promised if np.isfinite(after) and np.isfinite(found.slopes).all() else -1.0
        length = float(np.abs(at - self.at).max())
        self.learn(at, found)
        self.steps += 1
        if gain < 0.25:
            self.radius = 0.5 * length
        elif gain > 0.75 and length > 0.99 * self.radius:
            self.radius *= 2.0
        if gain > 1e-4:
            self.at, self.now = at, found
        self.open = self.radius > LEAST_RADIUS


def best_step(lane: Lane, scaling: Scaling, space: SearchRange) -> tuple[np.ndarray, float]:
    """The step to the minimum of the models in the trust region, and the improvement that they promise."""
    import scipy.optimize

    count, free = scaling.objectives, len(lane.at)
    level, unit = scaling.of(lane.now.values), scaling.unit
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
    return step, scaling.merit(lane.now.values, lane.aim) - float(reached)


def solve_together(
    lanes: Sequence[Lane],
    evaluator: BatchEvaluator,
    scaling: Scaling,
    space: SearchRange,
    max_steps: int,
    progress: Callable[[], None],
) -> None:
    """Run all searches to their ends: one step of each open one at a time, simulated side by side."""
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
        found = evaluator.at(np.stack([at for _, at, _ in tried]))
        for (lane, at, promised), computed in zip(tried, found, strict=True):
            lane.take(at, computed, promised, scaling)
