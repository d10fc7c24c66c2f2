"""A law in series with a spring: top mount, rod bushing or oil column."""

from typing import final

from jaxdamp._field_types import check_field_types
from jaxdamp._types import Number, Scalar
from jaxdamp.dampers._series import AbstractSeries, Deflections, require_feed_through
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.parameters import nonnegative, parameter, positive


@final
class SeriesSpring(AbstractSeries):
    """F = k₁ x_s + k₂ x_s³ = F_law(v_d), x = x_d + x_s: the spring and the law carry the same force (paper 001).

    State: the deflection x_s [m] of the spring (then the states of the law), ẋ_s = v − v_d. The force of the law must
    increase with its velocity. The step is the two-stage SDIRK method (second order, L-stable): each stage solves one
    monotone scalar equation for v_d, so a spring of any stiffness is stable at any step, and derivatives come from the
    implicit function theorem. A linear law with coefficient c is the Maxwell element of time constant c/k₁.

    Paper 001 gives k₁ = 150 N/mm, with which the corner frequency of the damper is 1.6 Hz; ten times k₁ is plausible.

    >>> import jax.numpy as jnp
    >>> from jaxdamp.dampers import Linear
    >>> law = SeriesSpring(Linear(2000.0), stiffness=1e6)
    >>> round(float(law.force(0.0, 0.0, jnp.array([1e-3]))), 6)
    1000.0
    """

    law: AbstractDamper
    stiffness: Number = parameter("N/m", "k₁, series stiffness", positive, adjustable=False)
    cubic_stiffness: Number = parameter(
        "N/m³", "k₂, cubic series stiffness", nonnegative, default=0.0, adjustable=False
    )

    def __check_init__(self) -> None:
        check_field_types(self)
        require_feed_through("law", self.law, "SeriesSpring")

    def spring_force(self, deflections: Deflections) -> Scalar:
        """Spring force [N] at its deflection [m]."""
        (deflection,) = deflections
        return (self.stiffness + self.cubic_stiffness * deflection * deflection) * deflection

    def largest_deflection(self, force: Scalar, begun: Deflections) -> Scalar:
        """Deflection [m] of the linear part alone."""
        del begun
        return force / self.stiffness
