"""Frequencies and damping ratios of a vehicle as differentiable numbers."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.linear import linearise


class Oscillations(NamedTuple):
    """Damped oscillations, lowest frequency first; NaN where a mode does not oscillate.

    Attributes:
        frequency: |λ|/2π [Hz], shape (q,).
        damping_ratio: −Re λ/|λ|, shape (q,).
    """

    frequency: Float[Array, " q"]
    damping_ratio: Float[Array, " q"]


def oscillations(vehicle: AbstractVehicle) -> Oscillations:
    """Frequencies and damping ratios of the linearised vehicle, differentiable by its parameters.

    The same numbers as `modes(vehicle)`, for targets and objectives; by forward derivatives.

    >>> from jaxdamp.vehicles.presets import golden_car
    >>> oscillations(golden_car()).frequency.round(3)
    Array([ 1.236, 10.755], dtype=float64)
    """
    poles = jnp.linalg.eigvals(linearise(vehicle).state_matrix)
    size = jnp.sqrt(jnp.real(poles) ** 2 + jnp.imag(poles) ** 2)
    swings = jnp.imag(poles) > 1e-9 * size
    order = jnp.argsort(jnp.where(swings, size, jnp.inf))[: len(vehicle.coordinates)]
    size, decay = jnp.where(swings, size, jnp.nan)[order], -jnp.real(poles)[order]
    return Oscillations(size / (2.0 * np.pi), decay / size)
