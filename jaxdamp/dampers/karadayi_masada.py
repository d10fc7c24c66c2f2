"""Dashpot and dry friction behind a spring with clearance: the law of Karadayi and Masada."""

from typing import final

import numpy as np

from jaxdamp._types import Number, ScalarLike
from jaxdamp.dampers._guesses import ELASTIC_TRAVEL, sliding_fit
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.bilinear import Bilinear
from jaxdamp.dampers.coulomb_friction import CoulombFriction
from jaxdamp.dampers.play import AbstractClearance
from jaxdamp.parameters import nonnegative, parameter, positive


@final
class KaradayiMasada(AbstractClearance):
    """F = k dz(x_k, δ) = c v_d + F_c tanh(v_d/v_f), x = x_d + x_k, c = c_r for v_d > 0 and c_c for v_d < 0.

    The elements of Karadayi and Masada (1989), for low frequencies: a bilinear dashpot and Coulomb friction, in series
    with a spring that has a clearance of ±δ. After a reversal the force is zero over a travel of 2 δ and then increases
    with the spring. The equations of that paper were not available; these follow from its list of elements, with
    smoothed friction as in `CoulombFriction`. Passive for any parameters. It is
    `Play(Bilinear(c_r, c_c) + CoulombFriction(F_c, v_f), k, δ)`.

    State: the deflection x_k [m] of spring and clearance. The step is that of `SeriesSpring`, stable for any k.

    >>> import jax.numpy as jnp
    >>> law = KaradayiMasada(2600.0, 1200.0, 40.0, 0.01, stiffness=1e6, clearance=2e-4)
    >>> [round(float(law.force(0.0, 0.0, jnp.array([deflection]))), 6) for deflection in (1.5e-4, 7e-4, -7e-4)]
    [0.0, 500.0, -500.0]
    """

    rebound_rate: Number = parameter("N s/m", "c_r, slope of the dashpot for v > 0", positive)
    compression_rate: Number = parameter("N s/m", "c_c, slope of the dashpot for v < 0", positive)
    friction_force: Number = parameter("N", "F_c, friction force", positive, adjustable=False)
    friction_velocity: Number = parameter(
        "m/s", "v_f, velocity over which the friction jump is smoothed", positive, adjustable=False
    )
    stiffness: Number = parameter("N/m", "k, series stiffness", positive, adjustable=False)
    clearance: Number = parameter("m", "δ, half the free travel", nonnegative, adjustable=False)

    def inner_law(self) -> AbstractDamper:
        """Dashpot and friction, without spring and clearance."""
        friction = CoulombFriction(self.friction_force, self.friction_velocity)
        return Bilinear(self.rebound_rate, self.compression_rate) + friction

    def contact(self) -> tuple[ScalarLike, ScalarLike]:
        """Stiffness k [N/m] and clearance δ [m]."""
        return self.stiffness, self.clearance

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "KaradayiMasada":
        """Start values from measured data: c and friction from high velocities; spring and clearance deflect 1 mm."""
        rate, level, _ = sliding_fit(velocity, force)
        slow = max(0.1 * float(np.max(np.abs(velocity))), 1e-6)
        return cls(rate, rate, level, slow, level / ELASTIC_TRAVEL, 0.5 * ELASTIC_TRAVEL)
