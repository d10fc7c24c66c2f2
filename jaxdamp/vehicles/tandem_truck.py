"""A truck with a front axle and two axles close together behind, seen from the side."""

from typing import final

import equinox as eqx

from jaxdamp._types import Number
from jaxdamp.parameters import parameter, positive
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.cab import Cab
from jaxdamp.vehicles.corner import Corner
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Body, Place
from jaxdamp.vehicles.seat import Seat, seat_parts
from jaxdamp.vehicles.tandem import IndependentTandem, WalkingBeam


@final
class TandemTruck(AbstractVehicle):
    """Sprung mass with heave z and pitch θ on a front axle and a tandem, with or without a cab.

        m z̈ = −F_f − P,   J θ̈ = −l_f F_f + l_t P,

    l_f ahead of and l_t behind the centre of gravity, P the force of the tandem. Masses, rates and laws are those of
    both sides together; with `Corner.damper_count` the law and its channels are those of one damper of an axle (see
    `vehicle.descriptions`). The wheels are front, first and second axle of the tandem.

    Arguments:
        front: the front axle.
        tandem: a `WalkingBeam` or an `IndependentTandem`.
        cab: a cab on its own mounts, or None.
        places: where on the body, or on the cab (`body="cab"`), accelerations are of interest.
        seats: on the sprung mass.
        tyre_lifts: whether all tyres can lift off; for a single corner, set `tyre_lifts` of the corner.

    >>> from jaxdamp.vehicles.presets import truck_001
    >>> truck_001().coordinates
    ('z_sprung', 'pitch', 'z_front_unsprung', 'z_beam', 'beam_pitch')
    """

    sprung_mass: Number = parameter("kg", "sprung mass", positive, adjustable=False)
    pitch_inertia: Number = parameter(
        "kg m²", "moment of inertia of the sprung mass in pitch", positive, adjustable=False
    )
    front_distance: Number = parameter("m", "front axle ahead of the centre of gravity", positive, adjustable=False)
    tandem_distance: Number = parameter(
        "m", "middle of the tandem behind the centre of gravity", positive, adjustable=False
    )
    front: Corner
    tandem: WalkingBeam | IndependentTandem
    cab: Cab | None = None
    places: tuple[Place, ...] = ()
    seats: tuple[Seat, ...] = ()
    tyre_lifts: bool = eqx.field(static=True, default=False)

    def frame(self) -> Frame:
        """Coordinates z_sprung, pitch, then front axle, tandem, cab, seats; wheels front, tandem_1, tandem_2."""
        body = Body("sprung", self.sprung_mass, pitch_inertia=self.pitch_inertia)
        front, suspension, tyre = self.front.parts("front", body.at(self.front_distance), sides=2)
        behind = self.front_distance + self.tandem_distance
        axles, leaves, tyres = self.tandem.parts(body, -self.tandem_distance, behind)
        cab, mounts = ((), ()) if self.cab is None else self.cab.parts(body)
        bodies, links = seat_parts(self.seats, body)
        return Frame(
            (body, front, *axles, *cab, *bodies),
            (suspension, *leaves, *mounts, *links),
            (tyre, *tyres),
            self.places,
        ).lifting(self.tyre_lifts)
