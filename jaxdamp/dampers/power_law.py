"""Power law for each direction (paper 000, eqs. 4 and 5)."""

from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._elementary import power, reciprocal_root
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers.base import AbstractMemoryless, Reach
from jaxdamp.parameters import nonnegative, parameter, positive, setting


NEXT_TO_NONE = 0.01  # of the force of the other side, below which no search finds an exponent


@final
class PowerLaw(AbstractMemoryless):
    """F = q₁ vᵈ¹ + l₁ for v ≥ 0 and F = −q₂ |v|ᵈ² − l₂ for v < 0 (paper 000, eqs. 4-5), made smooth at v = 0.

    An exponent below 1 is degressive (infinite slope at v = 0), above 1 progressive. The paper's l₁ and l₂ jump at
    v = 0 as dry friction does. Both are rounded over `knee_width` ε: |v|ⁿ sgn v becomes v (v²+ε²)^((n−1)/2) and the
    jump v/√(v²+ε²), so that force and slope are finite everywhere; the relative error against |v|ⁿ is (n−1)/2 (ε/v)²,
    1e-4 at |v| = 50 ε for n = 0.6. The paper writes the compression side with a
    signed q₂; here all coefficients resist the motion and are positive.

    >>> law = PowerLaw(rebound_force=1800.0, rebound_exponent=0.55, compression_force=900.0, compression_exponent=0.55)
    >>> round(float(law.force_velocity(1.0)), 2), round(float(law.force_velocity(-1.0)), 2)
    (1800.0, -900.0)
    """

    rebound_force: Number = parameter("N", "rebound force at 1 m/s, without the offset", positive, linear=True)
    rebound_exponent: Number = parameter("", "rebound exponent", positive)
    compression_force: Number = parameter("N", "compression force at 1 m/s, without the offset", positive, linear=True)
    compression_exponent: Number = parameter("", "compression exponent", positive)
    rebound_offset: Number = parameter("N", "rebound force offset", nonnegative, linear=True, default=0.0)
    compression_offset: Number = parameter("N", "compression force offset", nonnegative, linear=True, default=0.0)
    knee_width: Number = setting("m/s", "width over which v = 0 is rounded", positive, default=1e-3)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        v = jnp.asarray(v)
        square, rebound = v * v + self.knee_width * self.knee_width, v >= 0
        force = jnp.where(rebound, self.rebound_force, self.compression_force)
        offset = jnp.where(rebound, self.rebound_offset, self.compression_offset)
        exponent = jnp.where(rebound, self.rebound_exponent, self.compression_exponent)
        return v * (force * power(square, 0.5 * (exponent - 1.0)) + offset * reciprocal_root(square))

    def other_starts(self, reach: Reach) -> list[dict[str, float]]:
        """A straight line with the force of the other side, for a side that has next to none within the records."""
        # In plain numbers: the formula as operations of JAX would be thirty programs for two values.
        rebound, compression = (
            float(force) * reach.velocity ** float(exponent) + float(offset)
            for force, exponent, offset in (
                (self.rebound_force, self.rebound_exponent, self.rebound_offset),
                (self.compression_force, self.compression_exponent, self.compression_offset),
            )
        )
        sides = (("rebound", rebound, compression), ("compression", compression, rebound))
        return [
            {f"{side}_force": other / reach.velocity, f"{side}_exponent": 1.0}
            for side, force, other in sides
            if reach.velocity > 0.0 and force < NEXT_TO_NONE * other
        ]

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "PowerLaw":
        """Start values from measured data: a straight line in logarithms on each side."""
        values = []
        for side in (1, -1):
            v, f = side * np.asarray(velocity), side * np.asarray(force)
            use = (v > 0.05 * max(v.max(), 1e-9)) & (f > 0)
            if use.sum() < 2:
                values += [max(float(np.abs(f).max()), 1.0), 1.0]
                continue
            slope, level = np.polyfit(np.log(v[use]), np.log(f[use]), 1)
            values += [float(np.exp(level)), float(np.clip(slope, 0.2, 2.0))]
        offset = 0.01 * float(np.abs(force).max())
        return cls(*values, rebound_offset=offset, compression_offset=offset)
