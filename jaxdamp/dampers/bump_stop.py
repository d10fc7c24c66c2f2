"""Rubber or foam that ends the stroke."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._limits import at_least, within
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers.base import AbstractStateless
from jaxdamp.parameters import nonnegative, parameter, positive, setting


def penetration(travel: ScalarLike | Array, width: ScalarLike | Array) -> tuple[Array, Array]:
    """Penetration d [m] and its slope g for a travel u [m] beyond first contact, its onset rounded over `width` w.

    d = 0 for u < 0, u²/(2w) up to w, u − w/2 beyond. The slope g rises from 0 to 1 over the width.
    """
    share = within(travel / width, 0.0, 1.0)
    return share * (travel - 0.5 * width * share), share


@final
class BumpStop(AbstractStateless):
    """F = ∓(k₁ d + k₃ d³ + c ḋ) with the penetration d of the stop at one end of the stroke, or at both.

    The compression stop is in contact at x < −clearance and pushes the rod out (F < 0); the rebound stop is in contact
    at x > clearance and pulls it in (F > 0). In between, the force is exactly zero. The onset of d is rounded over
    `engagement_width` (`penetration`), so the elastic force has a continuous slope; the damping uses ḋ = g v, which
    increases with the penetration without a jump. A stop can only push: where its damping would pull, the force is
    zero. The law is passive. For different stops at both ends, add two laws.

    Arguments:
        clearance: stroke from x = 0 to first contact [m].
        stiffness: k₁ [N/m].
        cubic_stiffness: k₃ [N/m³], makes the stop progressive.
        damping: c [N s/m].
        engagement_width: penetration over which the contact begins [m].
        end: `"compression"`, `"rebound"` or `"both"`.

    >>> law = BumpStop(clearance=0.04, stiffness=50e3, cubic_stiffness=2e8, end="both")
    >>> [round(float(law.force(x, 0.0, law.initial_state())), 3) for x in (0.0, -0.0505, 0.0505)]
    [0.0, -700.0, 700.0]
    """

    clearance: Number = parameter("m", "stroke from zero to first contact", nonnegative)
    stiffness: Number = parameter("N/m", "k₁, stiffness of the stop", nonnegative)
    cubic_stiffness: Number = parameter("N/m³", "k₃, cubic stiffness of the stop", nonnegative, default=0.0)
    damping: Number = parameter(
        "N s/m", "c, damping coefficient in contact", nonnegative, default=0.0, adjustable=False
    )
    engagement_width: Number = setting("m", "penetration over which the contact begins", positive, default=1e-3)
    end: str = eqx.field(static=True, default="compression")

    def __check_init__(self) -> None:
        _checks.one_of("end", self.end, ("compression", "rebound", "both"))

    def _push(self, outward: ScalarLike, speed: ScalarLike) -> Scalar:
        """Force of a stop [N] ≥ 0 at a stroke towards it [m] and the velocity towards it [m/s]."""
        d, gate = penetration(outward - self.clearance, self.engagement_width)
        return at_least((self.stiffness + self.cubic_stiffness * d * d) * d + self.damping * gate * speed, 0.0)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m] and velocity v [m/s]."""
        x, v = jnp.asarray(x), jnp.asarray(v)
        if self.end == "compression":
            return -self._push(-x, -v)
        if self.end == "rebound":
            return self._push(x, v)
        return self._push(x, v) - self._push(-x, -v)
