"""A law in series with its oil column and with a rubber bushing that has its own damping."""

from typing import final

import jax.numpy as jnp

from jaxdamp._field_types import check_field_types
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers._series import AbstractSeries, Deflections, require_feed_through
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.parameters import parameter, positive


@final
class Bushing(AbstractSeries):
    """F = F_law(v_d) = k_o x_o = k_b x_b + c_b ẋ_b, x = x_d + x_o + x_b: law, oil column and bushing in series.

    Rubber loses energy when it is deflected; a spring in series (`SeriesSpring`) does not. A linear law of coefficient
    c gives the complex stiffness F/x = 1/(1/(iωc) + 1/k_o + 1/(k_b + iωc_b)) at the angular frequency ω. A bushing
    without damping is a spring: `SeriesSpring` with 1/(1/k_o + 1/k_b). The force of the law must increase with its
    velocity; the assembly is passive if the law is.

    States: the deflections x_o and x_b [m], then the law's own; ẋ_b = (F − k_b x_b)/c_b, ẋ_o = v − v_d − ẋ_b. The step
    is that of `SeriesSpring`, one monotone scalar equation a stage, stable for any stiffness and step.

    Arguments:
        law: a law whose force depends directly on the velocity.
        oil_stiffness: k_o [N/m]; for a column of oil A² B (1/V₁ + 1/V₂), with piston area A [m²], bulk modulus B [Pa]
            and volumes V₁, V₂ [m³] above and below the piston.
        stiffness: k_b [N/m].
        damping: c_b [N s/m]; k_b tan δ/ω for a loss angle δ at ω.

    Raises:
        ValueError: a law whose force is a state, such as `Lag`.

    >>> from jaxdamp.dampers import Linear
    >>> law = Bushing(Linear(2000.0), oil_stiffness=2e6, stiffness=8e5, damping=600.0)
    >>> round(float(law.force(0.0, 0.0, jnp.array([5e-4, 1e-3]))), 6)
    1000.0
    """

    law: AbstractDamper
    oil_stiffness: Number = parameter("N/m", "k_o, stiffness of the oil column", positive, adjustable=False)
    stiffness: Number = parameter("N/m", "k_b, stiffness of the bushing", positive, adjustable=False)
    damping: Number = parameter("N s/m", "c_b, damping of the bushing", positive, adjustable=False)

    def __check_init__(self) -> None:
        check_field_types(self)
        require_feed_through("law", self.law, "Bushing")

    def own_state_count(self) -> int:
        """The deflections of oil column and bushing [m]."""
        return 2

    def traits(self) -> Traits:
        """The rate of the bushing deflection has a kink where the velocity has one."""
        return super().traits()._replace(extrapolable_states=False)

    def spring_force(self, deflections: Deflections) -> Scalar:
        """Force [N] of the oil column, equal to that of the bushing."""
        return self.oil_stiffness * deflections[0]

    def largest_deflection(self, force: Scalar, begun: Deflections) -> Scalar:
        """Deflection [m] of both springs, plus the remaining deflection of the bushing."""
        return jnp.abs(begun[1]) + force / self.oil_stiffness + force / self.stiffness

    def shared(self, total: Scalar, begun: Deflections, duration: ScalarLike) -> Deflections:
        """k_o x_o = k_b x_b + c_b (x_b − begun)/duration with x_o + x_b = total."""
        carried = duration * self.stiffness * total + self.damping * (total - begun[1])
        oil = carried / (duration * (self.oil_stiffness + self.stiffness) + self.damping)
        return oil, total - oil

    def shared_at_rest(self, total: Scalar) -> Deflections:
        """k_o x_o = k_b x_b."""
        oil = self.stiffness * total / (self.oil_stiffness + self.stiffness)
        return oil, total - oil

    def shared_rate(self, total_rate: Scalar, deflections: Deflections) -> Deflections:
        """ẋ_b = (F − k_b x_b)/c_b of the bushing, and the remaining rate of the oil column [m/s]."""
        rubber = (self.spring_force(deflections) - self.stiffness * deflections[1]) / self.damping
        return total_rate - rubber, rubber
