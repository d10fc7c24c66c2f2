"""The quarter car: body and wheel of one corner."""

from typing import final

import equinox as eqx

from jaxdamp._types import Number, Scalar
from jaxdamp.parameters import parameter, positive
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.corner import AbstractCorner
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Body
from jaxdamp.vehicles.seat import Seat, seat_parts


class _SprungMass(AbstractVehicle):
    sprung_mass: Number = parameter("kg", "mass of the body on this corner", positive, adjustable=False)


@final
class QuarterCar(AbstractCorner, _SprungMass):  # in this order, the sprung mass is the first argument
    """A quarter of a car: sprung mass, spring and damper, unsprung mass, tyre.

    m_s z̈_s = −k_s (z_s − z_u) − F,  m_u z̈_u = k_s (z_s − z_u) + F − F_t, F_t = k_t (z_u − z_r) + c_t (ż_u − ż_r),
    with the force F of the damper and of the other laws at stroke z_s − z_u. Heights are measured from static
    equilibrium, z up. Unless `tyre_lifts`, the tyre stays on the road and its load may become negative
    (`Response.notes` reports it). For any law, at every instant and with c_t = 0, m_s z̈_s + m_u z̈_u = −k_t (z_u −
    z_r).

    Arguments:
        damper: law at the wheel; `dampers.MotionRatio(law, ratio)` if the damper has another travel than the wheel.
        extra_spring: law parallel to the linear spring, such as `CubicSpring` or `dampers.GasSpring`.
        bump_stop: law such as `dampers.BumpStop`.
        friction: law such as `dampers.CoulombFriction`.
        tyre_lifts: whether the tyre can lift off (see `LiftOff`).
        seats: on the body.
        damper_count: number of equal dampers; the channels of force and power are those of one.

    >>> from jaxdamp.dampers import Linear
    >>> car = QuarterCar(1200.0, 125.0, 60e3, 220e3, Linear(2500.0))
    >>> round(float(car.static_tyre_load()), 2)
    12993.81
    """

    seats: tuple[Seat, ...] = ()
    damper_count: int = eqx.field(static=True, default=1)

    def static_tyre_load(self) -> Scalar:
        """Load of the tyre at rest [N], the weight of all masses."""
        return self.static_wheel_loads()[0]

    def frame(self) -> Frame:
        """Coordinates z_sprung, z_unsprung, then seats; one wheel."""
        body = Body("sprung", self.sprung_mass)
        wheel, suspension, tyre = self.parts("", body.at())
        bodies, links = seat_parts(self.seats, body)
        return Frame((body, wheel, *bodies), (suspension, *links), (tyre,))
