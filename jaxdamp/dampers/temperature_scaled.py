"""Any law at another oil temperature."""

from typing import final

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.motion import Motion
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import parameter, positive, setting


@final
class TemperatureScaled(AbstractWrapper):
    """F(T) = F_law (1 − κ (T − T₀)): warm oil is thinner and lighter, the force falls in proportion.

    κ is 0.001 to 0.004 1/K: turbulent flow follows the density of the oil, laminar flow its viscosity, which falls
    faster and not in proportion. A straight line is good for some 40 K around T₀. The factor must be positive
    (κ (T − T₀) < 1), otherwise the law would drive the motion; that is refused when the law is made.

    Scale the oil only: gas pressure rises with temperature, and springs do not feel it, so write
    `SeriesSpring(TemperatureScaled(law, ...), ...)` and `TemperatureScaled(law, ...) + GasSpring(...)`. κ comes from
    tests at two temperatures or more; in a test at one temperature it cannot be told from the law's own numbers.

    Arguments:
        law: the law at T₀.
        temperature: T, oil temperature [K].
        reference_temperature: T₀ [K].
        sensitivity: κ [1/K].

    >>> from jaxdamp.dampers import Linear
    >>> law = TemperatureScaled(Linear(2000.0), temperature=333.15, reference_temperature=293.15, sensitivity=0.002)
    >>> round(float(law.force(0.0, 0.5, law.initial_state())), 6)
    920.0
    """

    law: AbstractDamper
    temperature: Number = setting("K", "oil temperature", positive)
    reference_temperature: Number = setting("K", "temperature of the law's own numbers", positive, default=293.15)
    sensitivity: Number = parameter("1/K", "κ, loss of force for each kelvin", default=0.002)

    def is_linear_in_law(self) -> bool:
        """A factor is linear."""
        return True

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same motion at the oil temperature, at the force of the law's own temperature."""
        return [(self.law, motion.divided(self.factor()).at_temperature(self.temperature))]

    def __check_init__(self) -> None:
        factor = _checks.concrete(self.factor())
        if factor is not None and not factor > 0:
            must = "leave a positive factor 1 − κ (T − T₀) on the force"
            _checks.refuse("sensitivity", must, f"{self.sensitivity}, factor {factor}", "Use a reference nearby.")

    def factor(self) -> Scalar:
        """1 − κ (T − T₀)."""
        return 1.0 - self.sensitivity * (self.temperature - self.reference_temperature)

    def outer_force(self, force: Scalar) -> Scalar:
        """Force [N] at the oil temperature."""
        return self.factor() * force
