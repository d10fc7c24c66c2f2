"""The rules of a step of Levenberg-Marquardt within bounds and conditions, over NumPy or `jax.numpy`.

All arrays have the axes of the lanes first: one in a loop on the host, none inside JAX, where `jax.vmap` adds them.
"""

from collections.abc import Callable
from types import ModuleType
from typing import NamedTuple, TypeAlias, TypeVar

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree


AnyArray: TypeAlias = Array | np.ndarray
EachLane: TypeAlias = Float[AnyArray, "*lanes"]
LaneMask: TypeAlias = Bool[AnyArray, "*lanes"]
Unknowns: TypeAlias = Float[AnyArray, "*lanes unknowns"]
Triangles: TypeAlias = Float[AnyArray, "*lanes columns columns"]
_Carry: TypeAlias = tuple[AnyArray, AnyArray, AnyArray, AnyArray | np.bool_, AnyArray | int]
Flat = TypeVar("Flat", Array, np.ndarray)
Tree = TypeVar("Tree")


WORTHWHILE = 1e-3  # of the predicted decrease, for a step to be accepted
MOST_GROWTH = 5.0  # of the step size, from one step to the next
FIRST_DAMPING = 1e-2  # of the squared norms of the Jacobian's columns
LEAST_DAMPING = 1e-13  # of the same: keeps singular systems solvable
LARGEST_STEP_SIZE = FIRST_DAMPING / LEAST_DAMPING
MOST_OF_THE_WAY = 0.9  # to an edge, in one step
NEAR = 1e-3  # coordinates so near an edge may go all the way
AT_EDGE = 1e-6  # coordinates so near their lower bound end on it; also the distance to conditions
FIRM = 1e4  # weight of a limit of several coordinates, relative to the data; its square times rounding errors is small
ROUNDING = 500.0  # rounding errors of a sum of squares, in those of one number
SLACK = 1e-9  # beyond a limit, that is a rounding error: a limit of one coordinate may stand twice
WORTH = 0.1  # standard errors: a decrease that counts, where the damping begins anew
LEAST_SCALE = 1e-2  # of that before, where the damping begins anew: what the data hardly show would run away
LEAST_OF_LARGEST = 1e-7  # of the largest scale: what the data do not show at the start would run away too
PATIENCE = 30  # points tried without one
KINK = 0.01  # standard errors: a refused step that is predicted to gain less will only become shorter
TOGETHER = 5  # solutions of one step, after which one limit at a time is exchanged, which ends
MOST_SOLUTIONS = 30  # after which no coordinate leaves its limit any more


class Linearisation(NamedTuple):
    """A least-squares problem linearised at a point, or at one for each lane.

    Attributes:
        rows: the Jacobian with the residual as its last column, relative to the size of the data, or any rows with the
            same products of columns; a column for each unknown and one more.
        margins: by how much each condition between unknowns holds.
        margin_slopes: their derivatives by the unknowns.
        samples: number of residuals, for the tolerance in standard errors.
    """

    rows: Float[AnyArray, "... rows columns"]
    margins: Float[AnyArray, "... conditions"]
    margin_slopes: Float[AnyArray, "... conditions unknowns"]
    samples: AnyArray | int


class State(NamedTuple):
    """The accepted point with its linearised problem, and the point to be tried next, with the axes of the lanes."""

    trial: Unknowns  # the point to be tried
    triangle: Triangles  # of the rows of the accepted point
    scale: Unknowns  # of the damping: largest norms of the Jacobian's columns so far (MINPACK)
    conditions: Float[AnyArray, "*lanes conditions unknowns"]  # slopes of the conditions, of length one
    least: Float[AnyArray, "*lanes conditions"]  # of the conditions times a step
    step_size: EachLane  # inverse of the damping
    predicted: EachLane  # decrease of half the sum of squares at the point to be tried
    floor: EachLane  # of a decrease that counts
    short: LaneMask  # whether the step is shorter than the tolerances
    whole: LaneMask  # whether it is the step without damping
    steps: Int[AnyArray, "*lanes"]  # points tried
    converged: LaneMask  # whether the search has ended by its tolerance
    stuck: LaneMask  # whether there is no further step
    since: EachLane  # half the sum of squares at the last decrease that counts
    idle: Int[AnyArray, "*lanes"]  # points tried since
    improved: LaneMask  # whether there was one since the damping began, first or anew
    aux: PyTree  # what the residual gives beside its value at the accepted point


class _Proposal(NamedTuple):
    """A step with what decides whether the search would end by it."""

    step: Unknowns
    predicted: EachLane
    short: LaneMask
    small: LaneMask  # whether the search would end by it; true of one that is not finite


class Rules(NamedTuple):
    """Bounds as vectors, and the tolerances of a `BoundedLevenbergMarquardt`."""

    lower: Float[AnyArray, " unknowns"] | float
    upper: Float[AnyArray, " unknowns"] | float
    tolerance: float
    precision: float
    rtol: float
    atol: float
    patience: int | None


def _library(array: AnyArray) -> ModuleType:
    return np if isinstance(array, np.ndarray) else jnp


def at_edges(flat: Flat, rules: Rules) -> Flat:
    """The vector of unknowns with those very near their lower bound on it."""
    xp = _library(flat)
    return xp.where(xp.abs(flat - rules.lower) < AT_EDGE, rules.lower, flat)


def judged(xp: ModuleType, rules: Rules, state: State, here: Linearisation, aux: PyTree) -> tuple[LaneMask, State]:
    """Whether the point tried is accepted, and the state with its linearised problem if it is."""
    first, tried = state.steps == 0, _triangle(xp, here.rows)
    old, new = _half_squares(state.triangle), _half_squares(tried)
    finite = xp.all(xp.isfinite(tried), axis=(-2, -1))
    negligible = (state.predicted < state.floor) & (new - old < state.floor)
    ratio = (old - new) / xp.where(state.predicted > 0, state.predicted, 1.0)
    keeps_conditions = xp.all(here.margins > 0, axis=-1)
    accepted = first | (finite & keeps_conditions & (negligible | (ratio > WORTHWHILE)))
    # Beyond 2 the growth is at its limit; the cube of a huge ratio would overflow.
    growth = xp.maximum(1.0 / MOST_GROWTH, 1.0 - (2.0 * xp.clip(ratio, -1e6, 2.0) - 1.0) ** 3)
    divisor = xp.where(accepted, growth, xp.where(state.whole, 1.0, MOST_GROWTH))
    length = xp.sqrt(xp.sum(here.margin_slopes**2, axis=-1))
    length = xp.where(length > 0, length, 1.0)
    room = here.margins / length - AT_EDGE
    changed = {
        "triangle": tried,
        "scale": xp.maximum(state.scale, _norms(xp, tried)),
        "conditions": here.margin_slopes / length[..., None],
        "least": -xp.where(room > NEAR, MOST_OF_THE_WAY * room, room),
        "aux": aux,
    }
    chosen = {name: where(xp, accepted, value, getattr(state, name)) for name, value in changed.items()}
    step_size = xp.where(first, state.step_size, state.step_size / divisor)
    now, patience = _half_squares(chosen["triangle"]), rules.patience
    worth = state.floor if patience is not None else xp.maximum(state.floor, WORTH**2 / here.samples * now)
    gained = state.since - now >= worth
    idle, improved = xp.where(first | gained, 0, state.idle + 1), ~first & (state.improved | gained)
    blocked = state.short | ~accepted & (state.predicted < KINK**2 / here.samples * now)
    if patience is not None:
        ends = state.short | (idle >= patience) | (state.whole & ~gained)
        anew = xp.zeros_like(ends)
    else:
        ends = blocked | (idle >= PATIENCE)
        anew = ~first & ~negligible & ends & improved
    afresh = xp.maximum(_norms(xp, chosen["triangle"]), LEAST_SCALE * chosen["scale"])
    chosen["scale"] = xp.where(anew[..., None], afresh, chosen["scale"])
    changes = {
        "step_size": xp.where(anew, 1.0, step_size),
        "converged": ~first & (negligible | ends) & ~anew,
        "steps": state.steps + 1,
        "since": xp.where(first | gained, now, state.since),
        "idle": xp.where(anew, 0, idle),
        "improved": improved & ~anew,
    }
    return accepted, state._replace(**changes, **chosen)


def with_proposal(
    xp: ModuleType,
    rules: Rules,
    state: State,
    y: Unknowns,
    samples: AnyArray | int,
    accepted: LaneMask,
) -> State:
    """The state with the next point to be tried."""
    rounding = ROUNDING * rules.precision
    floor = xp.maximum(rounding, rules.tolerance**2 / samples) * _half_squares(state.triangle) + rounding**2
    limits = (rules.lower - y, rules.upper - y)
    lower, upper = (xp.where(xp.abs(a) > NEAR, MOST_OF_THE_WAY * a, a) for a in limits)

    def at(step_size: EachLane) -> _Proposal:
        step = _damped_step(xp, state, step_size, lower, upper)
        predicted = _decrease(state.triangle, step)
        short = xp.all(xp.abs(step) <= rules.atol + rules.rtol * xp.abs(y), axis=-1)
        return _Proposal(step, predicted, short, ~(predicted >= floor) | short)

    def longer(carry: tuple[AnyArray, AnyArray, _Proposal]) -> tuple[AnyArray, AnyArray, _Proposal]:
        size, again, proposal = carry
        size = xp.where(again, size * MOST_GROWTH, size)
        proposal = where(xp, again, at(size), proposal)
        return size, again & proposal.small & (size < LARGEST_STEP_SIZE), proposal

    size, proposal = state.step_size, at(state.step_size)
    again = ~accepted & state.whole & proposal.small & (size < LARGEST_STEP_SIZE)
    size, _, proposal = _while(xp, lambda carry: xp.any(carry[1]), longer, (size, again, proposal))
    whole, converged = accepted & proposal.small & ~state.converged, state.converged
    if xp is jnp or np.any(whole):
        undamped = at(xp.full_like(size, LARGEST_STEP_SIZE))
        converged = converged | (whole & undamped.small & (rules.patience is not None))
        whole = whole & ~undamped.small
        proposal = where(xp, whole, undamped, proposal)
    return state._replace(
        trial=y + proposal.step,
        step_size=size,
        predicted=proposal.predicted,
        floor=floor,
        short=proposal.short,
        whole=whole,
        converged=converged,
        stuck=~state.converged & ~xp.all(xp.isfinite(proposal.step), axis=-1),
    )


def where(xp: ModuleType, mask: LaneMask, new: Tree, old: Tree) -> Tree:
    """A tree with leaves of one or the other for each lane."""
    if xp is np and np.all(mask):
        return new
    if xp is np and not np.any(mask):
        return old

    def chosen(new: AnyArray, old: AnyArray) -> AnyArray:
        return xp.where(mask.reshape(mask.shape + (1,) * (new.ndim - mask.ndim)), new, old)

    return jtu.tree_map(chosen, new, old)


def _while(
    xp: ModuleType, condition: Callable[[Tree], AnyArray | np.bool_], body: Callable[[Tree], Tree], carry: Tree
) -> Tree:
    if xp is jnp:
        return jax.lax.while_loop(condition, body, carry)
    while condition(carry):
        carry = body(carry)
    return carry


def _triangle(xp: ModuleType, rows: Float[AnyArray, "*lanes rows columns"]) -> Triangles:
    """The triangle of rows, with as many rows as columns."""
    missing = max(rows.shape[-1] - rows.shape[-2], 0)
    rows = xp.concatenate([rows, xp.zeros((*rows.shape[:-2], missing, rows.shape[-1]), rows.dtype)], axis=-2)
    return xp.linalg.qr(rows, mode="r")


def _norms(xp: ModuleType, triangle: Triangles) -> Unknowns:
    """Of the columns of the Jacobian."""
    return xp.sqrt(xp.sum(triangle[..., :-1] ** 2, axis=-2))


def _half_squares(triangle: Triangles) -> EachLane:
    return 0.5 * (triangle[..., -1] ** 2).sum(axis=-1)


def _times(
    matrix: Float[AnyArray, "*lanes rows columns"], vector: Float[AnyArray, "*lanes columns"]
) -> Float[AnyArray, "*lanes rows"]:
    return (matrix @ vector[..., None])[..., 0]


def _decrease(triangle: Triangles, step: Unknowns) -> EachLane:
    """Predicted decrease of half the sum of squares over a step."""
    q = triangle[..., :-1, -1]
    return 0.5 * ((q**2).sum(axis=-1) - ((_times(triangle[..., :-1, :-1], step) + q) ** 2).sum(axis=-1))


def _damped_step(
    xp: ModuleType,
    state: State,
    step_size: EachLane,
    lower: Unknowns,
    upper: Unknowns,
) -> Unknowns:
    """Min ‖R d + q‖² + ‖D d‖² λ/step_size within limits of d and of C d; NaN where there is none.

    A coordinate that would leave its limits is put on the nearer one, one on a limit that the sum of squares pulls
    inside is set free, and the rest is solved again (block pivoting). Limits of C d are rows of a great weight.

    Source: L. F. Portugal, J. J. Júdice, L. N. Vicente, Mathematics of Computation 63, 1994.
    """
    n = state.scale.shape[-1]
    r, q, conditions = state.triangle[..., :n, :n], state.triangle[..., :n, n], state.conditions
    scale = xp.where(state.scale > 0, state.scale, 1.0)
    scale = xp.maximum(scale, LEAST_OF_LARGEST * xp.max(scale, axis=-1)[..., None])
    share = xp.maximum(FIRST_DAMPING / xp.maximum(step_size, jnp.finfo(scale.dtype).tiny), LEAST_DAMPING)
    damping = xp.sqrt(share)[..., None] * scale
    firm = FIRM * xp.maximum(xp.max(scale, axis=-1), 1.0)[..., None]
    low = xp.concatenate([xp.broadcast_to(lower, scale.shape), state.least], axis=-1)
    high = xp.concatenate([xp.broadcast_to(upper, scale.shape), xp.full_like(state.least, np.inf)], axis=-1)

    slack = SLACK * xp.where(xp.isfinite(low), 1.0 + xp.abs(low), 1.0)

    def solved(held: AnyArray, at: AnyArray) -> AnyArray:
        coordinates, rows, values = held[..., :n], held[..., n:], xp.where(held[..., :n], at[..., :n], 0.0)
        firmly = xp.where(rows, firm, 0.0)
        blocks = [
            xp.where(coordinates[..., None, :], 0.0, r),
            xp.eye(n, dtype=r.dtype) * xp.where(coordinates, 1.0, damping)[..., None],
        ]
        blocks += [xp.where(coordinates[..., None, :], 0.0, firmly[..., None] * conditions)]
        aims = [-q - _times(r, values), values, firmly * (at[..., n:] - _times(conditions, values))]
        matrix, target = xp.concatenate(blocks, axis=-2), xp.concatenate(aims, axis=-1)
        reduced = xp.linalg.qr(xp.concatenate([matrix, target[..., None]], axis=-1), mode="r")
        return _back_substituted(xp, reduced[..., :n, :n], reduced[..., :n, n])

    def pulled_inside(held: AnyArray, at: AnyArray, step: AnyArray) -> AnyArray:
        if xp is np and not np.any(held):
            return held
        beyond = xp.where(held[..., n:], _times(conditions, step) - at[..., n:], 0.0)
        pull = (_times(r, step) + q)[..., None, :] @ r + (firm**2 * beyond)[..., None, :] @ conditions
        pull = xp.concatenate([pull[..., 0, :] + damping**2 * step, -beyond], axis=-1)
        return held & (low < high) & ((at == low) & (pull < 0) | (at == high) & (pull > 0))

    def body(carry: _Carry) -> _Carry:
        held, at, _, _, solutions = carry
        step = solved(held, at)
        both = xp.concatenate([step, _times(conditions, step)], axis=-1)
        outside = ~held & ((both < low - slack) | (both > high + slack))
        change = outside | pulled_inside(held, at, step)
        last = change & (xp.cumsum(change[..., ::-1], axis=-1)[..., ::-1] == 1)
        change = xp.where(solutions < TOGETHER, change, xp.where(solutions < MOST_SOLUTIONS, last, outside))
        at = xp.where(outside, xp.clip(both, low, high), at)
        return held ^ change, at, step, xp.any(change), solutions + 1

    begin = (xp.zeros(low.shape, bool), xp.zeros(low.shape, low.dtype), xp.zeros_like(scale), xp.asarray(True), 0)
    return xp.clip(_while(xp, lambda carry: carry[3], body, begin)[2], lower, upper)


def _back_substituted(
    xp: ModuleType, triangle: Float[AnyArray, "*lanes unknowns unknowns"], right: Unknowns
) -> Unknowns:
    """X of R x = b; NaN where R is singular."""
    if xp is jnp:
        return jax.scipy.linalg.solve_triangular(triangle, right)
    regular = np.all(np.diagonal(triangle, axis1=-2, axis2=-1) != 0.0, axis=-1)[..., None, None]
    return np.linalg.solve(np.where(regular, triangle, np.nan), right[..., None])[..., 0]
