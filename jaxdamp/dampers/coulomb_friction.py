"""Dry friction of seals and guides, smoothed."""

from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.parameters import parameter, positive


@final
class CoulombFriction(AbstractMemoryless):
    """F = F_c tanh(v/v_f): dry friction with its jump at v = 0 spread over the friction velocity.

    The jump of sgn(v) would make derivatives with respect to parameters wrong (they miss the moving instant of the
    jump) and stall step-size control. 96 % of F_c is reached at 2 v_f.

    >>> round(float(CoulombFriction(40.0, friction_velocity=0.002).force_velocity(-0.1)), 6)
    -40.0
    """

    friction_force: Number = parameter("N", "friction force", positive, linear=True, adjustable=False)
    friction_velocity: Number = parameter("m/s", "velocity over which the jump is spread", positive, adjustable=False)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        return self.friction_force * jnp.tanh(v / self.friction_velocity)

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "CoulombFriction":
        """Start values from measured data: half the mean resisting force, a tenth of the typical velocity."""
        velocity, force = np.asarray(velocity), np.asarray(force)
        level = float(np.mean(np.sign(velocity) * force))
        return cls(max(0.5 * level, 1e-3), max(0.1 * float(np.sqrt(np.mean(velocity**2))), 1e-6))
