"""The exact step of the linear part of a vehicle."""

from typing import final

import equinox as eqx
from jaxtyping import Array, Float

from jaxdamp._matrices import phi_functions
from jaxdamp._types import Scalar
from jaxdamp.vehicles import LinearMap


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
