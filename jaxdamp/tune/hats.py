"""Small changes of the force at single velocities: hat functions added to the curve of a damper."""

from typing import TypeVar, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._types import Number, Scalar, ScalarLike, Vector
from jaxdamp.dampers import AbstractMemoryless
from jaxdamp.parameters import get, parameter, positive, real, setting
from jaxdamp.vehicles import AbstractVehicle


V = TypeVar("V", bound=AbstractVehicle)


@final
class ForceHats(AbstractMemoryless):
    """A force that is linear between velocities at equal distances, zero at standstill, constant beyond the ends.

    Its derivative by one of its forces is the hat function around that velocity, exactly.

    Arguments:
        spacing: of the velocities [m/s], which are ±1, ±2, ... times this.
        forces: at these velocities, increasing [N], shape (2 k,).
    """

    spacing: Number = setting("m/s", "spacing of the velocities", positive)
    forces: Vector = parameter("N", "forces at the velocities", real, linear=True)

    @property
    def velocities(self) -> Float[Array, " points"]:
        """The velocities [m/s]."""
        count = self.forces.size // 2
        steps = np.concatenate([np.arange(-count, 0), np.arange(1, count + 1)])
        return self.spacing * jnp.asarray(steps, self.forces.dtype)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        limit = self.forces.size // 2  # its slope by v is not used: it is that of forces of zero
        place = jnp.clip(v / self.spacing, -limit, limit)
        weights = jnp.maximum(1.0 - jnp.abs(place - self.velocities / self.spacing), 0.0)
        return jnp.sum(weights * self.forces)


def with_hats(vehicle: V, path: str, reach: float, count: int) -> V:
    """The vehicle with hats of zero force beside the law at a path.

    Arguments:
        vehicle: with the law.
        path: of the law.
        reach: largest velocity of the hats [m/s].
        count: number of hats on each side.
    """
    hats = ForceHats(reach / count, np.zeros(2 * count))
    return eqx.tree_at(lambda car: get(car, path), vehicle, get(vehicle, path) + hats)


def is_hat(path: str, vehicle: AbstractVehicle) -> bool:
    """Whether a path is that of the forces of hats."""
    owner, _, name = path.rpartition(".")
    return name == "forces" and isinstance(get(vehicle, owner), ForceHats)
