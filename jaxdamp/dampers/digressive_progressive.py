"""Bleed, blow-off valve and ports: a steep, then a flat, then a progressive curve."""

from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._limits import ramp
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers._guesses import knee_scan
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.parameters import nonnegative, parameter, positive, setting


def digressive_progressive(
    speed: ScalarLike,
    bleed_rate: ScalarLike,
    blow_off_velocity: ScalarLike,
    blow_off_rate: ScalarLike,
    progressivity: ScalarLike,
    width: ScalarLike,
) -> Scalar:
    """F = c₀ u up to v_b, then F = c₀ v_b + c₂ (u − v_b), everywhere + c₃ u² [N], at u = |v| [m/s]; F(0) = 0.

    The knee is rounded over `width` [m/s]: max(u − v_b, 0) becomes w ln(1 + exp((u − v_b)/w)), less its value at u = 0.
    """
    opened = ramp(speed - blow_off_velocity, width) - ramp(-blow_off_velocity, width)
    return bleed_rate * speed + (blow_off_rate - bleed_rate) * opened + progressivity * speed * speed


@final
class DigressiveProgressive(AbstractMemoryless):
    """F = c₀ v up to the blow-off velocity v_b, slope c₂ above it, plus c₃ v|v|; separate parameters per direction.

    c₀ is due to the bleed, c₂ to the open valve (digressive if c₂ < c₀), c₃ to the flow through the ports
    (progressive). Without c₃ it is the digressive law. F(0) = 0 and the force is continuous; it increases with v
    everywhere, so the law is passive. The slope changes at ±v_b, unless `knee_width` rounds these knees, and at v = 0
    if the two c₀ differ.

    Data must extend far above v_b on each side: just above v_b, c₂ and c₃ cannot be distinguished.

    >>> law = DigressiveProgressive(
    ...     rebound_bleed_rate=8000.0, rebound_blow_off_velocity=0.1, rebound_blow_off_rate=900.0,
    ...     compression_bleed_rate=5000.0, compression_blow_off_velocity=0.06, compression_blow_off_rate=500.0,
    ...     rebound_progressivity=300.0)
    >>> [round(float(law.force_velocity(v)), 6) for v in (0.1, 1.1, -0.06, -1.06)]
    [803.0, 2063.0, -300.0, -800.0]
    """

    rebound_bleed_rate: Number = parameter("N s/m", "c₀ in rebound, slope below blow-off", positive, linear=True)
    rebound_blow_off_velocity: Number = parameter("m/s", "v_b in rebound, where the valve opens", positive)
    rebound_blow_off_rate: Number = parameter("N s/m", "c₂ in rebound, slope above blow-off", nonnegative, linear=True)
    compression_bleed_rate: Number = parameter(
        "N s/m", "c₀ in compression, slope below blow-off", positive, linear=True
    )
    compression_blow_off_velocity: Number = parameter("m/s", "v_b in compression, where the valve opens", positive)
    compression_blow_off_rate: Number = parameter(
        "N s/m", "c₂ in compression, slope above blow-off", nonnegative, linear=True
    )
    rebound_progressivity: Number = parameter(
        "N s²/m²", "c₃ in rebound, coefficient of v|v|", nonnegative, linear=True, default=0.0
    )
    compression_progressivity: Number = parameter(
        "N s²/m²", "c₃ in compression, coefficient of v|v|", nonnegative, linear=True, default=0.0
    )
    knee_width: Number = setting("m/s", "width over which the knees at ±v_b are rounded", nonnegative, default=0.0)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        v = jnp.asarray(v)
        extends = v >= 0
        force = digressive_progressive(
            jnp.where(extends, v, -v),
            jnp.where(extends, self.rebound_bleed_rate, self.compression_bleed_rate),
            jnp.where(extends, self.rebound_blow_off_velocity, self.compression_blow_off_velocity),
            jnp.where(extends, self.rebound_blow_off_rate, self.compression_blow_off_rate),
            jnp.where(extends, self.rebound_progressivity, self.compression_progressivity),
            self.knee_width,
        )
        return jnp.where(extends, force, -force)

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "DigressiveProgressive":
        """Start values from measured data: slopes by least squares for several blow-off velocities, the best."""
        sides = []
        for side in (1, -1):
            knee, (bleed, blow_off, progressivity) = knee_scan(
                velocity,
                force,
                side,
                lambda v, knee: [np.minimum(v, knee), np.maximum(v - knee, 0.0), v * v],
                np.linspace(0.03, 0.9, 59),
            )
            sides.append((max(float(bleed), 1.0), knee, float(blow_off), float(progressivity)))
        (c0_r, v_r, c2_r, c3_r), (c0_c, v_c, c2_c, c3_c) = sides
        return cls(c0_r, v_r, c2_r, c0_c, v_c, c2_c, c3_r, c3_c)
