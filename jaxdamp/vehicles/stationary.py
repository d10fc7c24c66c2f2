"""Stationary response of the linearised vehicle to a road whose rate of height is white noise."""

from typing import final

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.vehicles.base import AbstractVehicle, Instant


@final
class LinearVehicle(eqx.Module):
    """ξ̇ = A ξ + B ż_r, channels = C ξ + D ż_r, ξ = (q − K⁻¹K_r z_r, q̇, law states): bounded on a white road."""

    state_matrix: Float[Array, "n n"]
    road_rate_input: Float[Array, "n wheels"]
    output: dict[str, Float[Array, " n"]]
    feed_through: dict[str, Float[Array, " wheels"]]


@eqx.filter_jit
def linearise(vehicle: AbstractVehicle) -> LinearVehicle:
    """Linearise the laws about rest and write the vehicle relative to where it would settle on the road.

    Valid for small motion about a law's slope at zero velocity. Absolute heights (`z_…`) then mean heights above the
    settled position.
    """
    form, laws = vehicle.port_form(), vehicle.elements()
    n, wheels = form.road_stiffness.shape
    starts = [law.initial_state() for law in laws]
    flat, unravel = jax.flatten_util.ravel_pytree(starts)
    settled = form.settled()
    a, b_f, b_d = form.state_matrix(), form.port_input(), form.road_rate_input()

    def forces(xi: Array) -> Array:
        deflection, rate = form.ports @ xi[:n], form.ports @ xi[n : 2 * n]
        states = unravel(xi[2 * n :])
        return jnp.stack([law.force(deflection[i], rate[i], states[i]) for i, law in enumerate(laws)])

    def rates(xi: Array, road_rate: Array) -> Array:
        deflection, rate = form.ports @ xi[:n], form.ports @ xi[n : 2 * n]
        states = unravel(xi[2 * n :])
        motion = a @ xi[: 2 * n] + b_f @ forces(xi) + b_d @ road_rate
        motion = motion - jnp.concatenate([settled @ road_rate, jnp.zeros(n)])
        inner = [law.state_rate(deflection[i], rate[i], states[i]) for i, law in enumerate(laws)]
        return jnp.concatenate([motion, *inner])

    def outputs(xi: Array, road_rate: Array) -> dict[str, Scalar]:
        acceleration = (a @ xi[: 2 * n] + b_f @ forces(xi) + b_d @ road_rate)[n:]
        instant = Instant(xi[:n], xi[n : 2 * n], acceleration, jnp.zeros(wheels), road_rate, forces(xi))
        return vehicle.channels(instant)

    rest, still = jnp.concatenate([jnp.zeros(2 * n), flat]), jnp.zeros(wheels)
    state_matrix, road_rate_input = jax.jacfwd(rates, (0, 1))(rest, still)
    both = jax.jacfwd(outputs, (0, 1))(rest, still)
    return LinearVehicle(
        state_matrix, road_rate_input, {k: v[0] for k, v in both.items()}, {k: v[1] for k, v in both.items()}
    )


def lyapunov(a: Float[Array, "n n"], q: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """The solution P of A P + P Aᵀ + Q = 0, by one linear system of n² unknowns: differentiable, for small n."""
    n = a.shape[0]
    eye = jnp.eye(n, dtype=a.dtype)
    system = jnp.kron(a, eye) + jnp.kron(eye, a)
    return jnp.linalg.solve(system, -jnp.ravel(q)).reshape(n, n)


def stationary_rms(vehicle: AbstractVehicle, velocity_psd: ScalarLike = 1.0) -> dict[str, Scalar]:
    """RMS of every channel of the linearised vehicle when the road's rate of height is white noise.

    Solves A P + P Aᵀ + S B Bᵀ = 0 for the covariance P. Differentiable in every parameter. Channels that carry the
    white noise itself (with tyre damping, the tyre load) have an infinite RMS and are given as `inf`; heights are above
    the settled position.

    Arguments:
        vehicle: with one wheel, or with wheels on independent roads.
        velocity_psd: two-sided power spectral density S of the road's rate of height [(m/s)²/Hz];
            an ISO 8608 road of waviness 2 has 2π² G_d(n₀) n₀² V.

    Returns:
        RMS by channel name, in the units of the vehicle's channels.

    Source: for the quarter car, closed forms exist (see the tests).

    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> round(float(stationary_rms(quarter_car_000())["sprung_acceleration"]) ** 2, 3)
    853.472
    """
    _checks.positive("velocity_psd", velocity_psd)
    return _root_mean_squares(vehicle, velocity_psd)


@eqx.filter_jit
def _root_mean_squares(vehicle: AbstractVehicle, velocity_psd: ScalarLike) -> dict[str, Scalar]:
    linear = linearise(vehicle)
    b = linear.road_rate_input
    covariance = lyapunov(linear.state_matrix, velocity_psd * (b @ b.T))
    result = {}
    for name, row in linear.output.items():
        variance = jnp.maximum(row @ covariance @ row, 0.0)
        root = jnp.where(variance > 0, jnp.sqrt(jnp.where(variance > 0, variance, 1.0)), 0.0)
        result[name] = jnp.where(jnp.any(linear.feed_through[name] != 0), jnp.inf, root)
    return result
