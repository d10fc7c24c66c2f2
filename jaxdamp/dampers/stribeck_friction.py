"""Dry friction with the Stribeck effect, smoothed."""

from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.dampers.coulomb_friction import CoulombFriction
from jaxdamp.parameters import parameter, positive


def stribeck_force(v: ScalarLike, friction: ScalarLike, breakaway: ScalarLike, velocity: ScalarLike) -> Scalar:
    """g(v) = F_c + (F_s − F_c) exp(−(v/v_s)²) [N], the friction of steady sliding."""
    u = v / velocity
    return friction + (breakaway - friction) * jnp.exp(-u * u)


@final
class StribeckFriction(AbstractMemoryless):
    """F = [F_c + (F_s − F_c) exp(−(v/v_s)²)] tanh(v/v_f): friction that decreases from F_s to F_c with velocity.

    For the viscous part of the Stribeck curve add a `Linear`. `CoulombFriction` is the case F_s = F_c. As there, the
    jump at v = 0 is smoothed over v_f; this reduces the peak F_s, so v_f must be much smaller than v_s: with
    F_s = 2 F_c the peak is 0.98 F_s for v_f = 0.05 v_s, 0.96 F_s for 0.1 v_s, 0.83 F_s for 0.3 v_s.

    The law is smooth everywhere and passive, F v ≥ 0 at any time. Where the force decreases with velocity, with slopes
    down to about −0.86 (F_s − F_c)/v_s, it excites stick-slip, which is physical. There it cannot be inverted, so do
    not use it inside a `SeriesSpring`. It does not hold a load at rest: the stroke creeps with v < v_f.

    >>> law = StribeckFriction(40.0, breakaway_force=70.0, stribeck_velocity=0.02, friction_velocity=0.001)
    >>> [round(float(law.force_velocity(v)), 2) for v in (0.003, -0.02, 0.5)]
    [68.99, -51.04, 40.0]
    """

    friction_force: Number = parameter(
        "N", "F_c, friction force at high velocity", positive, linear=True, adjustable=False
    )
    breakaway_force: Number = parameter("N", "F_s, friction force near rest", positive, linear=True, adjustable=False)
    stribeck_velocity: Number = parameter(
        "m/s", "v_s, velocity over which the friction decreases", positive, adjustable=False
    )
    friction_velocity: Number = parameter(
        "m/s", "v_f, velocity over which the jump is smoothed", positive, adjustable=False
    )

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        level = stribeck_force(v, self.friction_force, self.breakaway_force, self.stribeck_velocity)
        return level * jnp.tanh(v / self.friction_velocity)

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "StribeckFriction":
        """Start values from measured data: those of `CoulombFriction`, with F_s = 1.5 F_c."""
        friction = CoulombFriction.guess(velocity, force)
        level, width = float(friction.friction_force), float(friction.friction_velocity)
        return cls(level, 1.5 * level, 2.0 * width, 0.2 * width)
