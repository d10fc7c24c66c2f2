"""Normally distributed motion: covariances behind a white road rate, and points for means over it."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxdamp._limits import at_least
from jaxdamp._matrices import phi_functions, solve
from jaxdamp._random import sobol_points


_TERMS = 14  # of series of which each term is at most half as large as the one before: their rest is below 1e-16
_DOUBLINGS = 51  # of the first interval, until nothing is left of the start
_SETTLED = 1e-6  # part of an integral that the second half of its interval may add


def lyapunov(a: Float[Array, "n n"], q: Float[Array, "n n"]) -> tuple[Float[Array, "n n"], Bool[Array, ""]]:
    """The solution P = ∫ e^{At} Q e^{Aᵀt} dt of A P + P Aᵀ + Q = 0 for a stable A, by doubling of the interval.

    The second value is whether the integral has an end: for an A that is not stable it still grows in the last step.

    Over a short interval h both P(h) = ∫ e^{As} Q e^{Aᵀs} ds and F(h) = e^{Ah} are Taylor series; then
    P(2h) = P(h) + F P(h) Fᵀ and F(2h) = F(h)². F is stored as E = F − 1, which is small at first: F itself would lose
    the slow motions to rounding. Differentiable; n³ operations a step.
    """
    size = jnp.abs(jax.lax.stop_gradient(a))
    first = 0.25 / at_least(jnp.maximum(jnp.max(jnp.sum(size, axis=0)), jnp.max(jnp.sum(size, axis=1))), 1e-30)
    short = a * first

    def nest(series: tuple[Array, Array], divisor: Array) -> tuple[tuple[Array, Array], None]:
        p, e = series
        return (q + (short @ p + p @ short.T) / divisor, short + short @ e / divisor), None

    (started, change), _ = jax.lax.scan(nest, (q, short), jnp.arange(_TERMS, 1.0, -1.0, dtype=a.dtype))

    def double(now: tuple[Array, Array, Array], _: None) -> tuple[tuple[Array, Array, Array], None]:
        p, e = now[:2]
        moved = p + e @ p
        return (p + moved + moved @ e.T, 2.0 * e + e @ e, p), None

    begin = first * started, change, first * started
    (p, _, before), _ = jax.lax.scan(double, begin, None, length=_DOUBLINGS)
    return p, jnp.max(jnp.abs(p - before)) <= _SETTLED * jnp.max(jnp.abs(p))


def channel_covariance(
    a: Float[Array, "n n"],
    c: Float[Array, "channels n"],
    pushes: Float[Array, "n wheels"],
    static: Float[Array, "channels wheels"],
    delays: Float[Array, " wheels"],
) -> tuple[Float[Array, "channels channels"], Bool[Array, ""]]:
    """∫ k kᵀ ds of the channels C ξ + D z_r, ξ̇ = A ξ + e ż_r: their covariance for a road rate of density one.

    k(s) is the response to an impulse of the road rate, the same road under one wheel after the other. While no wheel
    meets it, k is C times the matrix exponential of the state, plus a constant. The part after the last wheel follows
    from A X + X Aᵀ + x xᵀ = 0. The second value is whether the motion comes to an end, without which there is none.

    Arguments:
        a: A, stable.
        c: C.
        pushes: e, the jump of the state due to a unit step of the road under each wheel.
        static: D, the channels for unit height under each wheel.
        delays: of each wheel behind the first [s].
    """
    order = jnp.argsort(delays)
    times, pushes, static = delays[order], pushes[:, order], static[:, order]
    state, total = pushes[:, 0], jnp.zeros((c.shape[0], c.shape[0]))
    for i in range(1, times.size):
        gap = times[i] - times[i - 1]
        after = phi_functions(a * gap)[0] @ state
        # ∫ ξξᵀ over the interval: the integral from its start minus that from its end
        covariance, _ = lyapunov(a, jnp.outer(state, state) - jnp.outer(after, after))
        mean = c @ solve(a, after - state)
        offset = -jnp.sum(static[:, i:], axis=1)  # later wheels are still on the road before the impulse
        cross = jnp.outer(offset, mean)
        total = total + c @ covariance @ c.T + cross + cross.T + jnp.outer(offset, offset) * gap
        state = after + pushes[:, i]
    covariance, ends = lyapunov(a, jnp.outer(state, state))
    return total + c @ covariance @ c.T, ends


_REACH = 7.0  # standard deviations
_ON_EACH_SIDE, _WITH_OTHERS = 20, 12  # points of the first variable
_HERMITE = {1: 16, 2: 12}  # points of each further variable, by the number of these
_MANY = 256  # points of the further variables where a grid would be too large


@functools.cache
def gaussian_points(variables: int) -> tuple[Float[np.ndarray, "points variables"], Float[np.ndarray, " points"]]:
    """Points t and weights w with E[f] ≈ Σ w f(t) for independent standard normal variables.

    The first variable may have a kink or a steep slope at zero, as friction has in the velocity: Gauss-Legendre points
    on each side of zero, graded as u², so that E|t| has an error of 1e-6, also where the jump is spread over a
    thousandth of a standard deviation. One or two further variables have Gauss-Hermite points, more of them a Sobol
    sequence with its mirror image. Means, variances and correlations are exact.

    Arguments:
        variables: number of variables.
    """
    if variables == 0:
        return np.zeros((1, 0)), np.ones(1)
    first, weights = _one_with_kink(_ON_EACH_SIDE if variables == 1 else _WITH_OTHERS)
    if variables == 1:
        return first[:, None], weights
    others, their_weights = _others(variables - 1)
    points = np.concatenate([np.repeat(first, len(others))[:, None], np.tile(others, (len(first), 1))], axis=1)
    return points, np.outer(weights, their_weights).ravel()


def _one_with_kink(count: int) -> tuple[np.ndarray, np.ndarray]:
    u, share = np.polynomial.legendre.leggauss(count)
    u, share = 0.5 * (u + 1.0), 0.5 * share
    t = _REACH * u**2
    weights = share * u * np.exp(-0.5 * t**2)
    weights = 0.5 * weights / weights.sum()
    t /= np.sqrt(2.0 * np.sum(weights * t**2))
    return np.concatenate([-t[::-1], t]), np.concatenate([weights[::-1], weights])


def _others(variables: int) -> tuple[np.ndarray, np.ndarray]:
    if variables in _HERMITE:
        t, weights = np.polynomial.hermite_e.hermegauss(_HERMITE[variables])
        grid = np.stack(np.meshgrid(*[t] * variables, indexing="ij"), axis=-1).reshape(-1, variables)
        product = functools.reduce(np.multiply.outer, [weights] * variables).ravel()
        return grid, product / product.sum()
    import scipy.special

    half = scipy.special.ndtri(sobol_points(0, variables, 0, _MANY // 2))
    points = np.concatenate([half, -half])
    spread = np.linalg.cholesky(points.T @ points / len(points))
    return np.linalg.solve(spread, points.T).T, np.full(len(points), 1.0 / len(points))
