"""The least squares search: Levenberg-Marquardt within bounds.

Only the forces of the law and their derivatives are compiled. The algebra of a step is small and runs in NumPy, which
takes a few milliseconds at most; compiled too, it took longer to compile than the forces of most laws.
"""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._status import Status
from jaxdamp.dampers import laws_inside, margins
from jaxdamp.identify._tall import triangle
from jaxdamp.identify.problem import AbstractResiduals, Problem, linearised
from jaxdamp.parameters import Bounds, Coordinates


STEP_TOLERANCE = 1e-4  # standard errors that a last step moves
SHORT = 1e-6  # step, relative to the coordinates
WORTHWHILE = 1e-3  # of the predicted decrease, for a step to be accepted
MOST_GROWTH = 5.0  # of the step size, from one step to the next
FIRST_DAMPING = 1e-2  # of the squared norms of the Jacobian's columns
LEAST_DAMPING = 1e-13  # of the same: keeps singular systems solvable
LARGEST_STEP_SIZE = FIRST_DAMPING / LEAST_DAMPING
MOST_OF_THE_WAY = 0.9  # to an edge, in one step
NEAR = 1e-3  # coordinates so near an edge may go all the way
AT_EDGE = 1e-6  # coordinates so near their lower bound end on it; also the distance to conditions
FIRM = 1e6  # weight of a limit of several coordinates, relative to the data's
_TINY = np.finfo(float).tiny


class SearchEnd(NamedTuple):
    """Where and how a search ended."""

    values: Float[np.ndarray, " free"]
    residual: Float[np.ndarray, " samples"]
    jacobian: Float[np.ndarray, "samples free"]  # with respect to the physical values
    status: Status
    steps: int

    @property
    def converged(self) -> bool:
        """Whether it ended by its tolerance."""
        return self.status is Status.CONVERGED

    @property
    def squares(self) -> float:
        """The sum of squares of the weighted residual, infinite where it is beyond the largest number."""
        with np.errstate(over="ignore", invalid="ignore"):
            return float(self.residual @ self.residual)

    @property
    def finite(self) -> bool:
        """Whether the sum of squares and the derivatives are finite."""
        return bool(np.isfinite(self.squares) and np.all(np.isfinite(self.jacobian)))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # points without finite forces are refused as steps
def search(problem: Problem, max_steps: int, held: int | None = None, tolerance: float = STEP_TOLERANCE) -> SearchEnd:
    """Minimise the sum of squares.

    Nielsen's rule for the damping 1/step_size, by the ratio of actual to predicted decrease. A step whose predicted
    decrease is less than `tolerance` standard errors, or below rounding errors, is accepted and ends the search; if
    refused, it would only become shorter and shorter. A step shorter than `SHORT` also ends the search: kinks of a law
    are kinks of the sum of squares, near which the predicted decrease is wrong. A step that violates a condition
    between parameters is refused. The damping holds back what the records hardly determine, so that a step is small
    far from the minimum too: before the search ends by a small step, the whole step, without damping, is tried, and if
    it is refused, the most damped one that is not small.

    Arguments:
        problem: the problem with its start.
        max_steps: largest number of points tried, including the start.
        held: index of a parameter that is held at its start.
        tolerance: length of the last step in standard errors.
    """
    coordinates = problem.coordinates
    lower, upper = (np.array(side, np.float64) for side in coordinates.bounds())
    start = np.asarray(coordinates.start, np.float64)
    if held is not None:
        lower[held] = upper[held] = start[held]
    bounds = Bounds(lower, upper)
    now = _point(problem, np.clip(start, lower, upper))
    model = _Model.at(now, bounds, np.zeros(start.size))
    step_size, converged, steps, refused = 1.0, False, 1, False
    step = model.step(step_size)
    while not converged and steps < max_steps and np.all(np.isfinite(step)):
        old, rounding = now.half_squares, 500 * now.precision
        floor = max(rounding, tolerance**2 / now.residual.size) * old + rounding**2
        is_whole = not refused and _is_small(model, now, step, floor)
        if is_whole:
            whole = model.step(LARGEST_STEP_SIZE)
            is_whole = not _is_small(model, now, whole, floor)
            step = whole if is_whole else step
        trial = _point(problem, now.y + step)
        steps += 1
        new, predicted = trial.half_squares, model.decrease(step)
        negligible = predicted < floor and new - old < floor
        converged = bool(negligible or _is_short(now, step))
        ratio = (old - new) / (predicted if predicted > 0 else 1.0)
        refused = not (trial.keeps_conditions and (negligible or ratio > WORTHWHILE))
        if not refused:
            # Beyond 2 the growth is at its limit; the cube of a huge ratio would overflow.
            step_size /= max(1.0 / MOST_GROWTH, 1.0 - (2.0 * float(np.clip(ratio, -1e6, 2.0)) - 1.0) ** 3)
            now, model = trial, _Model.at(trial, bounds, model.scale)
        elif not is_whole:
            step_size /= MOST_GROWTH
        step = model.step(step_size)
        while refused and is_whole and step_size < LARGEST_STEP_SIZE and _is_small(model, now, step, floor):
            step_size *= MOST_GROWTH
            step = model.step(step_size)
    status = Status.CONVERGED if converged else Status.STEP_LIMIT
    status = status if np.all(np.isfinite(step)) else Status.NO_STEP
    at_edge = np.abs(now.y - lower) < AT_EDGE
    if np.any(at_edge & (now.y != lower)):
        now = _point(problem, np.where(at_edge, lower, now.y))
    return SearchEnd(now.values, now.residual, now.jacobian, status, steps)


def _is_small(model: "_Model", now: "_Point", step: Float[np.ndarray, " free"], floor: float) -> bool:
    """Whether the search would end by a step; true of one that is not finite."""
    return not model.decrease(step) >= floor or _is_short(now, step)


def _is_short(now: "_Point", step: Float[np.ndarray, " free"]) -> bool:
    return bool(np.all(np.abs(step) <= SHORT * (1e-3 + np.abs(now.y))))


class _Point(NamedTuple):
    """Residual and derivatives at coordinates y."""

    y: Float[np.ndarray, " free"]
    values: Float[np.ndarray, " free"]  # physical
    residual: Float[np.ndarray, " samples"]
    jacobian: Float[np.ndarray, "samples free"]  # with respect to the physical values
    units: Float[np.ndarray, "free free"]  # derivative of the physical values with respect to y
    margins: Float[np.ndarray, " conditions"]  # by how much the law keeps its conditions
    margin_slopes: Float[np.ndarray, "conditions free"]
    level: float
    precision: float

    @property
    def half_squares(self) -> float:
        """Half the sum of squares, relative to that of the measured forces."""
        return 0.5 * float(np.sum((self.residual / self.level) ** 2))

    @property
    def keeps_conditions(self) -> bool:
        """Whether the conditions between parameters hold."""
        return bool(np.all(self.margins > 0))


def _point(problem: Problem, y: Float[np.ndarray, " free"]) -> _Point:
    point = jnp.asarray(y, problem.free.values.dtype)
    arrays = [np.asarray(a, np.float64) for a in _evaluated(problem.coordinates, point, problem.residuals)]
    values, residual, jacobian, units, of_law, slopes = arrays
    residual, jacobian = problem.anchored(values, residual, jacobian)
    precision = float(jnp.finfo(point.dtype).eps)
    return _Point(y, values, residual, jacobian, units, of_law, slopes, problem.level, precision)


@eqx.filter_jit
def _evaluated(coordinates: Coordinates, y: Array, residuals: Sequence[AbstractResiduals]) -> tuple[Array, ...]:
    """Physical values, residual and its Jacobian by them, theirs by y, the margins of the conditions and theirs."""
    values = coordinates.to_physical(y)
    residual, jacobian = linearised(coordinates.free, values, residuals)
    units = jax.jacfwd(coordinates.to_physical)(y)
    if not any(law.has_conditions() for _, law in laws_inside(coordinates.free.tree)):
        none = jnp.zeros((0, y.size), y.dtype)
        return values, residual, jacobian, units, none[:, 0], none

    def margins_of(y: Array) -> tuple[Array, Array]:
        of_law = margins(coordinates.free.build(coordinates.to_physical(y)))
        return of_law, of_law

    slopes, of_law = jax.jacfwd(margins_of, has_aux=True)(y)
    return values, residual, jacobian, units, of_law, slopes


class _Model(NamedTuple):
    """The linearised problem min ‖R d + q‖² at a point, the scales of its damping and the limits of d and of C d.

    The scales D are the largest norms of the Jacobian's columns so far (as in MINPACK). The tall Jacobian is reduced to
    a triangle once for each accepted step, so that another damping costs little. Towards an edge that is not near, a
    step goes at most the fraction `MOST_OF_THE_WAY`, since laws degenerate at the edges. Conditions between parameters
    are edges too, linearised at each accepted point.
    """

    r: Float[np.ndarray, "free free"]
    q: Float[np.ndarray, " free"]
    scale: Float[np.ndarray, " free"]
    lower: Float[np.ndarray, " free"]
    upper: Float[np.ndarray, " free"]
    conditions: Float[np.ndarray, "conditions free"]  # C, rows of length one
    least: Float[np.ndarray, " conditions"]  # of C d

    @staticmethod
    def at(point: _Point, bounds: Bounds, scale: Float[np.ndarray, " free"]) -> "_Model":
        """The model at a point, where the columns had norms up to `scale` before."""
        count = point.y.size
        whole = triangle(np.concatenate([point.jacobian, point.residual[:, None]], axis=1))
        in_coordinates = np.concatenate([whole[:, :count] @ point.units, whole[:, count:]], axis=1) / point.level
        whole = triangle(in_coordinates) if np.all(np.isfinite(whole)) else np.full((count + 1, count + 1), np.nan)
        r, q = whole[:count, :count], whole[:count, count]
        lower, upper = (np.where(np.abs(a) > NEAR, MOST_OF_THE_WAY * a, a) for a in (b - point.y for b in bounds))
        length = np.linalg.norm(point.margin_slopes, axis=1)
        length = np.where(length > 0, length, 1.0)
        room = point.margins / length - AT_EDGE
        least = -np.where(room > NEAR, MOST_OF_THE_WAY * room, room)
        scale = np.maximum(scale, np.linalg.norm(r, axis=0))
        return _Model(r, q, scale, lower, upper, point.margin_slopes / length[:, None], least)

    def decrease(self, step: Float[np.ndarray, " free"]) -> float:
        """Predicted decrease of half the sum of squares over a step."""
        return 0.5 * float(np.sum(self.q**2) - np.sum((self.r @ step + self.q) ** 2))

    def step(self, step_size: float) -> Float[np.ndarray, " free"]:
        """Min ‖R d + q‖² + ‖D d‖² λ/step_size within the limits; NaN where there is none.

        A coordinate that would leave its limits is put on the nearer one, and the rest is solved again. Limits of C d
        are rows of a great weight.
        """
        if not np.all(np.isfinite(self.r)):
            return np.full(self.q.size, np.nan)
        scale = np.where(self.scale > 0, self.scale, 1.0)
        damping = np.sqrt(FIRST_DAMPING / max(step_size, _TINY)) * scale
        lower = np.concatenate([self.lower, self.least])
        upper = np.concatenate([self.upper, np.full(self.least.shape, np.inf)])
        held, at = np.zeros(lower.shape, bool), np.zeros(lower.shape)
        while True:
            step = self._solved(damping, held, at)
            both = np.concatenate([step, self.conditions @ step])
            outside = ~held & ((both < lower) | (both > upper))
            if not np.any(outside):
                return np.clip(step, self.lower, self.upper)
            held, at = held | outside, np.clip(both, lower, upper)

    def _solved(
        self, damping: Float[np.ndarray, " free"], held: np.ndarray, at: np.ndarray
    ) -> Float[np.ndarray, " free"]:
        """The damped least squares with some coordinates, and some rows of C d, held."""
        count, firm = self.q.size, FIRM * np.max(self.scale, initial=1.0)
        step, open_ = np.where(held[:count], at[:count], 0.0), ~held[:count]
        rows, aims = firm * self.conditions[held[count:]], firm * at[count:][held[count:]]
        matrix = np.concatenate([self.r, np.diag(damping), rows])
        target = np.concatenate([-self.q, np.zeros(count), aims]) - matrix @ step
        if np.any(open_):
            q, r = np.linalg.qr(matrix[:, open_])
            try:
                step[open_] = np.linalg.solve(r, q.T @ target)
            except np.linalg.LinAlgError:
                step[open_] = np.nan
        return step
