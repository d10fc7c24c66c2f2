"""Half a car seen from the front: body with heave and roll on a left and a right wheel."""

from typing import final

import equinox as eqx

from jaxdamp._types import Number
from jaxdamp.parameters import parameter, positive
from jaxdamp.vehicles.axle import Axle
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Body, Place
from jaxdamp.vehicles.seat import Seat, seat_parts


@final
class RollCar(AbstractVehicle):
    """Body with heave z and roll φ (left side up) on one axle with an anti-roll bar.

        m z̈ = −F_l − F_r,   J φ̈ = −(w/2)(F_l − F_r) − M,   m_u z̈_ul = F_l − F_tl + M/w,  m_u z̈_ur = F_r − F_tr −
        M/w, M = k_R (φ − (z_ul − z_ur)/w).

    The wheels are left and right.

    Arguments:
        axle: the two corners and the bar between them.
        places: where on the body accelerations are of interest.
        seats: on the body.
        tyre_lifts: whether all tyres can lift off; for a single corner, set `tyre_lifts` of the corner.

    >>> from jaxdamp.vehicles.presets import full_car_jazar
    >>> full = full_car_jazar()
    >>> car = RollCar(420.0, full.roll_inertia, full.front)
    >>> car.coordinates
    ('z_sprung', 'roll', 'z_left_unsprung', 'z_right_unsprung')
    """

    sprung_mass: Number = parameter("kg", "mass of the body on this axle", positive, adjustable=False)
    roll_inertia: Number = parameter("kg m²", "moment of inertia of the body in roll", positive, adjustable=False)
    axle: Axle
    places: tuple[Place, ...] = ()
    seats: tuple[Seat, ...] = ()
    tyre_lifts: bool = eqx.field(static=True, default=False)

    def frame(self) -> Frame:
        """Coordinates z_sprung, roll, z_left_unsprung, z_right_unsprung, then seats; wheels left, right."""
        body = Body("sprung", self.sprung_mass, roll_inertia=self.roll_inertia)
        wheels, suspensions, tyres = self.axle.parts("", body)
        bodies, links = seat_parts(self.seats, body)
        frame = Frame((body, *wheels, *bodies), (*suspensions, *links), tyres, self.places)
        return frame.lifting(self.tyre_lifts)
