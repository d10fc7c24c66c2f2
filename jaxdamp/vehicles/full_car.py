"""A whole car: body with heave, pitch and roll on four wheels."""

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
class FullCar(AbstractVehicle):
    """Seven degrees of freedom: heave z, pitch θ (nose up), roll φ (left side up), four wheels.

        m z̈ = −Σ F_i,   J_θ θ̈ = −Σ x_i F_i,   J_φ φ̈ = −Σ y_i F_i − M_f − M_r,   m_ui z̈_ui = F_i − F_ti ± M/w,

    with corner i x_i ahead and y_i left of the centre of gravity, at z + x_i θ + y_i φ, and the moments M of the
    anti-roll bars (`Axle`). Left and right are equal; for different sides, use a `LumpedVehicle`.

    The wheels are front left, front right, rear left, rear right.

    Arguments:
        front: axle at `front_distance`.
        rear: axle at `rear_distance`.
        places: where on the body accelerations are of interest.
        seats: on the body.
        tyre_lifts: whether all tyres can lift off; for a single corner, set `tyre_lifts` of the corner.

    >>> from jaxdamp.vehicles.presets import full_car_jazar
    >>> full_car_jazar().wheel_names
    ('front_left', 'front_right', 'rear_left', 'rear_right')
    """

    sprung_mass: Number = parameter("kg", "mass of the body", positive, adjustable=False)
    pitch_inertia: Number = parameter("kg m²", "moment of inertia of the body in pitch", positive, adjustable=False)
    roll_inertia: Number = parameter("kg m²", "moment of inertia of the body in roll", positive, adjustable=False)
    front_distance: Number = parameter("m", "front axle ahead of the centre of gravity", positive, adjustable=False)
    rear_distance: Number = parameter("m", "rear axle behind the centre of gravity", positive, adjustable=False)
    front: Axle
    rear: Axle
    places: tuple[Place, ...] = ()
    seats: tuple[Seat, ...] = ()
    tyre_lifts: bool = eqx.field(static=True, default=False)

    def frame(self) -> Frame:
        """Coordinates z_sprung, pitch, roll, then wheels (front left, front right, rear left, rear right), seats."""
        body = Body("sprung", self.sprung_mass, pitch_inertia=self.pitch_inertia, roll_inertia=self.roll_inertia)
        front = self.front.parts("front", body, ahead=self.front_distance)
        wheelbase = self.front_distance + self.rear_distance
        rear = self.rear.parts("rear", body, ahead=-self.rear_distance, behind=wheelbase)
        bodies, links = seat_parts(self.seats, body)
        return Frame(
            (body, *front[0], *rear[0], *bodies), (*front[1], *rear[1], *links), front[2] + rear[2], self.places
        ).lifting(self.tyre_lifts)
