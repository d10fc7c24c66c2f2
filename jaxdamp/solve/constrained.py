"""Constrained minimisation with a batch axis: sequential quadratic programming within trust regions."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp._one_thread import one_thread
from jaxdamp.solve.step_models import StepModels


RADIUS = 0.5  # largest change of a coordinate in the first step; coordinates are one at the start
LEAST_RADIUS = 1e-6
CURVATURE = 0.1  # second derivative of a row by a coordinate at first, relative to its size
PLANES = 4  # refused points whose tangents take part
FAR_WORSE = -10.0  # loss in units of the promised gain, from which slopes at a point say nothing of those near by
PENALTY, FURTHER, HIGHEST = 10.0, 10.0, 1e9  # of a violated limit, in units of the objectives: first, factor, highest


class Evaluation(NamedTuple):
    """What is computed at a point.

    Attributes:
        values: numbers of the caller, which the search hands through.
        rows: the objectives, then the limited functions.
        slopes: derivatives of the rows with respect to the coordinates.
    """

    values: Float[np.ndarray, " numbers"]
    rows: Float[np.ndarray, " rows"]
    slopes: Float[np.ndarray, "rows free"]


Evaluate = Callable[[Float[np.ndarray, "points free"]], Sequence[Evaluation]]


class Scaling(NamedTuple):
    """Zero and unit of each row: objectives first, then limited functions, which must not be positive when scaled.

    Attributes:
        zero: what is subtracted from each row.
        unit: what the difference is divided by.
        objectives: number of objectives.
    """

    zero: Float[np.ndarray, " rows"]
    unit: Float[np.ndarray, " rows"]
    objectives: int

    def of(self, rows: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " rows"]:
        """The rows, scaled."""
        return (rows - self.zero) / self.unit


class Region(NamedTuple):
    """Linear constraints of the coordinates: lower ≤ y ≤ upper, and A y ≥ b.

    Attributes:
        lower: smallest coordinates.
        upper: largest coordinates.
        matrix: A.
        least: b.
    """

    lower: Float[np.ndarray, " free"]
    upper: Float[np.ndarray, " free"]
    matrix: Float[np.ndarray, "constraints free"]
    least: Float[np.ndarray, " constraints"]


@final
@dataclasses.dataclass
class SearchState:
    """One search: towards an aim for the objectives, by quadratic models of all rows within a trust region.

    Attributes:
        aim: value of each scaled objective that is aimed at; the largest excess is minimised.
        y: coordinates.
        evaluation: numbers and derivatives there.
        curvature: estimated second derivatives of each row.
        radius: largest change of a coordinate in the next step.
        penalty: of a violated limit, in units of the objectives.
        steps: number of steps tried.
        open: whether the search goes on.
        converged: whether the models promise no more improvement.
        fixed: coordinates that stay as they are; none if left out.
        refused: points tried from here that were no better: where rows have kinks, their slopes there are others.
    """

    aim: Float[np.ndarray, " objectives"]
    y: Float[np.ndarray, " free"]
    evaluation: Evaluation
    curvature: Float[np.ndarray, "rows free free"]
    radius: float = RADIUS
    penalty: float = PENALTY
    steps: int = 0
    open: bool = True
    converged: bool = False
    fixed: Bool[np.ndarray, " free"] | None = None
    refused: tuple[tuple[Float[np.ndarray, " free"], Evaluation], ...] = ()

    def neighbour(self, aim: np.ndarray, y: np.ndarray, evaluation: Evaluation) -> "SearchState":
        """A search that starts from a point near this one, with its curvature."""
        near = SearchState(aim, self.y, self.evaluation, self.curvature.copy())
        near.learn(y, evaluation)
        near.y, near.evaluation = y, evaluation
        return near

    def reopened(self, radius: float) -> None:
        """Search on from the present point, with as many steps as at first."""
        self.open, self.converged, self.steps, self.radius = True, False, 0, radius

    def learn(self, y: np.ndarray, evaluation: Evaluation) -> None:
        """Update the curvature by the derivatives at another point (damped BFGS, so that it stays positive).

        Source: Nocedal, Wright, Numerical Optimization, 2nd edition, procedure 18.2.
        """
        step = y - self.y
        if not np.all(np.isfinite(evaluation.slopes)) or not step.any():
            return
        for matrix, change in zip(self.curvature, evaluation.slopes - self.evaluation.slopes, strict=True):
            along = matrix @ step
            old, new = step @ along, step @ change
            share = 1.0 if new >= 0.2 * old else 0.8 * old / (old - new)
            damped = share * change + (1.0 - share) * along
            if old > 0.0 and step @ damped > 0.0:
                matrix += np.outer(damped, damped) / (step @ damped) - np.outer(along, along) / old


@final
@dataclasses.dataclass(frozen=True)
class SequentialQuadratic:
    """A constrained minimiser, which drives many searches side by side: their points are evaluated in one batch.

    Each search minimises max_i (f_i(y) − a_i) over the scaled objectives f_i with its own aims a, where the scaled
    limited functions are not positive, within a region. A step minimises quadratic models of all rows, with exact
    derivatives and estimated curvatures, in a box around the point; violated limits have a penalty, which grows where a
    search would end beyond them. As of an `optimistix.AbstractMinimiser` there are `init`, `step` and `terminate`, for
    all searches at once; `solve` is the loop, on the host.

    Arguments:
        region: bounds and linear constraints, which always hold.
        scaling: of the rows.
        max_steps: of each search.
        improvement: of the scaled objectives, that a search may leave at its end.
        rounding: error of the scaled objectives.
        feasible: violation of a scaled limit up to which the penalty does not grow; infinite for a constant penalty.
        share: of the sum of all objectives in what is minimised; a small one excludes points that others beat in one.

    Source: Nocedal, Wright, Numerical Optimization, 2nd edition, sections 18.5 (trust region, exact penalty) and 17.2.
    """

    region: Region
    scaling: Scaling
    max_steps: int
    improvement: float
    rounding: float = 1e-13
    feasible: float = np.inf
    share: float = 0.0

    def init(
        self, aim: Float[np.ndarray, " objectives"], y: Float[np.ndarray, " free"], evaluation: Evaluation
    ) -> SearchState:
        """A search without knowledge of curvature: that of a row is taken as a share of its size.

        Arguments:
            aim: of the scaled objectives.
            y: coordinates to start from.
            evaluation: of the start.
        """
        size = CURVATURE * np.maximum(np.abs(evaluation.rows), 1e-6 * self.scaling.unit)
        return SearchState(aim, y, evaluation, size[:, None, None] * np.eye(len(y)))

    def solve(
        self, evaluate: Evaluate, states: Sequence[SearchState], progress: Callable[[], None] = lambda: None
    ) -> None:
        """Run all searches to their ends.

        Arguments:
            evaluate: rows and derivatives of many points.
            states: the searches, which are changed.
            progress: called after each step.
        """
        while self.step(evaluate, states):
            progress()

    def step(self, evaluate: Evaluate, states: Sequence[SearchState]) -> bool:
        """One step of each open search, evaluated side by side; whether any was open.

        Arguments:
            evaluate: as in `solve`.
            states: as in `solve`.
        """
        import scipy.optimize  # noqa: F401 - before its linear algebra is limited

        tried = []
        with one_thread():
            for state in (state for state in states if state.open):
                step, promised = self._best_step(state)
                while promised < self.improvement and self._raised_penalty(state):
                    step, promised = self._best_step(state)
                if not self.terminate(state, promised):
                    tried.append((state, state.y + step, promised))
            if tried:
                evaluations = evaluate(np.stack([y for _, y, _ in tried]))
                for (state, y, promised), evaluation in zip(tried, evaluations, strict=True):
                    self._move(state, y, evaluation, promised)
        return bool(tried)

    def terminate(self, state: SearchState, promised: float) -> bool:
        """Whether a search has ended: at an optimum of its models, or after all its steps.

        Arguments:
            state: the search.
            promised: improvement of its next step.
        """
        state.converged = promised < self.improvement
        state.open = not state.converged and state.steps < self.max_steps
        return not state.open

    def merit(
        self, rows: Float[np.ndarray, " rows"], aim: Float[np.ndarray, " objectives"], penalty: float = PENALTY
    ) -> float:
        """Largest distance of a scaled objective beyond its aim, with the penalty of violated limits.

        Arguments:
            rows: at a point, not scaled.
            aim: of the scaled objectives.
            penalty: of violated limits.
        """
        objectives, limits = np.split(self.scaling.of(rows), [self.scaling.objectives])
        return float((objectives - aim).max() + self.share * objectives.sum() + penalty * limits.max(initial=0.0))

    def _move(self, state: SearchState, y: np.ndarray, evaluation: Evaluation, promised: float) -> None:
        """Go to a tried point if it is better, and adapt the trust region."""
        before, after = (self.merit(e.rows, state.aim, state.penalty) for e in (state.evaluation, evaluation))
        usable = np.isfinite(after) and np.isfinite(evaluation.slopes).all()
        rounding = self.rounding * (1.0 + abs(before))
        gain = (before - after + rounding) / (promised + rounding) if usable else -1.0
        length = float(np.abs(y - state.y).max())
        if gain > FAR_WORSE:
            state.learn(y, evaluation)
        state.steps += 1
        if gain < 0.25:
            state.radius = 0.5 * length
        elif gain > 0.75 and length > 0.99 * state.radius:
            state.radius *= 2.0
        if gain > 1e-4:
            state.y, state.evaluation, state.refused = y, evaluation, ()
        elif usable:
            state.refused = (*state.refused, (y, evaluation))[-PLANES:]
        state.open = state.radius > LEAST_RADIUS or self._raised_penalty(state)

    def _raised_penalty(self, state: SearchState) -> bool:
        """Raise the penalty of a search that would end beyond a limit, as far as there is a higher one."""
        violation = self.scaling.of(state.evaluation.rows)[self.scaling.objectives :].max(initial=0.0)
        if not violation > self.feasible or state.penalty >= HIGHEST:
            return False
        state.penalty, state.radius = FURTHER * state.penalty, max(state.radius, 0.1 * RADIUS)
        return True

    def _best_step(self, state: SearchState) -> tuple[np.ndarray, float]:
        """The step to the minimum of the models in the trust region, and the improvement that they promise."""
        count, region = self.scaling.objectives, self.region
        lower, upper = (np.clip(end - state.y, -state.radius, state.radius) for end in region[:2])
        lower, upper = np.minimum(lower, 0.0), np.maximum(upper, 0.0)
        if state.fixed is not None:
            lower, upper = (np.where(state.fixed, 0.0, end) for end in (lower, upper))
        unit = self.scaling.unit
        slopes, curvature = state.evaluation.slopes / unit[:, None], state.curvature / unit[:, None, None]
        box = np.maximum(-lower, upper)
        reach = np.abs(slopes[:count]) @ box
        # The improvement that a step can bring; where limits are far dearer than objectives, each in their own size.
        size = float(np.clip(reach[:count].max(), 1e-12, max(1.0, state.penalty / PENALTY)))
        of_limits = min(size, 1.0)
        sizes = np.where(np.arange(len(slopes)) < count, size, of_limits)
        level = self.scaling.of(state.evaluation.rows)
        level[:count] -= state.aim
        base = float(level[:count].max())
        level[:count] -= base
        planes, plane_slopes = self._planes(state, base)
        at_planes = np.tile(sizes, len(state.refused))
        scaled = level / sizes, slopes / sizes[:, None], curvature / sizes[:, None, None]
        models = StepModels(
            *scaled,
            planes / at_planes,
            plane_slopes / at_planes[:, None],
            count,
            self.share,
            state.penalty * of_limits / size,
        )
        models = models if self.share else models.of_largest(box)
        step, promised = models.best_step(lower, upper, region.matrix, region.least - region.matrix @ state.y)
        return step, size * promised

    def _planes(self, state: SearchState, base: float) -> tuple[np.ndarray, np.ndarray]:
        """Values at the present point, and slopes, of the tangents of all rows at the refused points; scaled."""
        values, slopes = [np.zeros(0)], [np.zeros((0, len(state.y)))]
        for y, evaluation in state.refused:
            slope = evaluation.slopes / self.scaling.unit[:, None]
            value = self.scaling.of(evaluation.rows) - slope @ (y - state.y)
            value[: self.scaling.objectives] -= state.aim + base
            values, slopes = [*values, value], [*slopes, slope]
        return np.concatenate(values), np.concatenate(slopes)
