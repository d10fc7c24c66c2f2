"""A truck with a front axle, two axles close together behind and a cab, seen from the side."""

from typing import final

import equinox as eqx

from jaxdamp._types import Number, ScalarLike
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import nonnegative, parameter, positive
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.corner import Corner
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import AbstractPart, Body, Link, Parts, Place, Wheel
from jaxdamp.vehicles.suspension import Seat, Suspension, seat_parts


@final
class WalkingBeam(AbstractPart):
    """Two axles at the ends of a beam with a leaf spring at its middle: both wheels carry the same load at rest.

    m_b z̈_b = P − F_t1 − F_t2,  J_b ψ̈ = −(s/2)(F_t1 − F_t2), with the force P of the spring and of the laws at the
    middle. Only the tyres damp the pitch of the beam: with c_t = 0 its mode √(k_t s²/(2 J_b)) is undamped, the known
    weakness of walking beams.

    Arguments:
        mass: m_b of beam, axles and wheels together [kg].
        pitch_inertia: J_b [kg m²]; m_b s²/4 if the whole mass is in the axles.
        spread: s, distance between the two axles [m].
        spring_rate: rate of the leaf spring, both sides together [N/m].
        tyre_stiffness: k_t of each axle [N/m].
        damper: law at the middle, both sides together; None for a beam without dampers.
        tyre_damping: vertical damping of the tyres of each axle [N s/m].
        tyre_lifts: whether the tyres can lift off.
        extra_spring: law parallel to the leaf spring, both sides together.
        bump_stop: law at the middle, both sides together.
        friction: law at the middle, such as that of the leaves, both sides together.
    """

    mass: Number = parameter("kg", "mass of beam, axles and wheels", positive, adjustable=False)
    pitch_inertia: Number = parameter("kg m²", "moment of inertia of the beam in pitch", positive, adjustable=False)
    spread: Number = parameter("m", "distance between the two axles", positive, adjustable=False)
    spring_rate: Number = parameter("N/m", "rate of the leaf spring", positive)
    tyre_stiffness: Number = parameter("N/m", "vertical tyre stiffness of an axle", positive, adjustable=False)
    damper: AbstractDamper | None = None
    tyre_damping: Number = parameter(
        "N s/m", "vertical tyre damping of an axle", nonnegative, default=0.0, adjustable=False
    )
    tyre_lifts: bool = eqx.field(static=True, default=False)
    extra_spring: AbstractDamper | None = None
    bump_stop: AbstractDamper | None = None
    friction: AbstractDamper | None = None

    def parts(self, body: Body, ahead: ScalarLike | int, behind: ScalarLike | int) -> Parts:
        """The beam under a point `ahead` of the centre of gravity, its middle `behind` the front axle [m]."""
        beam, half = Body("beam", self.mass, pitch_inertia=self.pitch_inertia), 0.5 * self.spread
        laws = self.damper, self.extra_spring, self.bump_stop, self.friction
        leaf = Suspension(self.spring_rate, *laws).link("tandem", body.at(ahead) - beam.at(), sides=2)
        tyres = tuple(
            Wheel(
                f"tandem_{i}",
                beam.at(forward),
                self.tyre_stiffness,
                self.tyre_damping,
                behind - forward,
                lifts=self.tyre_lifts,
                sides=2,
            )
            for i, forward in ((1, half), (2, -half))
        )
        return (beam,), (leaf,), tyres


@final
class IndependentTandem(AbstractPart):
    """Two equal axles, each with its own spring and damper.

    Arguments:
        axle: each of the two axles; masses and rates are those of the whole axle.
        spread: distance between the two axles [m].
    """

    axle: Corner
    spread: Number = parameter("m", "distance between the two axles", positive, adjustable=False)

    def parts(self, body: Body, ahead: ScalarLike | int, behind: ScalarLike | int) -> Parts:
        """The axles about a point `ahead` of the centre of gravity, `behind` the front axle [m]."""
        half = 0.5 * self.spread
        axles = [
            self.axle.parts(f"tandem_{i}", body.at(ahead + forward), behind=behind - forward, sides=2)
            for i, forward in ((1, half), (2, -half))
        ]
        bodies, links, tyres = zip(*axles, strict=True)
        return bodies, links, tyres


@final
class Cab(AbstractPart):
    """A cab with heave and pitch on two mounts, front and rear.

    Arguments:
        mass: mass of the cab [kg].
        pitch_inertia: moment of inertia in pitch [kg m²].
        ahead: centre of gravity of the cab ahead of that of the sprung mass [m].
        front_distance: front mount ahead of the centre of gravity of the cab [m].
        rear_distance: rear mount behind the centre of gravity of the cab [m].
        front_rate: spring rate of the front mount, both sides together [N/m].
        rear_rate: spring rate of the rear mount, both sides together [N/m].
        front_damper: law at the front mount, both sides together.
        rear_damper: law at the rear mount, both sides together.
        front_extra_spring: law parallel to the spring of the front mount; as all laws, both sides together.
        rear_extra_spring: law parallel to the spring of the rear mount.
        front_bump_stop: bump stop of the front mount.
        rear_bump_stop: bump stop of the rear mount.
        front_friction: friction of the front mount.
        rear_friction: friction of the rear mount.
    """

    mass: Number = parameter("kg", "mass of the cab", positive, adjustable=False)
    pitch_inertia: Number = parameter("kg m²", "moment of inertia of the cab in pitch", positive, adjustable=False)
    ahead: Number = parameter("m", "cab ahead of the centre of gravity of the sprung mass", adjustable=False)
    front_distance: Number = parameter(
        "m", "front mount ahead of the cab's centre of gravity", positive, adjustable=False
    )
    rear_distance: Number = parameter("m", "rear mount behind the cab's centre of gravity", positive, adjustable=False)
    front_rate: Number = parameter("N/m", "spring rate of the front mount", positive)
    rear_rate: Number = parameter("N/m", "spring rate of the rear mount", positive)
    front_damper: AbstractDamper
    rear_damper: AbstractDamper
    front_extra_spring: AbstractDamper | None = None
    rear_extra_spring: AbstractDamper | None = None
    front_bump_stop: AbstractDamper | None = None
    rear_bump_stop: AbstractDamper | None = None
    front_friction: AbstractDamper | None = None
    rear_friction: AbstractDamper | None = None

    def parts(self, body: Body) -> tuple[tuple[Body], tuple[Link, ...]]:
        """The cab and its mounts on a body."""
        cab = Body("cab", self.mass, pitch_inertia=self.pitch_inertia)
        front = self.front_damper, self.front_extra_spring, self.front_bump_stop, self.front_friction
        rear = self.rear_damper, self.rear_extra_spring, self.rear_bump_stop, self.rear_friction
        mounts = (
            ("cab_front", self.front_distance, Suspension(self.front_rate, *front)),
            ("cab_rear", -self.rear_distance, Suspension(self.rear_rate, *rear)),
        )
        links = tuple(mount.link(name, cab.at(x) - body.at(self.ahead + x), sides=2) for name, x, mount in mounts)
        return (cab,), links


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
