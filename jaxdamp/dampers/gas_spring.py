"""The gas charge of a damper, which pushes its rod out."""

from typing import final

import equinox as eqx

from jaxdamp._elementary import power
from jaxdamp._limits import at_least
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers.base import AbstractStateless
from jaxdamp.dampers.contract import Traits
from jaxdamp.parameters import parameter, positive, setting


LEAST_SHARE = 0.05


def gas_pressure(x: ScalarLike, pressure: ScalarLike, volume: ScalarLike, area: ScalarLike, n: ScalarLike) -> Scalar:
    """p_g = p₀ (V₀/(V₀ + A x))ⁿ [Pa, absolute] at stroke x [m], with volume V₀ [m³] at x = 0 and rod area A [m²].

    Below 5 % of V₀ (`LEAST_SHARE`), where oil would fill the gas chamber, the pressure continues along its tangent
    instead of to the pole at V₀ + A x = 0: value and slope are finite and continuous at every stroke.
    """
    share = 1.0 + area * x / volume
    limited = at_least(share, LEAST_SHARE)
    return pressure * power(limited, -n) * (1.0 - n * (share - limited) / limited)


@final
class GasSpring(AbstractStateless):
    """F = −(p_g − p_atm) A with p_g = p₀ (V₀/(V₀ + A x))ⁿ: the gas acts on the cross-section A of the rod.

    It pushes the rod out, so its force is negative (in the direction of extension), most in compression. At x = 0 it is
    the static force −(p₀ − p_atm) A: unlike other laws, this one is not zero at rest. Its stiffness there is n p₀
    A²/V₀. It is a spring: no energy is lost over a cycle.

    In a vehicle, heights are measured from the equilibrium of the linear springs. If the spring data do not include the
    dampers, the static gas force raises the body until the springs balance it. If they do include it, set `relative`,
    which subtracts the force at x = 0. n = 1 for slow motion (isothermal), 1.4 for fast motion of nitrogen
    (adiabatic). The gas warms with the damper: p₀ is the pressure at the temperature of the test, in proportion to it
    [K]. Valid while V₀ + A x > 0.05 V₀ (see `gas_pressure`).

    Tests at one pressure and stroke position determine p₀ A only; V₀ and n follow from a slow test over the whole
    stroke, and only as n/V₀ if A x is small compared with V₀. Records at several pressures that state theirs
    (`settings={"pressure": "20 bar"}`) determine A.

    >>> law = GasSpring(pressure=2e6, volume=6e-5, rod_area=1e-4, exponent=1.3)
    >>> [round(float(law.force(x, 0.0, law.initial_state())), 2) for x in (0.0, 0.05, -0.05)]
    [-189.87, -170.1, -213.82]
    """

    pressure: Number = parameter("Pa", "p₀, absolute gas pressure at stroke zero", positive)
    volume: Number = parameter("m³", "V₀, gas volume at stroke zero", positive)
    rod_area: Number = parameter("m²", "A, cross-section of the rod", positive, adjustable=False)
    exponent: Number = parameter("", "n, polytropic exponent", positive, default=1.3, adjustable=False)
    atmospheric_pressure: Number = setting("Pa", "pressure outside", positive, default=101_325.0)
    relative: bool = eqx.field(static=True, default=False)

    def traits(self) -> Traits:
        """Independent of the velocity; the pressure is nearly an offset."""
        return super().traits()._replace(has_feed_through=False, contains_offset=True)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m], independent of the velocity."""
        del v
        outside = self.pressure if self.relative else self.atmospheric_pressure
        return (outside - gas_pressure(x, self.pressure, self.volume, self.rod_area, self.exponent)) * self.rod_area
