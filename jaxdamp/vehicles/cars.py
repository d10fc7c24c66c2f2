"""Cars: a quarter, a half (pitch), one axle (roll) and the whole."""

from typing import final

import equinox as eqx

from jaxdamp._types import Number, Scalar
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import parameter, positive
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.corner import AbstractCorner, Axle, Corner
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Body, Place
from jaxdamp.vehicles.suspension import Seat, seat_parts


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
        damper: law at the wheel; `dampers.MotionRatio(law, ratio)` if the damper has another travel than the wheel,
            `dampers.Linkage(law, travel, ratio)` if their ratio changes with the stroke.
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

    damper: AbstractDamper  # pyright: ignore[reportIncompatibleVariableOverride]  # never None
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
