"""Hysteresis without a state: the hyperbolic-tangent law of Kwok and others."""

from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers._guesses import secant_rate
from jaxdamp.dampers.base import AbstractStateless
from jaxdamp.parameters import nonnegative, parameter, positive, real, setting


@final
class HyperbolicTangent(AbstractStateless):
    """F = c v + k x + α tanh(β v + δ sgn x) + f₀ (Kwok et al. 2006; formula quoted from memory).

    For magnetorheological dampers: c and k are viscous damping and stiffness, α the yield force, β the steepness of the
    yield transition, δ the distance between the two branches of the loop, f₀ a static force. The printed sgn x jumps at
    mid-stroke; here it is tanh(x/w) with a given width w. F increases with v, and F(x, 0) depends on the stroke only,
    so no cycle yields energy. There is no state: the loop has the same shape at every frequency, and x = 0 must be the
    middle of the motion.

    >>> law = HyperbolicTangent(900.0, 500.0, 400.0, 30.0, 0.6)
    >>> round(float(law.force_stroke_velocity(0.01, 0.0)), 4)
    219.8198
    """

    viscous_rate: Number = parameter("N s/m", "c, viscous damping coefficient", nonnegative)
    stiffness: Number = parameter("N/m", "k, stiffness", nonnegative, adjustable=False)
    yield_force: Number = parameter("N", "α, height of the hysteresis", positive)
    steepness: Number = parameter("s/m", "β, steepness over the velocity", positive, adjustable=False)
    branch_offset: Number = parameter("", "δ, offset of the two branches", real, adjustable=False)
    static_force: Number = parameter("N", "f₀, force at rest at stroke zero", real, default=0.0)
    stroke_width: Number = setting("m", "w, stroke over which the sign of x changes", positive, default=1e-3)

    def constant_forces(self) -> tuple[str, ...]:
        """The static force."""
        return ("static_force",)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m] and velocity v [m/s]."""
        branches = jnp.tanh(self.steepness * v + self.branch_offset * jnp.tanh(x / self.stroke_width))
        return self.viscous_rate * v + self.stiffness * x + self.yield_force * branches + self.static_force

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "HyperbolicTangent":
        """Start values from measured data: a line and a step fitted to the force; the loop starts narrow."""
        velocity, force = np.asarray(velocity), np.asarray(force)
        typical = max(float(np.sqrt(np.mean(velocity**2))), 1e-6)
        steepness = 3.0 / typical
        columns = np.stack([velocity, np.tanh(steepness * velocity), np.ones_like(velocity)], axis=1)
        rate, level, offset = (float(a) for a in np.linalg.lstsq(columns, force, rcond=None)[0])
        least = 0.02 * max(float(np.max(np.abs(force - offset))), 1e-3)
        rate = rate if rate > 0 else 0.1 * secant_rate(velocity, force - offset, 1)
        return cls(rate, 0.0, max(level, least), steepness, 0.3, offset)
