"""The search for the least squares: Levenberg-Marquardt within bounds, compiled as one loop."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
from jaxtyping import Array, Bool, Float, Int

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
MOST_OF_THE_WAY = 0.9  # to an edge, in one step
NEAR = 1e-3  # coordinates so near an edge may go all the way
AT_EDGE = 1e-6  # coordinates so near their lower bound end on it; also the distance kept from conditions
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
        """The sum of squares of the weighted residual."""
        return float(self.residual @ self.residual)

    @property
    def finite(self) -> bool:
        """Whether residual and derivatives are finite."""
        return bool(np.all(np.isfinite(self.residual)) and np.all(np.isfinite(self.jacobian)))


def search(problem: Problem, max_steps: int, held: int | None = None) -> SearchEnd:
    """Minimise the sum of squares.

    Arguments:
        problem: with the start.
        max_steps: of the search; it is no constant of the compiled program, so another number compiles nothing anew.
        held: the number of a parameter that keeps its start; this compiles nothing anew either.
    """
    coordinates = problem.coordinates
    lower, upper = coordinates.bounds()
    if held is not None:
        lower[held] = upper[held] = coordinates.start[held]
    bounds = Bounds(jnp.asarray(lower), jnp.asarray(upper))
    values, end = _levenberg_marquardt(
        coordinates, bounds, problem.residuals, jnp.asarray(problem.level), jnp.asarray(max_steps)
    )
    status = Status.CONVERGED if end.converged else Status.STEP_LIMIT
    status = status if np.all(np.isfinite(end.trial)) else Status.NO_STEP
    return SearchEnd(np.asarray(values), np.asarray(end.residual), np.asarray(end.jacobian), status, int(end.steps))


class _State(eqx.Module):
    """The best point so far, the linearised problem there, and the point to try next."""

    y: Float[Array, " free"]
    residual: Float[Array, " samples"]
    jacobian: Float[Array, "samples free"]  # with respect to the physical values
    linear: "_Reduced"
    trial: Float[Array, " free"]
    step_size: Float[Array, ""]
    converged: Bool[Array, ""]
    steps: Int[Array, ""]  # points tried


@eqx.filter_jit
def _levenberg_marquardt(
    coordinates: Coordinates,
    bounds: Bounds,
    residuals: tuple[AbstractResiduals, ...],
    level: Float[Array, ""],
    max_steps: Int[Array, ""],
) -> tuple[Float[Array, " free"], _State]:
    """The physical values where the search ends, and its last state.

    Nielsen's rule for the damping 1/step_size, by the ratio of actual to predicted decrease. A step whose predicted
    decrease means less than `STEP_TOLERANCE` standard errors, or drowns in rounding, is accepted and ends the search:
    refused, it would only shrink for ever. A step of less than `SHORT` ends it too, because the kinks of a law are
    kinks of its sum of squares, near which the predicted decrease fails. A step that breaks a condition between
    parameters is refused. The first point tried is the start itself, so that the law is compiled once.
    """

    def at(y: Array) -> tuple[Array, Array]:
        return linearised(coordinates.free, coordinates.to_physical(y), residuals)

    def attempt(now: _State) -> _State:
        first = now.steps == 0
        residual, jacobian = at(now.trial)
        old, new = (0.5 * jnp.sum((r / level) ** 2) for r in (now.residual, residual))
        step = now.trial - now.y
        predicted = now.linear.decrease(step)
        rounding = 500 * jnp.finfo(step.dtype).eps
        floor = jnp.maximum(rounding, STEP_TOLERANCE**2 / residual.size) * old + rounding**2
        negligible = (predicted < floor) & (new - old < floor)
        short = jnp.all(jnp.abs(step) <= SHORT * (1e-3 + jnp.abs(now.y)))
        ratio = (old - new) / jnp.where(predicted > 0, predicted, 1.0)
        kept = jnp.all(_margins(coordinates, now.trial) > 0)
        accept = first | (kept & (negligible | (ratio > WORTHWHILE)))
        growth = jnp.where(first, 1.0, 1.0 / jnp.maximum(1.0 / MOST_GROWTH, 1.0 - (2.0 * ratio - 1.0) ** 3))
        step_size = now.step_size * jnp.where(accept, growth, 1.0 / MOST_GROWTH)
        y, residual, jacobian, linear = jax.lax.cond(
            accept,
            lambda: (now.trial, residual, jacobian, reduced(now, residual, jacobian)),
            lambda: (now.y, now.residual, now.jacobian, now.linear),
        )
        trial = y + linear.step(step_size)
        return _State(y, residual, jacobian, linear, trial, step_size, ~first & (negligible | short), now.steps + 1)

    def reduced(now: _State, residual: Array, jacobian: Array) -> _Reduced:
        return _reduced(coordinates, bounds, now, residual / level, jacobian / level)

    def goes_on(now: _State) -> Array:
        return ~now.converged & (now.steps < max_steps) & jnp.all(jnp.isfinite(now.trial))

    start = jnp.clip(coordinates.start, bounds.lower, bounds.upper)
    residual, jacobian = (jnp.zeros(a.shape, a.dtype) for a in jax.eval_shape(at, start))
    nothing = _no_reduction(coordinates, start)
    one, no = jnp.ones((), start.dtype), jnp.array(False)
    end = jax.lax.while_loop(
        goes_on, attempt, _State(start, residual, jacobian, nothing, start, one, no, jnp.zeros((), int))
    )
    y = jnp.where(jnp.abs(end.y - bounds.lower) < AT_EDGE, bounds.lower, end.y)
    return coordinates.to_physical(y), end


def _margins(coordinates: Coordinates, y: Array) -> Array:
    """By how much the law at coordinates y keeps its conditions."""
    return margins(coordinates.free.build(coordinates.to_physical(y)))


class _Reduced(eqx.Module):
    """The linearised problem min ‖R d + q‖² at a point, the scales of its damping and the limits of d and of C d.

    The scales D are the largest norms of the Jacobian's columns so far (as in MINPACK). The tall Jacobian is reduced to
    a triangle once for each accepted step, so that another damping costs nothing. A step goes at most
    `MOST_OF_THE_WAY` towards an edge that is not near, lest it strand where the law degenerates. Conditions between
    parameters are edges too, linearised at each accepted point.
    """

    r: Float[Array, "free free"]
    q: Float[Array, " free"]
    scale: Float[Array, " free"]
    lower: Float[Array, " free"]
    upper: Float[Array, " free"]
    conditions: Float[Array, "conditions free"]  # C, rows of length one
    least: Float[Array, " conditions"]  # of C d

    def decrease(self, step: Array) -> Array:
        """Predicted decrease of half the sum of squares over a step."""
        return 0.5 * (jnp.sum(self.q**2) - jnp.sum((self.r @ step + self.q) ** 2))

    def step(self, step_size: Array) -> Array:
        """Min ‖R d + q‖² + ‖D d‖² λ/step_size within the limits."""
        scale = jnp.where(self.scale > 0, self.scale, 1.0)
        return _bounded_least_squares(self, jnp.sqrt(FIRST_DAMPING / jnp.maximum(step_size, _TINY)) * scale)


def _no_reduction(coordinates: Coordinates, y: Array) -> _Reduced:
    """Zeros of the right shapes."""
    zero, count = jnp.zeros_like(y), jax.eval_shape(lambda: _margins(coordinates, y)).size
    none = jnp.zeros((count, y.size), y.dtype), jnp.zeros(count, y.dtype)
    return _Reduced(jnp.zeros((y.size, y.size), y.dtype), zero, zero, zero, zero, *none)


def _reduced(coordinates: Coordinates, bounds: Bounds, now: _State, residual: Array, jacobian: Array) -> _Reduced:
    """The linearised problem at the point that was tried."""
    y = now.trial
    tall = jacobian @ jax.jacfwd(coordinates.to_physical)(y)
    whole = triangle(jnp.concatenate([tall, residual[:, None]], axis=1))
    r, q = whole[: y.size, : y.size], whole[: y.size, y.size]
    room = (bounds.lower - y, bounds.upper - y)
    lower, upper = (jnp.where(jnp.abs(a) > NEAR, MOST_OF_THE_WAY * a, a) for a in room)
    scale = jnp.maximum(now.linear.scale, jnp.linalg.norm(r, axis=0))
    return _Reduced(r, q, scale, lower, upper, *_conditions(coordinates, y))


def _conditions(coordinates: Coordinates, y: Array) -> tuple[Array, Array]:
    """Rows C of length one and the least C d, so that a step d stays inside the conditions."""
    if not any(law.has_conditions() for _, law in laws_inside(coordinates.free.tree)):
        return jnp.zeros((0, y.size), y.dtype), jnp.zeros(0, y.dtype)

    def both(y: Array) -> tuple[Array, Array]:
        kept = _margins(coordinates, y)
        return kept, kept

    rows, kept = jax.jacfwd(both, has_aux=True)(y)
    length = jnp.linalg.norm(rows, axis=1)
    length = jnp.where(length > 0, length, 1.0)
    room = kept / length - AT_EDGE
    return rows / length[:, None], -jnp.where(room > NEAR, MOST_OF_THE_WAY * room, room)


def _bounded_least_squares(problem: _Reduced, damping: Array) -> Array:
    """Damped least squares within limits: what would leave is put on its limit, the rest solved again.

    The limits are those of d, and those of C d, which are kept by rows of a great weight.
    """
    r, q, c = problem.r, problem.q, problem.conditions
    count, free = q.size, jnp.full(problem.least.shape, jnp.inf, q.dtype)
    lower, upper = jnp.concatenate([problem.lower, problem.least]), jnp.concatenate([problem.upper, free])
    firm = FIRM * jnp.max(problem.scale, initial=1.0)

    def solve(held: Array, at: Array) -> Array:
        own, tied = held[:count], held[count:]
        fixed, rows = jnp.where(own, at[:count], 0.0), firm * jnp.where(tied[:, None], c, 0.0)
        matrix = jnp.concatenate(
            [jnp.where(own, 0.0, r), jnp.diag(jnp.where(own, 1.0, damping)), jnp.where(own, 0.0, rows)]
        )
        aims = firm * jnp.where(tied, at[count:], 0.0) - rows @ fixed
        target = jnp.concatenate([-q - r @ fixed, fixed, aims])
        return lx.linear_solve(lx.MatrixLinearOperator(matrix), target, lx.QR(), throw=False).value

    def both(step: Array) -> Array:
        return jnp.concatenate([step, c @ step])

    def outside(step: Array, held: Array) -> Array:
        return ~held & ((both(step) < lower) | (both(step) > upper))

    def again(now: tuple[Array, Array]) -> tuple[Array, Array]:
        step, held = now
        held = held | outside(step, held)
        return solve(held, jnp.clip(both(step), lower, upper)), held

    nothing = jnp.zeros(lower.shape, bool)
    step, _ = jax.lax.while_loop(
        lambda now: jnp.any(outside(*now)), again, (solve(nothing, jnp.zeros_like(lower)), nothing)
    )
    return jnp.clip(step, problem.lower, problem.upper)
