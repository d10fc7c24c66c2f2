"""Any law at another oil temperature."""

from typing import final

import equinox as eqx

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import parameter, positive, setting


@final
class TemperatureScaled(AbstractWrapper):
    """F(T) = F_law (1 − κ (T − T₀)): the force decreases linearly with the oil temperature.

    κ is 0.001 to 0.004 1/K: in turbulent flow the force follows the density of the oil, in laminar flow its viscosity,
    which decreases faster and nonlinearly. The linear approximation is valid for about 40 K around T₀. The factor must
    be positive (κ (T − T₀) < 1), otherwise the law would add energy to the motion; the constructor refuses this.

    Fits take T from the temperature channel of the records, sample by sample, or from their setting `temperature`
    ("60 degC"), and `respond` takes it as an argument. The stated temperature is for motions where none was measured;
    records of which only some have the channel, or the setting, are refused.

    Scale only the oil forces: gas pressure increases with temperature, and springs do not depend on it, so write
    `SeriesSpring(TemperatureScaled(law, ...), ...)` and `TemperatureScaled(law, ...) + GasSpring(...)`. κ is
    determined by tests at two or more temperatures; at one temperature it cannot be distinguished from the law's own
    parameters.

    Arguments:
        law: the law at T₀.
        temperature: T, oil temperature [K] where none is measured.
        reference_temperature: T₀ [K].
        sensitivity: κ [1/K].

    >>> from jaxdamp.dampers import Linear
    >>> law = TemperatureScaled(Linear(2000.0), temperature=333.15, reference_temperature=293.15, sensitivity=0.002)
    >>> round(float(law.force(0.0, 0.5, law.initial_state())), 6)
    920.0
    """

    law: AbstractDamper
    temperature: Number = setting("K", "oil temperature", positive)
    reference_temperature: Number = setting("K", "temperature at which the law was measured", positive, default=293.15)
    sensitivity: Number = parameter("1/K", "κ, relative loss of force per kelvin", default=0.002, adjustable=False)

    def traits(self) -> Traits:
        """Those of the law, and a dependence on the temperature."""
        return super().traits()._replace(temperature_dependent=True)

    def at_temperature(self, temperature: ScalarLike) -> "TemperatureScaled":
        """This law at a known oil temperature [K]."""
        law = (self.law.at_temperature(temperature), temperature)
        return eqx.tree_at(lambda whole: (whole.law, whole.temperature), self, law)

    def values_at_start(self, temperature: ScalarLike) -> dict[str, ScalarLike]:
        """T, which stays."""
        return {"temperature": temperature}

    def is_linear_in_law(self) -> bool:
        """A factor is linear."""
        return True

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same motion at the oil temperature, with the force at the reference temperature."""
        return [(self.law, motion.divided(self.factor()).at_temperature(self.temperature))]

    def __check_init__(self) -> None:
        for name in ("temperature", "reference_temperature"):
            _checks.kelvin(f"{type(self).__name__}.{name}", getattr(self, name))
        factor = _checks.concrete(self.factor())
        if factor is not None and not factor > 0:
            must = "give a positive factor 1 − κ (T − T₀) on the force"
            _checks.refuse("sensitivity", must, f"{self.sensitivity}, factor {factor}", "Use a reference nearby.")

    def factor(self) -> Scalar:
        """1 − κ (T − T₀)."""
        return 1.0 - self.sensitivity * (self.temperature - self.reference_temperature)

    def outer_force(self, force: Scalar) -> Scalar:
        """Force [N] at the oil temperature."""
        return self.factor() * force
