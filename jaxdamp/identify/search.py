"""The search for the least squares: Levenberg-Marquardt on a residual whose Jacobian is made in one forward pass."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float

from jaxdamp.dampers import laws_inside, margins
from jaxdamp.identify._tall import triangle
from jaxdamp.identify.coordinates import OPEN_EDGE, Box, box, start, to_values
from jaxdamp.identify.traces import Batch
from jaxdamp.parameters import FreeParameters


STILL = 1e-4  # standard errors that a last step moves
SHORT = 1e-6  # step, relative to the coordinates
WORTHWHILE = 1e-3  # of the predicted decrease, for a step to be accepted
MOST_GROWTH = 5.0  # of the step size, from one step to the next
FIRST_DAMPING = 1e-2  # of the squared norms of the Jacobian's columns
MOST_OF_THE_WAY = 0.9  # to an edge, in one step
NEAR = 1e-3  # coordinates so near an edge may go all the way
FIRM = 1e6  # weight of a limit of several coordinates, relative to the data's
ROUNDING = 1e-8  # residual, relative to the force, below which there is nothing left to explain
_TINY = np.finfo(float).tiny


class Found(NamedTuple):
    """Where a search ended."""

    values: Float[np.ndarray, " free"]
    residual: Float[np.ndarray, " samples"]
    jacobian: Float[np.ndarray, "samples free"]  # with respect to the physical values
    converged: bool
    steps: int
    said: str  # why it did not converge


class Problem(NamedTuple):
    """What a search minimises: the weighted residual of the records, by the free parameters of a law."""

    free: FreeParameters  # with their start
    made: Sequence[Batch]
    level: float  # size of the measured forces in the units of the residual, root of the sum of squares

    @property
    def used(self) -> Bool[np.ndarray, " samples"]:
        """Which samples of the flattened residual count; the others are padding, or lie before the settling."""
        return np.concatenate([np.ravel(batch.weight) for batch in self.made]) > 0

    def started_at(self, values: Float[np.ndarray, " free"]) -> "Problem":
        """The same with another start."""
        return self._replace(free=self.free.started_at(values))

    def is_rounding(self, squares: float) -> bool:
        """Whether a sum of squares is so small that it is made of rounding, not of noise."""
        return squares <= (ROUNDING * self.level) ** 2


def finite(found: Found) -> bool:
    """Whether forces and derivatives are finite where a search ended."""
    return bool(np.all(np.isfinite(found.residual)) and np.all(np.isfinite(found.jacobian)))


def squares(found: Found) -> float:
    """The sum of squares of the weighted residual."""
    return float(found.residual @ found.residual)


@eqx.filter_jit
def linearised(free: FreeParameters, values: Array, made: Sequence[Batch]) -> tuple[Array, Array]:
    """Weighted residual of all samples and its Jacobian with respect to the physical values."""

    def both(values: Array) -> tuple[Array, Array]:
        law = free.build(values)
        residual = jnp.concatenate([jnp.ravel(batch.residual(law)) for batch in made])
        return residual, residual

    jacobian, residual = jax.jacfwd(both, has_aux=True)(values)
    return residual, jacobian


@eqx.filter_custom_jvp
def _misfit(y: Array, problem: tuple[FreeParameters, Sequence[Batch]]) -> tuple[Array, Array]:
    """Residual at coordinates y, with its Jacobian by the physical values riding along.

    The rule below hands that Jacobian to whoever differentiates, so that the law's march is compiled once and the
    linear function that the solver keeps is one matrix, not the trace of a loop.
    """
    free, made = problem
    return linearised(free, to_values(free, y), made)


@_misfit.def_jvp
def _misfit_jvp(primals: Any, tangents: Any) -> Any:
    y, (free, made) = primals
    values, moved = jax.jvp(lambda y: to_values(free, y), (y,), (tangents[0],))
    residual, jacobian = linearised(free, values, made)
    return (residual, jacobian), (jacobian @ moved, jnp.zeros_like(jacobian))


def _margins(free: FreeParameters, y: Array) -> Array:
    """By how much the law at coordinates y keeps its conditions."""
    return margins(free.build(to_values(free, y)))


class _Reduced(eqx.Module):
    """The linearised problem min ‖R d + q‖² at a point, the scales of its damping and the limits of d and of C d."""

    r: Float[Array, "free free"]
    q: Float[Array, " free"]
    scale: Float[Array, " free"]
    lower: Float[Array, " free"]
    upper: Float[Array, " free"]
    conditions: Float[Array, "conditions free"]  # C, rows of length one
    least: Float[Array, " conditions"]  # of C d


class _BoxedDescent(optx.AbstractDescent):
    """min ‖J d + r‖² + λ ‖D d‖² within a box, D the largest norms of the Jacobian's columns so far (as in MINPACK).

    The tall Jacobian is reduced to a triangle once for each accepted step, so that another damping costs nothing.
    A step goes at most `MOST_OF_THE_WAY` towards an edge that is not near, lest it strand where the law degenerates.
    Conditions between parameters are edges too, linearised at each accepted point.
    """

    box: Box
    free: FreeParameters

    def init(self, y: Array, f_info_struct: Any) -> _Reduced:
        del f_info_struct
        zero, count = jnp.zeros_like(y), margins(self.free.tree).size
        none = jnp.zeros((count, y.size), y.dtype), jnp.zeros(count, y.dtype)
        return _Reduced(jnp.zeros((y.size, y.size), y.dtype), zero, zero, zero, zero, *none)

    def query(self, y: Array, f_info: Any, state: _Reduced) -> _Reduced:
        jacobian = f_info.jac.as_matrix()
        whole = triangle(jnp.concatenate([jacobian, f_info.residual[:, None]], axis=1))
        r, q = whole[: y.size, : y.size], whole[: y.size, y.size]
        room = (self.box.lower - y, self.box.upper - y)
        lower, upper = (jnp.where(jnp.abs(a) > NEAR, MOST_OF_THE_WAY * a, a) for a in room)
        scale = jnp.maximum(state.scale, jnp.linalg.norm(r, axis=0))
        return _Reduced(r, q, scale, lower, upper, *self._conditions(y))

    def _conditions(self, y: Array) -> tuple[Array, Array]:
        """Rows C of length one and the least C d, so that a step d stays inside the conditions."""
        if not any(law.has_conditions() for _, law in laws_inside(self.free.tree)):
            return jnp.zeros((0, y.size), y.dtype), jnp.zeros(0, y.dtype)

        def both(y: Array) -> tuple[Array, Array]:
            kept = _margins(self.free, y)
            return kept, kept

        rows, kept = jax.jacfwd(both, has_aux=True)(y)
        length = jnp.linalg.norm(rows, axis=1)
        length = jnp.where(length > 0, length, 1.0)
        room = kept / length - OPEN_EDGE
        return rows / length[:, None], -jnp.where(room > NEAR, MOST_OF_THE_WAY * room, room)

    def step(self, step_size: Array, state: _Reduced) -> tuple[Array, optx.RESULTS]:
        scale = jnp.where(state.scale > 0, state.scale, 1.0)
        damping = jnp.sqrt(FIRST_DAMPING / jnp.maximum(step_size, _TINY)) * scale
        return _boxed_least_squares(state, damping), optx.RESULTS.successful


def _boxed_least_squares(problem: _Reduced, damping: Array) -> Array:
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


class _RegionState(eqx.Module):
    step_size: Float[Array, ""]
    done: Bool[Array, ""]


class _Region(optx.AbstractSearch):
    """Nielsen's rule for the damping 1/step_size, by the ratio of actual to predicted decrease.

    A step whose predicted decrease means less than `STILL` standard errors, or drowns in rounding, is accepted and ends
    the search: refused, it would only shrink for ever. A step of less than `SHORT` ends it too, because the kinks of a
    law are kinks of its sum of squares, near which the predicted decrease fails. A step that breaks a condition between
    parameters is refused.
    """

    free: FreeParameters

    def init(self, y: Array, f_info_struct: Any) -> _RegionState:
        del f_info_struct
        return _RegionState(jnp.ones((), y.dtype), jnp.array(False))

    def step(
        self, first_step: Array, y: Array, y_eval: Array, f_info: Any, f_eval_info: Any, state: _RegionState
    ) -> tuple[Array, Array, optx.RESULTS, _RegionState]:
        old, new = f_info.as_min(), f_eval_info.as_min()
        predicted = old - 0.5 * jnp.sum((f_info.jac.mv(y_eval - y) + f_info.residual) ** 2)
        rounding = 500 * jnp.finfo(y.dtype).eps
        floor = jnp.maximum(rounding, STILL**2 / f_info.residual.size) * old + rounding**2
        still = (predicted < floor) & (new - old < floor)
        short = jnp.all(jnp.abs(y_eval - y) <= SHORT * (1e-3 + jnp.abs(y)))
        ratio = (old - new) / jnp.where(predicted > 0, predicted, 1.0)
        kept = jnp.all(_margins(self.free, y_eval) > 0)
        accept = first_step | (kept & (still | (ratio > WORTHWHILE)))
        grown = jnp.where(first_step, 1.0, 1.0 / jnp.maximum(1.0 / MOST_GROWTH, 1.0 - (2.0 * ratio - 1.0) ** 3))
        step_size = state.step_size * jnp.where(accept, grown, 1.0 / MOST_GROWTH)
        return step_size, accept, optx.RESULTS.successful, _RegionState(step_size, ~first_step & (still | short))


def _silent(**_: Any) -> None:
    pass


class _Solver(optx.AbstractGaussNewton):
    descent: optx.AbstractDescent
    search: optx.AbstractSearch
    rtol: float = 1e-12
    atol: float = 1e-12
    norm: Callable = optx.max_norm
    verbose: Callable[..., None] = _silent

    def terminate(self, fn: Any, y: Any, args: Any, options: Any, state: Any, tags: Any) -> tuple[Array, optx.RESULTS]:
        del fn, y, options, tags
        return state.terminate | state.search_state.done | (state.num_steps >= args[-1]), state.result


@eqx.filter_jit
def _levenberg_marquardt(free: FreeParameters, limits: Box, made: Sequence[Batch], level: Array, budget: Array) -> Any:
    def scaled(y: Array, problem: Any) -> tuple[Array, Array]:
        free, made, level, _ = problem
        residual, jacobian = _misfit(y, (free, made))
        return residual / level, jacobian

    solver = _Solver(descent=_BoxedDescent(limits, free), search=_Region(free))
    inside = jnp.clip(start(free), limits.lower, limits.upper)
    problem = (free, made, level, budget)
    solution = optx.least_squares(scaled, solver, inside, problem, has_aux=True, max_steps=None, throw=False)
    # The state holds residual and Jacobian of the last accepted point; `solution.aux` is one step behind.
    residual = solution.state.f_info.residual * level
    y = jnp.where(jnp.abs(solution.value - limits.lower) < OPEN_EDGE, limits.lower, solution.value)
    ended = solution.state.terminate | solution.state.search_state.done
    healthy = solution.result == optx.RESULTS.successful
    return to_values(free, y), residual, solution.state.aux, ended, healthy, solution.stats["num_steps"]


def search(problem: Problem, max_steps: int, held: int | None = None) -> Found:
    """Minimise the sum of squares.

    Arguments:
        problem: with the start.
        max_steps: of the search; it is no constant of the compiled program, so another number compiles nothing anew.
        held: the number of a parameter that keeps its start; this compiles nothing anew either.
    """
    free = problem.free
    lower, upper = box(free)
    if held is not None:
        lower[held] = upper[held] = start(free)[held]
    limits = Box(jnp.asarray(lower), jnp.asarray(upper))
    values, residual, jacobian, ended, healthy, steps = _levenberg_marquardt(
        free, limits, problem.made, jnp.asarray(problem.level), jnp.asarray(max_steps)
    )
    said = "" if ended else f"it was stopped after {max_steps} steps, as many as `max_steps` allows."
    said = said if healthy else "a step could not be computed."
    return Found(np.asarray(values), np.asarray(residual), np.asarray(jacobian), not said, int(steps), said)
