"""Roots with the derivatives of the implicit function theorem: of an increasing function, and of optimistix."""

from collections.abc import Callable
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jax.extend.core import ClosedJaxpr, jaxpr_as_fun
from jaxtyping import Array, Bool, PyTree

from jaxdamp._limits import at_most, between_numbers, within
from jaxdamp._matrices import solve
from jaxdamp._sharded import varying_as
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.configuration import target


NEWTON_STEPS, LEAST_SHARE = 40, 0.02  # of a search of two numbers, and the least share of a step
HALVINGS = 50  # of an interval


def increasing_root(
    function: Callable[[Scalar], Scalar],
    guess: Scalar,
    lower: Scalar,
    upper: Scalar,
    steps: int = 12,
    likely: int = 0,
    close: float | None = 1e-7,
) -> Scalar:
    """Solve function(w) = 0 by Newton steps kept inside a shrinking bracket.

    Newton's method is exact for piecewise-linear functions and converges quadratically for smooth ones. First there are
    `likely` plain steps. If the last of them is too long for any element of a batch, safe steps follow, which bisect
    the bracket where Newton would leave it or has not halved the residual in two steps (as in cycles about a kink).
    With the default `close`, a dozen steps reach rounding errors for power laws, friction and kinked laws in series
    with springs of 1e5 to 1.5e7 N/m at 1 ms, from any guess. Forward and reverse derivatives come from the implicit
    function theorem and do not pass through the steps. (Second derivatives, forward over reverse in a loop, do if the
    plain steps were enough, and are then accurate to `close`.)

    Arguments:
        function: increasing on the bracket.
        guess: a first value inside the bracket.
        lower: where the function is not positive.
        upper: where the function is not negative.
        steps: largest number of safe steps.
        likely: number of plain Newton steps that are likely to be enough for a good guess; 0 for safe steps only.
        close: relative length of the last step; the remaining error is about its square. None takes all safe steps, so
            that the loop of a batch has no end of its own for each element, which printed programs do not have.
    """
    closed = jax.make_jaxpr(function)(guess)  # once: it is called by the steps and by each of the derivatives

    def called(w: Scalar, constants: list[Array]) -> Scalar:
        return jaxpr_as_fun(ClosedJaxpr(closed.jaxpr, constants))(w)[0]

    def newton(w: Scalar, constants: list[Array]) -> tuple[Scalar, Scalar, Scalar]:
        value, slope = jax.jvp(lambda w: called(w, constants), (w,), (jnp.ones_like(w),))
        return value, slope, w - value / jnp.where(slope > 0, slope, 1.0)

    def safe_step(constants: list[Array], now: tuple[Scalar, ...]) -> tuple[Scalar, tuple[Scalar, ...]]:
        w, low, high, last, before_last = now
        value, slope, ahead = newton(w, constants)
        low = jnp.where(value <= 0, w, low)
        high = jnp.where(value >= 0, w, high)
        stalled = jnp.abs(value) > 0.5 * before_last
        inside = (ahead >= low) & (ahead <= high)
        # At the root, rounding may lead out of the bracket; a bisection could then be far from the root.
        small = jnp.abs(ahead - w) <= 1e-6 * (high - low)
        good = (slope > 0) & (small | (inside & ~stalled))
        return jnp.where(good, ahead, 0.5 * (low + high)), (low, high, jnp.abs(value), last)

    # Its own root to the derivatives: second ones in reverse mode come here, see `jaxdamp._elementary`.
    differentiable_step = _implicit_root(called, safe_step)

    def solved(constants: list[Array], bracket: tuple[Scalar, ...]) -> tuple[Scalar, tuple[()]]:
        w, low, high = bracket
        never = jnp.full_like(w, jnp.inf)
        least, near = close or 0.0, 1e-16 * (high - low)

        def moved(old: Scalar, new: Scalar) -> Bool[Array, ""]:
            return jnp.abs(new - old) > least * jnp.abs(new) + near

        def going(now: PyTree) -> Bool[Array, ""]:
            count, still_moving, _ = now
            return count < steps if close is None else still_moving & (count < steps)

        def again(now: PyTree) -> PyTree:
            count, _, before = now
            after, residual = differentiable_step(constants, before)
            return count + 1, moved(before[0], after), (after, *residual)

        start = jnp.ones_like(w, bool)
        for _ in range(likely if target().fused_loops else 0):  # written out they are fast, but take longer to compile
            before, w = w, between_numbers(newton(w, constants)[2], low, high)
            start = moved(before, w)
        begin = varying_as((0, start, (w, low, high, never, never)))
        return jax.lax.while_loop(going, again, begin)[2][0], ()

    return _implicit_root(called, solved)(closed.consts, jax.lax.stop_gradient((guess, lower, upper)))[0]


def _implicit_root(
    function: Callable[[Scalar, list[Array]], Scalar],
    solve: Callable[[list[Array], tuple[Scalar, ...]], tuple[Scalar, tuple[Scalar, ...]]],
) -> Callable[[list[Array], tuple[Scalar, ...]], tuple[Scalar, tuple[Scalar, ...]]]:
    """A solver of function(w, c) = 0 with ∂w/∂c = −(∂f/∂c)/(∂f/∂w), and none by where it starts.

    As `jax.lax.custom_root`, which traces the function five times, also where nothing is differentiated: a root inside
    the function of another one is then traced 25 times.
    """
    root = jax.custom_jvp(solve)

    @root.defjvp
    def _(primals: PyTree, tangents: PyTree) -> PyTree:
        constants, begin = primals
        w, others = root(constants, begin)
        _, change = jax.jvp(lambda constants: function(w, constants), (constants,), (tangents[0],))
        _, slope = jax.jvp(lambda w: function(w, constants), (w,), (jnp.ones_like(w),))
        # a product for each tangent, since quotients are slow
        return (w, others), (-(change * (1.0 / slope)), jax.tree.map(jnp.zeros_like, others))

    return root


Pair = tuple[Scalar, Scalar]


class At(NamedTuple):
    """Where a search of two numbers stands: the numbers, what is missing there, and the inverse of its slopes."""

    roots: Pair
    missing: Pair
    inverse: tuple[Pair, Pair]

    def step(self, missing: Pair) -> Pair:
        """The step of Newton's method by these slopes."""
        (aa, ab), (ba, bb) = self.inverse
        return -(aa * missing[0] + ab * missing[1]), -(ba * missing[0] + bb * missing[1])


def _at(function: Callable[[Pair], Pair], roots: Pair) -> At:
    one, zero = jnp.ones_like(roots[0]), jnp.zeros_like(roots[0])
    missing, (f_a, g_a) = jax.jvp(function, (roots,), ((one, zero),))
    _, (f_b, g_b) = jax.jvp(function, (roots,), ((zero, one),))
    return At(roots, missing, _inverse(f_a, f_b, g_a, g_b))


def _inverse(f_a: Scalar, f_b: Scalar, g_a: Scalar, g_b: Scalar) -> tuple[Pair, Pair]:
    share = 1.0 / (f_a * g_b - f_b * g_a)
    return (g_b * share, -f_b * share), (-g_a * share, f_a * share)


def newton_of_two(function: Callable[[Pair], Pair], roots: Pair) -> Pair:
    """Where Newton's method for two functions of two numbers goes from there."""
    at = _at(function, roots)
    step = at.step(at.missing)
    return roots[0] + step[0], roots[1] + step[1]


class _Search(NamedTuple):
    """Steps of a search of two numbers of at most `most`."""

    function: Callable[[Pair], Pair]
    most: Pair
    close: float  # relative length of the last step; what remains is about its square

    def ahead(self, roots: Pair, step: Pair, share: ScalarLike) -> Pair:
        """A share of the step away, within the limits."""
        a, b = (within(r + share * s, -m, m) for r, s, m in zip(roots, step, self.most, strict=True))
        return a, b

    def far(self, at: At) -> Bool[Array, ""]:
        """Whether the next step is not short; not so where there is no number, which no search mends."""
        long = [
            jnp.abs(s) > self.close * (jnp.abs(r) + 1e-3 * m)
            for s, r, m in zip(at.step(at.missing), at.roots, self.most, strict=True)
        ]
        return long[0] | long[1]

    def newton(self, now: PyTree) -> PyTree:
        """A share of a step of Newton's method; a lesser one next time, from the same place, if it is too long."""
        count, at, share = now
        step = at.step(at.missing)
        there = _at(self.function, self.ahead(at.roots, step, share))
        before, after = (jnp.maximum(*map(jnp.abs, s)) for s in (step, at.step(there.missing)))
        good = (count == 0) | (after <= (1.0 - 0.25 * share) * before) | (share < LEAST_SHARE)
        at = jax.tree.map(lambda new, old: jnp.where(good, new, old), there, at)
        return count + 1, at, jnp.where(good, at_most(2.0 * share, 1.0), 0.4 * share)

    def halve(self, now: PyTree) -> PyTree:
        """Half the interval of b, by the a at its middle, whose interval is halved until it is a number."""
        count, _, low, high = now
        b = 0.5 * (low + high)

        def halve_a(now: PyTree) -> PyTree:
            count, low, high = now
            a = 0.5 * (low + high)
            above = self.function((a, b))[0] > 0.0
            return count + 1, jnp.where(above, low, a), jnp.where(above, a, high)

        begin = varying_as((0, -self.most[0], self.most[0]))
        _, below, above = jax.lax.while_loop(lambda now: now[0] < HALVINGS, halve_a, begin)
        at = _at(self.function, (0.5 * (below + above), b))
        positive = at.missing[1] > 0.0
        return count + 1, at, jnp.where(positive, low, b), jnp.where(positive, b, high)


def root_of_two(function: Callable[[Pair], Pair], guess: Pair, most: Pair) -> Pair:
    """Solve f(a, b) = 0 and g(a, b) = 0 with |a| and |b| of at most `most`.

    Newton's method, with steps so short that a step by the same slopes from their end is shorter than they are (the
    natural monotonicity test of Deuflhard, Newton Methods for Nonlinear Problems, 2004, section 3.3). Where that ends
    nowhere, as it can between kinks, the interval of b is halved, and for each b that of a. Derivatives as of
    `increasing_root`. The last step is a plain one, so that second derivatives that pass through the search are right.

    Arguments:
        function: (a, b) to (f, g); f increases with a, and g with b along f = 0.
        guess: first values.
        most: limits of both, of either sign.
    """

    def solve(f: Callable[[Pair], Pair], roots: Pair) -> Pair:
        search = _Search(f, jax.lax.stop_gradient(most), max(1e-7, float(jnp.finfo(roots[0].dtype).eps) ** 0.5))
        zero, one = jnp.zeros_like(roots[0]), jnp.ones_like(roots[0])
        nothing = (zero, zero)
        begin = 0, At(search.ahead(roots, nothing, 0.0), nothing, (nothing, nothing)), one

        def going(now: PyTree) -> Bool[Array, ""]:
            return (now[0] == 0) | (search.far(now[1]) & (now[0] < NEWTON_STEPS))

        at = jax.lax.while_loop(going, search.newton, varying_as(begin))[1]
        lost = search.far(at)
        low, high = -search.most[1], search.most[1]
        at = jax.lax.while_loop(lambda now: lost & (now[0] < HALVINGS), search.halve, varying_as((0, at, low, high)))[1]
        return search.ahead(at.roots, at.step(at.missing), 1.0)

    def tangent_solve(linear: Callable[[Pair], Pair], value: Pair) -> Pair:
        one, zero = jnp.ones_like(value[0]), jnp.zeros_like(value[0])
        (f_a, g_a), (f_b, g_b) = linear((one, zero)), linear((zero, one))
        (aa, ab), (ba, bb) = _inverse(f_a, f_b, g_a, g_b)
        return aa * value[0] + ab * value[1], ba * value[0] + bb * value[1]

    return jax.lax.custom_root(function, jax.lax.stop_gradient(guess), solve, tangent_solve)


@final
class ImplicitDerivatives(optx.AbstractAdjoint):
    """`optimistix.ImplicitAdjoint` for a few unknowns in one array, of vehicles that run side by side.

    The linear system of the derivative is solved by elimination, without the routines of LAPACK (`jaxdamp._matrices`
    says why) and without the host callback by which lineax reports a singular matrix; the derivative is then NaN.
    """

    def apply(self, primal_fn: PyTree, rewrite_fn: PyTree, inputs: PyTree, tags: frozenset[object]) -> PyTree:
        """The solution of the solver, with derivatives of any order, forward and reverse."""
        del tags
        return _implicit(primal_fn, rewrite_fn, (*inputs, _while_loop))


def _while_loop(going: PyTree, step: PyTree, begin: PyTree, *, max_steps: int) -> PyTree:
    """A loop of at most so many steps."""

    def both(now: tuple[Array, PyTree]) -> tuple[Array, PyTree]:
        return now[0] + 1, step(now[1])

    start = jnp.zeros((), int), varying_as(begin)
    return jax.lax.while_loop(lambda now: going(now[1]) & (now[0] < max_steps), both, start)[1]


@eqx.filter_custom_jvp
def _implicit(primal_fn: PyTree, rewrite_fn: PyTree, inputs: PyTree) -> PyTree:
    del rewrite_fn
    return jax.tree.map(jnp.asarray, primal_fn(inputs))


@_implicit.def_jvp
def _implicit_jvp(primals: PyTree, tangents: PyTree) -> PyTree:
    primal_fn, rewrite_fn, inputs = primals
    root, others = _implicit(primal_fn, rewrite_fn, inputs)
    fixed, moving = eqx.partition(inputs, jax.tree.map(lambda t: t is None, tangents[2], is_leaf=lambda t: t is None))

    def missing(moving: PyTree) -> Array:
        return rewrite_fn(root, others, eqx.combine(moving, fixed))

    _, change = jax.jvp(missing, (moving,), (tangents[2],))
    slopes = jax.jacfwd(lambda root: rewrite_fn(root, others, inputs))(root)
    return (root, others), (-solve(slopes, change), jax.tree.map(lambda _: None, others))
