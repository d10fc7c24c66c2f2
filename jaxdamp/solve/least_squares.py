"""Levenberg-Marquardt within bounds and conditions, as a solver of optimistix.

The rules of a step are written once, over NumPy or `jax.numpy`. A fit runs them in NumPy by a loop on the host
(`least_squares_on_host`): only the residual and its Jacobian are compiled, since the algebra of a step, which is small,
takes longer to compile than the forces of most laws. `optimistix.least_squares` runs them inside a JAX program.
"""

from collections.abc import Callable
from types import ModuleType
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import lineax as lx
import numpy as np
import optimistix as optx
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, Int, PyTree

from jaxdamp import _checks
from jaxdamp._jacobian import with_jacobian
from jaxdamp._status import Status
from jaxdamp._triangles import triangle
from jaxdamp._types import ScalarLike
from jaxdamp.solve.damped_steps import (
    AT_EDGE,
    Linearisation,
    Rules,
    State,
    at_edges,
    judged,
    where,
    with_proposal,
)


class BoundedLevenbergMarquardt(optx.AbstractLeastSquaresSolver):
    """Least squares within bounds and conditions between the unknowns.

    Nielsen's rule for the damping 1/step_size, by the ratio of actual to predicted decrease. A step whose predicted
    decrease is less than `tolerance` standard errors, or below rounding errors, is accepted and ends the search; if
    refused, it would only become shorter and shorter. A step shorter than `rtol` and `atol` also ends the search: kinks
    of a residual are kinks of the sum of squares, near which the predicted decrease is wrong. There, and after thirty
    points that gained less than a tenth of a standard error, the damping begins anew, until that gains no more. A step
    that violates a condition is refused. The damping holds back what the data hardly determine, so that a step is small
    far from the minimum too: before the search ends by a small step, the whole step, without damping, is tried, and if
    it is refused, the most damped one that is not small.

    Towards an edge that is not near, a step goes at most nine tenths of the way, since many models degenerate at their
    edges. Conditions are edges too, linearised at each accepted point. A step is the best within these limits, by block
    pivoting, solved by orthogonal triangles, so that unknowns which the data hardly tell apart lose no digits to
    products of the Jacobian.

    Unknowns should be numbers of order one, as those of `jaxdamp.parameters.Coordinates` are. For use by
    `optimistix.least_squares`, under `jax.jit`, `jax.vmap` and derivatives; `adjoint=ImplicitWithinBounds()` gives
    right derivatives where an unknown is at a bound. Every step evaluates the residual and its Jacobian once, in
    forward mode, and the first one those of the start.

    Sources: K. Madsen, H. B. Nielsen, O. Tingleff, Methods for non-linear least squares problems, IMM 2004; J. J. Moré,
    The Levenberg-Marquardt algorithm: implementation and theory, 1978, for the scales of the damping.

    Attributes:
        lower: lower bounds, one number or a tree like the unknowns.
        upper: upper bounds.
        conditions: unknowns → vector of numbers that must stay positive; None for none.
        tolerance: length of the last step, in standard errors of the unknowns.
        level: size of the data in the units of the residual, root of the sum of squares, below whose rounding errors
            there is nothing left to explain.
        precision: relative rounding error of the residual; that of the type of the unknowns if left out.
        rtol: largest step that counts as short, relative to each unknown.
        atol: the same added to it.
        patience: points tried in a row without a decrease worth a step of `tolerance`, after which a search ends too,
            as it does if the whole step gains nothing, or no step promises such a decrease, which is then not tried;
            None for no such ends.
        norm: the largest of all unknowns decides whether a step is short.

    >>> time = jnp.linspace(0.0, 2.0, 50)
    >>> misses = lambda y, data: y[0] * jnp.exp(-y[1] * time) - data
    >>> solver = BoundedLevenbergMarquardt(lower=0.0, upper=jnp.array([10.0, 1.2]))
    >>> found = optx.least_squares(misses, solver, jnp.ones(2), 3.0 * jnp.exp(-1.5 * time))
    >>> found.value.round(3).tolist(), int(found.stats["num_steps"]) < 12
    ([2.692, 1.2], True)
    """

    lower: PyTree = -np.inf
    upper: PyTree = np.inf
    conditions: Callable[[PyTree], Array] | None = None
    tolerance: float = 1e-4
    level: ScalarLike = 1.0
    precision: float | None = None
    rtol: float = 1e-6
    atol: float = 1e-9
    patience: int | None = None
    norm: Callable[[PyTree], Array] = optx.max_norm

    def __check_init__(self) -> None:
        lower, upper = (jtu.tree_leaves(side) for side in (self.lower, self.upper))
        if 1 in (len(lower), len(upper)):
            lower, upper = lower * len(upper), upper * len(lower)
        for low, high in zip(lower, upper, strict=False):
            ends = _checks.concrete(low), _checks.concrete(high)
            if ends[0] is not None and ends[1] is not None and np.any(ends[0] > ends[1]):
                _checks.refuse("lower", "be at most `upper`", f"{low} above {high}")

    def init(
        self,
        fn: Callable,
        y: PyTree,
        args: PyTree,
        options: dict,
        f_struct: PyTree,
        aux_struct: PyTree,
        tags: frozenset,
    ) -> State:
        """The state before the start has been evaluated."""
        if "linearise" in options:
            xp, flat, conditions, aux = np, y, 0, None
        else:
            xp, (flat, _) = jnp, ravel_pytree(y)
            conditions = 0 if self.conditions is None else jax.eval_shape(self.conditions, y).size
            aux = jtu.tree_map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), aux_struct)
        rules = rules_of(self, xp, y)
        lanes, (n,), kind = flat.shape[:-1], flat.shape[-1:], flat.dtype
        zeros, no = xp.zeros(lanes, kind), xp.zeros(lanes, bool)
        return State(
            trial=xp.clip(flat, rules.lower, rules.upper),
            triangle=xp.zeros((*lanes, n + 1, n + 1), kind),
            scale=xp.zeros((*lanes, n), kind),
            conditions=xp.zeros((*lanes, conditions, n), kind),
            least=xp.zeros((*lanes, conditions), kind),
            step_size=xp.ones(lanes, kind),
            predicted=zeros,
            floor=zeros,
            short=no,
            whole=no,
            steps=xp.zeros(lanes, int),
            converged=no,
            stuck=no,
            since=zeros,
            idle=xp.zeros(lanes, int),
            improved=no,
            aux=aux,
        )

    def step(
        self, fn: Callable, y: PyTree, args: PyTree, options: dict, state: State, tags: frozenset
    ) -> tuple[PyTree, State, PyTree]:
        """Evaluate the point to be tried, accept or refuse it, and choose the next."""
        if "linearise" in options:
            xp, flat, unravel = np, y, lambda flat: flat
            here, aux = options["linearise"](state.trial, args)
        else:
            xp, (flat, unravel) = jnp, ravel_pytree(y)
            here, aux = _linearised(self, lambda flat: fn(unravel(flat), args), jnp.asarray(state.trial), unravel)
        rules = rules_of(self, xp, y)
        accepted, state = judged(xp, rules, state, here, aux)
        point: PyTree = where(xp, accepted, state.trial, flat)
        state = with_proposal(xp, rules, state, point, here.samples, accepted)
        return unravel(point), state, state.aux

    def terminate(
        self, fn: Callable, y: PyTree, args: PyTree, options: dict, state: State, tags: frozenset
    ) -> tuple[PyTree, optx.RESULTS]:
        """Whether a search has ended, by its tolerance or because there is no step."""
        done = state.converged | state.stuck
        if "linearise" in options:
            return done, optx.RESULTS.successful
        return done, optx.RESULTS.where(state.stuck, optx.RESULTS.nonfinite, optx.RESULTS.successful)

    def postprocess(
        self,
        fn: Callable,
        y: PyTree,
        aux: PyTree,
        args: PyTree,
        options: dict,
        state: State,
        tags: frozenset,
        result: optx.RESULTS,
    ) -> tuple[PyTree, PyTree, dict[str, object]]:
        """Unknowns very near their lower bound end on it."""
        flat, unravel = ravel_pytree(y)
        return unravel(at_edges(flat, rules_of(self, jnp, y))), aux, {}


class ImplicitWithinBounds(optx.AbstractAdjoint):
    """Derivatives of a least-squares solution by the implicit function theorem, with unknowns at bounds held there.

    `optimistix.ImplicitAdjoint` takes the gradient as zero for all unknowns, which it is not for one at a bound. Where
    a condition of a `BoundedLevenbergMarquardt` holds the solution back, the derivatives are not a number.

    Attributes:
        linear_solver: for the matrix of second derivatives.
    """

    linear_solver: lx.AbstractLinearSolver = lx.AutoLinearSolver(well_posed=None)

    def apply(self, primal_fn: Callable, rewrite_fn: Callable, inputs: PyTree, tags: frozenset) -> PyTree:
        """The solution, with these derivatives in place of those of the loop."""
        return optx.ImplicitAdjoint(self.linear_solver).apply(primal_fn, _pull_within_bounds, inputs, tags)


def _pull_within_bounds(optimum: PyTree, _: PyTree, inputs: PyTree) -> PyTree:
    """What is zero at the solution: the gradient, or the distance from a bound."""
    fn, solver, _, args, *_ = inputs
    flat, unravel = ravel_pytree(optimum)
    # forwards, as in the search: the unknowns are few
    missed, jacobian = with_jacobian(lambda flat: ravel_pytree(fn(unravel(flat), args)[0])[0])(flat)
    pull = missed @ jacobian
    if isinstance(solver, BoundedLevenbergMarquardt):
        lower, upper, *_ = rules_of(solver, jnp, optimum)
        pull = jnp.where(flat - lower < AT_EDGE, flat - lower, jnp.where(upper - flat < AT_EDGE, flat - upper, pull))
        if solver.conditions is not None:
            pull = jnp.where(jnp.all(solver.conditions(optimum) > 2 * AT_EDGE), pull, jnp.nan * flat)
    return unravel(pull)


def rules_of(solver: BoundedLevenbergMarquardt, xp: ModuleType, like: PyTree) -> Rules:
    """The rules of a solver, with its bounds as vectors like some unknowns."""
    if xp is np:
        lower, upper = solver.lower, solver.upper
        dtype = like.dtype
    else:
        flat, _ = ravel_pytree(like)
        same, dtype = jtu.tree_structure(like), flat.dtype

        def vector(side: PyTree) -> Array:
            if jtu.tree_structure(side) != same:
                return jnp.broadcast_to(jnp.asarray(side, dtype), flat.shape)
            leaves = jtu.tree_map(lambda bound, leaf: jnp.broadcast_to(bound, jnp.shape(leaf)), side, like)
            return ravel_pytree(leaves)[0].astype(dtype)

        lower, upper = vector(solver.lower), vector(solver.upper)
    precision = solver.precision or float(jnp.finfo(dtype).eps)
    return Rules(lower, upper, solver.tolerance, precision, solver.rtol, solver.atol, solver.patience)


def _linearised(
    solver: BoundedLevenbergMarquardt,
    fn: Callable[[Array], PyTree],
    flat: Array,
    unravel: Callable[[Array], PyTree],
) -> tuple[Linearisation, PyTree]:
    """The problem at a point, inside JAX."""

    def residual(flat: Array) -> tuple[Array, PyTree]:
        missed, aux = fn(flat)
        missed = ravel_pytree(missed)[0]
        return missed, (missed, aux)

    jacobian, (missed, aux) = jax.jacfwd(residual, has_aux=True)(flat)
    rows = triangle(jnp.concatenate([jacobian, missed[:, None]], axis=1) / solver.level)
    conditions = solver.conditions
    if conditions is None:
        none = jnp.zeros((0, flat.size), flat.dtype)
        return Linearisation(rows, none[:, 0], none, missed.size), aux
    margins, slopes = with_jacobian(lambda flat: conditions(unravel(flat)))(flat)
    return Linearisation(rows, margins, slopes, missed.size), aux


Linearise = Callable[[Float[np.ndarray, "some unknowns"], Int[np.ndarray, " some"]], tuple[Linearisation, PyTree]]


class SearchLanes(NamedTuple):
    """Where and how the searches of all lanes ended.

    Attributes:
        y: the unknowns, shape (lanes, unknowns).
        aux: what the linearisation gave beside itself at these points, arrays with the lanes as first axis.
        status: how each ended.
        steps: points tried in each, the start among them.
    """

    y: Float[np.ndarray, "lanes unknowns"]
    aux: PyTree
    status: list[Status]
    steps: Int[np.ndarray, " lanes"]

    def of(self, lanes: Int[np.ndarray, " some"]) -> "SearchLanes":
        """Those of some lanes."""
        aux = jtu.tree_map(lambda leaf: leaf[lanes], self.aux)
        return SearchLanes(self.y[lanes], aux, [self.status[i] for i in lanes], self.steps[lanes])


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # points without finite residuals are refused as steps
def least_squares_on_host(
    linearise: Linearise,
    solver: BoundedLevenbergMarquardt,
    start: Float[np.ndarray, "lanes unknowns"],
    max_steps: int,
) -> SearchLanes:
    """Minimise the sums of squares of one or many problems side by side; each ends by itself.

    Lanes that have ended are not computed any more. An interrupt ends the loop between two evaluations.

    Arguments:
        linearise: `(points, lanes) -> (linearisation, aux)` of some lanes at these points, arrays of NumPy with the
            lanes as first axis; rows relative to the size of the data of each lane.
        solver: with bounds common to all lanes, and the precision of the residuals.
        start: unknowns to start from.
        max_steps: largest number of points tried in each lane, including the start.
    """
    options, none = {"linearise": linearise}, frozenset[object]()
    y = np.array(start, np.float64)
    state = solver.init(linearise, y, None, options, None, None, none)
    y = np.asarray(state.trial)
    step, terminate = solver.step, solver.terminate  # equinox binds a method anew whenever it is named
    while True:
        ended, _ = terminate(linearise, y, None, options, state, none)
        lanes = np.flatnonzero(~ended & (state.steps < max_steps))
        if not lanes.size:
            break
        if lanes.size == len(y):
            y, state, _ = step(linearise, y, lanes, options, state, none)
            continue
        some = jtu.tree_map(lambda leaf: leaf[lanes], state)  # noqa: B023
        some_y, some, _ = step(linearise, y[lanes], lanes, options, some, none)
        y, state = _put(lanes, (some_y, some), (y, state))
    edged = at_edges(y, rules_of(solver, np, y))
    lanes = np.flatnonzero(np.any(edged != y, axis=1))
    aux = state.aux
    if lanes.size:
        y, aux = edged, _put(lanes, linearise(edged[lanes], lanes)[1], aux)
    status = map(_status, state.converged, state.stuck)
    return SearchLanes(y, aux, list(status), np.asarray(state.steps))


def _put(lanes: Int[np.ndarray, " some"], some: PyTree, tree: PyTree) -> PyTree:
    """A tree with the leaves of some lanes replaced."""

    def replaced(part: np.ndarray, leaf: np.ndarray) -> np.ndarray:
        leaf = leaf.copy()
        leaf[lanes] = part
        return leaf

    return jtu.tree_map(replaced, some, tree)


def _status(converged: bool | np.bool_, stuck: bool | np.bool_) -> Status:
    return Status.CONVERGED if converged else Status.NO_STEP if stuck else Status.STEP_LIMIT
