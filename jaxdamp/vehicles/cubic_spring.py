"""A spring whose rate changes along its stroke."""

from typing import final

from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers import AbstractStateless, Traits
from jaxdamp.parameters import nonnegative, parameter


@final
class CubicSpring(AbstractStateless):
    """F = k₂ x² + k₃ x³: the nonlinear part of a progressive spring, parallel to its linear rate.

    Its tangent rate is k + 2 k₂ x + 3 k₃ x² with the linear rate k of the vehicle. With k₂ < 0 it is stiffer in
    compression than in extension; the total rate is positive at every stroke if k₂² < 3 k k₃. No energy is dissipated.

    >>> float(CubicSpring(quadratic_stiffness=-1e5, cubic_stiffness=2e6).force_stroke_velocity(-0.1, 0.0))
    -3000.0
    """

    quadratic_stiffness: Number = parameter("N/m²", "k₂, quadratic stiffness", default=0.0, linear=True)
    cubic_stiffness: Number = parameter("N/m³", "k₃, cubic stiffness", nonnegative, default=0.0, linear=True)

    def traits(self) -> Traits:
        """Independent of the velocity."""
        return super().traits()._replace(has_feed_through=False)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m], independent of the velocity."""
        del v
        return (self.quadratic_stiffness + self.cubic_stiffness * x) * x * x
