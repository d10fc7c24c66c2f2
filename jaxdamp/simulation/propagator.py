"""The exact step of the linear part of a vehicle."""

from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar
from jaxdamp.vehicles import LinearMap


_HALVINGS = 20
_TERMS = 13  # of the Taylor series at a norm of one half or less: its rest is below 1e-16


@final
class Propagator(eqx.Module):
    """x₁ = Φ x₀ + H₀ f₀ + H₁ (f₁ − f₀) + H₂ (f₁ − 2 f₀ + f₋₁) + R₀ z₀ + R₁ (z₁ − z₀).

    Exact for element forces f [N] that run over the step on the parabola through f₋₁, one step earlier, f₀ and f₁, and
    for heights z [m] that run straight. Motion x = (q, q̇).
    """

    phi: Float[Array, "n n"]
    force_held: Float[Array, "n ports"]
    force_ramp: Float[Array, "n ports"]
    force_bend: Float[Array, "n ports"]
    road_held: Float[Array, "n wheels"]
    road_ramp: Float[Array, "n wheels"]

    @classmethod
    def over(cls, rate: LinearMap, dt: Scalar) -> "Propagator":
        """The matrices of a step of dt [s] of ẋ = A x + B f + R z + S ż.

        Φ = φ₀(A dt), H₀ = φ₁ B dt, H₁ = φ₂ B dt, H₂ = (φ₃ − φ₂/2) B dt.
        """
        phi, held, ramp, bend = phi_functions(rate.motion * dt)
        forces, heights = rate.force * dt, rate.road * dt
        return cls(
            phi,
            held @ forces,
            ramp @ forces,
            (bend - 0.5 * ramp) @ forces,
            held @ heights,
            ramp @ heights + held @ rate.road_rate,
        )


def phi_functions(z: Float[Array, "n n"]) -> tuple[Float[Array, "n n"], ...]:
    """φ₀ = eᶻ, φ₁ = (eᶻ − 1)/z, φ₂ = (φ₁ − 1)/z and φ₃ = (φ₂ − ½)/z of a matrix, by Taylor series and doublings.

    φ₀(2z) = φ₀², φ₁(2z) = φ₁ (φ₀ + 1)/2, φ₂(2z) = (φ₁² + 2 φ₂)/4, φ₃(2z) = (φ₁ φ₂ + φ₂ + 2 φ₃)/8, from z/2ˢ. The
    number s of doublings is chosen from the norm of z; the loops have a fixed length, so that batches and derivatives
    pass through. Valid up to a norm of 2¹⁹.
    """
    one = jnp.eye(z.shape[0], dtype=z.dtype)
    norm = jax.lax.stop_gradient(jnp.max(jnp.sum(jnp.abs(z), axis=0)))
    count = jnp.clip(jnp.ceil(jnp.log2(jnp.maximum(norm, 1e-3))) + 1.0, 0.0, _HALVINGS)
    small = z * 2.0**-count

    def nest(series: Array, divisor: Array) -> tuple[Array, None]:
        return one + small @ series / divisor, None

    series, _ = jax.lax.scan(nest, one, jnp.arange(_TERMS + 3.0, 3.0, -1.0, dtype=z.dtype))
    bend = series / 6.0
    ramp = 0.5 * one + small @ bend
    held = one + small @ ramp

    def double(now: tuple[Array, ...], number: Array) -> tuple[tuple[Array, ...], None]:
        phi, held, ramp, bend = now
        twice = (
            phi @ phi,
            0.5 * (held @ phi + held),
            0.25 * (held @ held) + 0.5 * ramp,
            0.125 * (held @ ramp + ramp) + 0.25 * bend,
        )
        return tuple(jnp.where(number < count, new, old) for new, old in zip(twice, now, strict=True)), None

    start = (one + small @ held, held, ramp, bend)
    found, _ = jax.lax.scan(double, start, jnp.arange(_HALVINGS, dtype=z.dtype))
    return found
