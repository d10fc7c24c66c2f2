"""Half a car seen from the side: body with heave and pitch on a front and a rear wheel."""

from typing import final

import equinox as eqx

from jaxdamp._types import Number
from jaxdamp.parameters import parameter, positive
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.corner import Corner
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Body, Place
from jaxdamp.vehicles.seat import Seat, seat_parts


@final
class HalfCar(AbstractVehicle):
    """Body with heave z and pitch θ (nose up) on two corners, l_a ahead of and l_b behind the centre of gravity.

        m z̈ = −F_f − F_r,   J θ̈ = −l_a F_f + l_b F_r,   m_ui z̈_ui = F_i − F_ti,
        F_i = k_i e_i + laws,  e_f = z + l_a θ − z_uf,  e_r = z − l_b θ − z_ur.

    Paper 002 prints J θ̈ + l_a F_1 + l_b F_2 = 0: the sign of the last term is wrong, which makes the stiffness matrix
    asymmetric and the vehicle unstable. Here the matrices follow from the geometry. With J = m l_a l_b the ends move
    independently, as two quarter cars of sprung masses m l_b/(l_a + l_b) and m l_a/(l_a + l_b).

    Masses and rates are those of one side of the car. The wheels are front and rear, each for both sides of the road;
    the rear wheel reaches the road later.

    Arguments:
        front: corner at l_a.
        rear: corner at l_b.
        places: where on the body accelerations are of interest.
        seats: on the body.
        tyre_lifts: whether all tyres can lift off; for a single corner, set `tyre_lifts` of the corner.

    >>> from jaxdamp.vehicles.presets import half_car_002
    >>> car = half_car_002()
    >>> car.static_wheel_loads().round(1)  # (m l_b/L + m_u) g in front
    Array([3805. , 2667.4], dtype=float64)
    """

    sprung_mass: Number = parameter("kg", "mass of the body", positive, adjustable=False)
    pitch_inertia: Number = parameter("kg m²", "moment of inertia of the body in pitch", positive, adjustable=False)
    front_distance: Number = parameter("m", "front axle ahead of the centre of gravity", positive, adjustable=False)
    rear_distance: Number = parameter("m", "rear axle behind the centre of gravity", positive, adjustable=False)
    front: Corner
    rear: Corner
    places: tuple[Place, ...] = ()
    seats: tuple[Seat, ...] = ()
    tyre_lifts: bool = eqx.field(static=True, default=False)

    def frame(self) -> Frame:
        """Coordinates z_sprung, pitch, z_front_unsprung, z_rear_unsprung, then seats; wheels front, rear."""
        body = Body("sprung", self.sprung_mass, pitch_inertia=self.pitch_inertia)
        wheelbase = self.front_distance + self.rear_distance
        front = self.front.parts("front", body.at(self.front_distance))
        rear = self.rear.parts("rear", body.at(-self.rear_distance), behind=wheelbase)
        bodies, links = seat_parts(self.seats, body)
        suspensions, tyres = (front[1], rear[1], *links), (front[2], rear[2])
        return Frame((body, front[0], rear[0], *bodies), suspensions, tyres, self.places).lifting(self.tyre_lifts)
