"""The least squares of a fit: `jaxdamp.solve.BoundedLevenbergMarquardt`, or any solver of optimistix.

Only the forces of the law and their derivatives are compiled, in one program for all points, starts and profiles.
"""

import copy
import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from jaxdamp._jacobian import with_jacobian
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._status import Status
from jaxdamp._triangles import orthonormal, triangle
from jaxdamp.dampers import laws_inside, margins
from jaxdamp.identify.printed import Evaluator, evaluator, evaluators
from jaxdamp.identify.problem import Problem, linearised
from jaxdamp.identify.residuals import AbstractResiduals
from jaxdamp.parameters import Coordinates
from jaxdamp.solve import BoundedLevenbergMarquardt, Linearisation, least_squares_on_host


Solver = optx.AbstractLeastSquaresSolver | optx.AbstractMinimiser
SOLVER = BoundedLevenbergMarquardt()  # of fits, unless they are given another one


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


NEAR_END = 0.01  # in coordinates, within which a number that presses against an end of its range belongs on it
SETTLED = 1e-3  # of the residual, which the other numbers may still take off, where a search is at its minimum


class Here(NamedTuple):
    """A problem at a point."""

    values: Float[np.ndarray, " free"]
    whole: Float[np.ndarray, "samples columns"]  # the Jacobian by them of the weighted residual, which is the last
    units: Float[np.ndarray, "free free"]  # derivatives of the values by the coordinates
    margins: Float[np.ndarray, " conditions"]
    slopes: Float[np.ndarray, "conditions free"]  # by the coordinates


class _Point(NamedTuple):
    """The problem at a point, with an axis of length one."""

    values: Float[np.ndarray, "1 free"]
    residual: Float[np.ndarray, "1 samples"]
    jacobian: Float[np.ndarray, "1 samples free"]  # with respect to the physical values


class Searches:
    """Searches of one problem, which share all that is made for the first.

    `solver` is a `BoundedLevenbergMarquardt` with tolerances of its own, or any other solver of optimistix, which then
    searches in coordinates without bounds.
    """

    def __init__(self, problem: Problem, solver: Solver | None = None) -> None:
        self.problem, self.coordinates, self._solver = problem, problem.coordinates, solver or SOLVER
        by_c = isinstance(self._solver, BoundedLevenbergMarquardt)
        self._printed = evaluator(problem.free, problem.residuals) if by_c else None
        self._to_values = self.coordinates.on_host() if self._printed else None

    @property
    def precision(self) -> float:
        """The relative rounding error of the residuals."""
        return float(np.finfo(np.float64 if self._printed else self.problem.free.values.dtype).eps)

    @property
    def is_printed(self) -> bool:
        """Whether C computes the residuals."""
        return self._printed is not None

    def of(self, problem: Problem, printed: Evaluator | None) -> "Searches":
        """Those of another problem with the same free numbers, by the solver of fits."""
        other = copy.copy(self)
        other.problem, other._printed, other._solver = problem, printed, SOLVER
        return other

    def end(self, values: Float[np.ndarray, " free"], max_steps: int, *, held: int | None = None) -> SearchEnd:
        """Minimise the sum of squares from physical values, in so many points at most, the start among them.

        The parameter of the index `held` stays at its start.
        """
        if not isinstance(self._solver, BoundedLevenbergMarquardt):
            return _search_unbounded(self.problem.started_at(values), max_steps, self._solver)
        lower, upper = (np.array(side, np.float64) for side in self.coordinates.bounds())
        start = np.asarray(self.coordinates.from_physical(values), np.float64)
        if held is not None:
            lower[held] = upper[held] = start[held]
        limits = {"lower": lower, "upper": upper, "precision": self.precision}
        bounded = dataclasses.replace(self._solver, **limits)
        end = least_squares_on_host(self._at, bounded, start[None], max_steps)
        point: _Point = end.aux
        return SearchEnd(point.values[0], point.residual[0], point.jacobian[0], end.status[0], int(end.steps[0]))

    def _at(self, y: Float[np.ndarray, "1 free"], lanes: object) -> tuple[Linearisation, _Point]:
        del lanes  # there is one
        here = self.here(y[0])
        reduced = self._printed.triangle(here.whole) if self._printed else here.whole
        anchor, whole = self.problem.anchor_rows(here.values), here.whole
        whole = np.concatenate([whole, anchor]) if anchor.size else whole
        rows = triangle(np.concatenate([reduced, anchor]) if anchor.size else reduced)
        rows = np.concatenate([rows[:, :-1] @ here.units, rows[:, -1:]], axis=1) / self.problem.level
        point = _Point(here.values[None], whole[None, :, -1], whole[None, :, :-1])
        return Linearisation(rows[None], here.margins[None], here.slopes[None], np.array([float(len(whole))])), point

    def here(self, y: Float[np.ndarray, " free"]) -> Here:
        """The problem at coordinates."""
        if self._printed is None or self._to_values is None:
            return _by_xla(self.problem, self.coordinates, jnp.asarray(y, self.problem.free.values.dtype))
        values, units = self._to_values(y)
        of_law, slopes = self._printed.margins(values)
        return Here(values, self._printed(values), units, of_law, slopes @ units)

    def products(self, here: Here) -> Float[np.ndarray, "columns columns"]:
        """The products of the columns of the Jacobian and the residual, relative to the squares of the forces.

        A triangle is a hundred times more work, and rounding errors of the products matter only for what the records
        do not determine.
        """
        counted = self._printed.counted(here.whole) if self._printed else [here.whole]
        products = sum((rows.T @ rows for rows in counted), np.zeros((here.whole.shape[1],) * 2))
        products[:-1] = here.units.T @ products[:-1]
        products[:, :-1] = products[:, :-1] @ here.units
        return products / self.problem.level**2


def searches_of(problems: Sequence[Problem]) -> list[Searches]:
    """Searches of problems with the same free numbers."""
    first = Searches(problems[0])
    printed = evaluators(first.problem.free, [p.residuals for p in problems]) if first.is_printed else []
    return [first.of(problem, one) for problem, one in zip(problems, printed or [None] * len(problems), strict=True)]


def search(problem: Problem, max_steps: int, solver: Solver | None = None) -> SearchEnd:
    """Minimise the sum of squares from the start of a problem, in so many points at most, the start among them."""
    return Searches(problem, solver).end(np.asarray(problem.free.values), max_steps)


def _by_xla(problem: Problem, coordinates: Coordinates, y: Array) -> Here:
    """The problem at a point, by the one compiled program."""
    return Here(*(np.asarray(a, np.float64) for a in _evaluated(coordinates, y, problem.residuals)))


@compiled_for_loops
def _evaluated(coordinates: Coordinates, y: Array, residuals: Sequence[AbstractResiduals]) -> tuple[Array, ...]:
    """Physical values, the Jacobian of the residual with it as last column, theirs by y, the margins and theirs."""
    values = coordinates.to_physical(y)
    residual, jacobian = linearised(coordinates.free, values, residuals)
    units = jax.jacfwd(coordinates.to_physical)(y)
    of_law, slopes = condition_margins(coordinates, y)
    return values, jnp.concatenate([jacobian, residual[:, None]], axis=1), units, of_law, slopes


def condition_margins(
    coordinates: Coordinates, y: Float[Array, " free"]
) -> tuple[Float[Array, " conditions"], Float[Array, "conditions free"]]:
    """By how much the law keeps its conditions between parameters, and the derivatives by the coordinates."""
    if not any(law.has_conditions() for _, law in laws_inside(coordinates.free.tree)):
        none = jnp.zeros((0, y.size), y.dtype)
        return none[:, 0], none
    return with_jacobian(lambda y: margins(coordinates.free.build(coordinates.to_physical(y))))(y)


def _search_unbounded(problem: Problem, max_steps: int, solver: Solver) -> SearchEnd:
    """Minimise by any solver of optimistix, in coordinates in which domains, bounds and orders hold by construction."""
    coordinates = Coordinates(problem.free, smooth="all")
    residual = _Residual(coordinates, problem.residuals, jnp.asarray(problem.level), problem.anchor)
    start = jnp.asarray(coordinates.start)
    solution = optx.least_squares(residual, solver, start, max_steps=max_steps, throw=False)
    bounded = problem.coordinates
    # coordinates so far out that rounding puts the number on, or past, the end that a search keeps
    y = np.clip(bounded.from_physical(np.asarray(coordinates.to_physical(solution.value))), *bounded.bounds())
    end = _by_xla(problem, bounded, jnp.asarray(y))
    if solution.result == optx.RESULTS.successful:
        status = Status.CONVERGED
    elif solution.result == optx.RESULTS.nonlinear_max_steps_reached:
        status = Status.STEP_LIMIT
    else:
        status = Status.NO_STEP
    end, settled = _at_pressed_ends(problem, y, end)
    status = Status.CONVERGED if settled else status
    steps, whole = int(solution.stats["num_steps"]), _whole(problem, end)
    return SearchEnd(end.values, whole[:, -1], whole[:, :-1], status, steps)


def _at_pressed_ends(problem: Problem, y: Float[np.ndarray, " free"], end: Here) -> tuple[Here, bool]:
    """The end of a search with the numbers that press against an end of their range on it, if that is no worse.

    The coordinates without bounds approach such an end only slowly, and a search stops before it. Also whether some do,
    and the others are where the derivatives place the minimum.
    """
    rows, (lower, upper) = _whole(problem, end), problem.coordinates.bounds()
    slope = end.units.T @ (rows[:, :-1].T @ rows[:, -1])
    low, high = (y - lower < NEAR_END) & (slope > 0.0), (upper - y < NEAR_END) & (slope < 0.0)
    pressed, at = low | high, np.where(low, lower, np.where(high, upper, y))
    if not pressed.any():
        return end, False
    there = _by_xla(problem, problem.coordinates, jnp.asarray(at, problem.free.values.dtype))
    rows_there = _whole(problem, there)
    missed = np.linalg.norm(rows_there[:, -1])
    if not (missed <= np.linalg.norm(rows[:, -1]) and np.all(there.margins > 0.0)):
        return end, False
    left = orthonormal((rows_there[:, :-1] @ there.units)[:, ~pressed]).T @ rows_there[:, -1]
    return there, bool(np.linalg.norm(left) <= SETTLED * missed)


def _whole(problem: Problem, here: Here) -> Float[np.ndarray, "samples columns"]:
    return np.concatenate([here.whole, problem.anchor_rows(here.values)])


class _Residual(eqx.Module):
    """The residual relative to the size of the data; infinite where a condition between parameters is violated."""

    coordinates: Coordinates
    residuals: tuple[AbstractResiduals, ...]
    level: Array
    anchor: Any

    def __call__(self, y: Array, args: Any) -> Array:
        values = self.coordinates.to_physical(y)
        model = self.coordinates.free.build(values)
        missed = jnp.concatenate([part(model) for part in self.residuals])
        if self.anchor is not None:
            at, weight = self.anchor
            missed = jnp.concatenate([missed, weight * (values - at)])
        of_law, _ = condition_margins(self.coordinates, y)
        return jnp.where(jnp.all(of_law > 0), missed / self.level, jnp.inf)
