"""Stationary response of the linearised vehicle to a road whose rate is white noise."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import at_least, root
from jaxdamp._matrices import phi_functions, solve
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.linear import LinearVehicle, as_linear


_DOUBLINGS = 50  # of the first interval, until nothing is left of the start


def lyapunov(a: Float[Array, "n n"], q: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """The solution P = ∫ e^{At} Q e^{Aᵀt} dt of A P + P Aᵀ + Q = 0 for a stable A, by doubling of the interval.

    The first interval h ends where the exponential of the matrix [[−A, Q], [0, Aᵀ]] h is a short series; then
    P(2h) = P(h) + F P(h) Fᵀ and F(2h) = F(h)², F = e^{Ah}. F is stored as E = F − 1, which is small at first: F itself
    would lose the slow motions to rounding. Differentiable; n³ operations a step.
    """
    n = a.shape[0]
    first, scale = (0.5 / at_least(jax.lax.stop_gradient(jnp.max(jnp.sum(jnp.abs(m), axis=0))), 1e-30) for m in (a, q))
    whole = jnp.block([[-a * first, q * scale], [jnp.zeros_like(a), a.T * first]])
    grown = whole @ phi_functions(whole)[1]  # its exponential, minus one
    change = grown[n:, n:].T

    def double(now: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], None]:
        p, e = now
        moved = p + e @ p
        return (p + moved + moved @ e.T, 2.0 * e + e @ e), None

    begun = grown[:n, n:] * (first / scale)
    (found, _), _ = jax.lax.scan(double, (begun + change @ begun, change), None, length=_DOUBLINGS)
    return found


def stationary_rms(
    vehicle: AbstractVehicle | LinearVehicle,
    velocity_psd: ScalarLike = 1.0,
    *,
    speed: ScalarLike | int | None = None,
    in_phase: bool = False,
) -> dict[str, Scalar]:
    """RMS of every channel of the linearised vehicle on a road whose rate is white noise.

    All wheels run on the same road: with a `speed` one axle after the other, so that their motions are correlated, or
    `in_phase`. A channel is y(t) = ∫ k(s) u(t − s) ds with the white rate u of the road, and its mean square S ∫ k² ds
    is computed exactly, from axle to axle: while no wheel meets the impulse, k is a row times the matrix exponential of
    the state, plus a constant. The part after the last axle follows from A X + X Aᵀ + x xᵀ = 0. Differentiable in every
    parameter and in the speed.

    Channels that contain the white noise itself (the tyre load, if there is tyre damping) have an infinite RMS,
    returned as `inf`. Absolute heights (`z_…`) have no finite RMS; the returned ones are relative to the road under the
    front axle.

    Arguments:
        vehicle: a vehicle, linearised about rest, or what `linearise` made of it.
        velocity_psd: two-sided power spectral density S of the rate of the height [(m/s)²/Hz]; for an ISO 8608 road of
            waviness 2 it is 2π² G_d(n₀) n₀² V (`roads.white`).
        speed: of the vehicle [m/s]; not needed for a single axle.
        in_phase: the road is under all axles at once, instead of a speed.

    Returns:
        RMS of each channel by name, in the unit of the channel.

    Raises:
        ValueError: a density or a speed that is not positive, several axles with neither `speed` nor `in_phase`, or
            with both; a vehicle that does not come to rest.

    Source: for the quarter car, closed forms exist (see the tests).

    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> round(float(stationary_rms(quarter_car_000())["sprung_acceleration"]) ** 2, 3)
    853.472
    """
    _checks.positive("velocity_psd", velocity_psd)
    linear = as_linear(vehicle)
    matrix = _checks.concrete(linear.state_matrix)
    if matrix is not None and np.max(np.linalg.eigvals(matrix).real) > -1e-9 * np.abs(matrix).max():
        remedy = (
            "Friction models such as Dahl, LuGre and Bouc-Wen have an undamped state for small motion: pass "
            "`linearise(vehicle, amplitude=0.02, frequency=1.2)`."
        )
        _checks.refuse("vehicle", "come to rest when linearised", "one that does not", remedy)
    rms = root(velocity_psd * _mean_squares(linear, linear.delays(speed, in_phase)))
    return {name: rms[i] for i, name in enumerate(linear.channels)}


@eqx.filter_jit
def _mean_squares(linear: LinearVehicle, delays: Float[Array, " wheels"]) -> Float[Array, " channels"]:
    """∫ k² ds of every channel, `inf` if it contains the white noise."""
    a, c, settled = linear.state_matrix, linear.output, linear.settled()
    # ξ = x − settled z_r obeys ξ̇ = A ξ + (E − settled) ż_r; channels are C ξ + (C settled + D) z_r + F ż_r
    order = jnp.argsort(delays)
    times, pushes = delays[order], (linear.road_rate_input - settled)[:, order]
    static = (c @ settled + linear.road_feed)[:, order]

    def of_channels(covariance: Float[Array, "n n"]) -> Float[Array, " channels"]:
        return jnp.sum((c @ covariance) * c, axis=1)

    state, total = pushes[:, 0], jnp.zeros(c.shape[0])
    for i in range(1, times.size):
        gap = times[i] - times[i - 1]
        after = phi_functions(a * gap)[0] @ state
        # ∫ ξξᵀ over the interval: the integral from its start minus that from its end
        covariance = lyapunov(a, jnp.outer(state, state) - jnp.outer(after, after))
        mean = c @ solve(a, after - state)
        offset = -jnp.sum(static[:, i:], axis=1)  # later wheels are still on the road before the impulse
        total = total + of_channels(covariance) + 2.0 * offset * mean + offset**2 * gap
        state = after + pushes[:, i]
    total = at_least(total + of_channels(lyapunov(a, jnp.outer(state, state))), 0.0)
    return jnp.where(jnp.any(linear.feed_through != 0, axis=1), jnp.inf, total)
