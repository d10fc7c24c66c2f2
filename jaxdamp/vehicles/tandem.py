"""The tandem axles of a truck: on a walking beam, or each with its own suspension."""

from typing import Any, final

import equinox as eqx

from jaxdamp._types import Number
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import nonnegative, parameter, positive
from jaxdamp.vehicles.corner import Corner
from jaxdamp.vehicles.parts import AbstractPart, Body, Parts, Wheel
from jaxdamp.vehicles.suspension import Suspension


@final
class WalkingBeam(AbstractPart):
    """Two axles at the ends of a beam with a leaf spring at its middle: both wheels carry the same load at rest.

    m_b z̈_b = P − F_t1 − F_t2,  J_b ψ̈ = −(s/2)(F_t1 − F_t2), with the force P of the spring and of the damper at the
    middle. Only the tyres damp the pitch of the beam: with c_t = 0 its mode √(k_t s²/(2 J_b)) is undamped, the known
    weakness of walking beams.

    Arguments:
        mass: m_b of beam, axles and wheels together [kg].
        pitch_inertia: J_b [kg m²]; m_b s²/4 if the whole mass is in the axles.
        spread: s, distance between the two axles [m].
        spring_rate: rate of the leaf spring, both sides together [N/m].
        tyre_stiffness: k_t of each axle [N/m].
        damper: law at the middle, both sides together.
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
    damper: AbstractDamper
    tyre_damping: Number = parameter(
        "N s/m", "vertical tyre damping of an axle", nonnegative, default=0.0, adjustable=False
    )
    tyre_lifts: bool = eqx.field(static=True, default=False)
    extra_spring: AbstractDamper | None = None
    bump_stop: AbstractDamper | None = None
    friction: AbstractDamper | None = None

    def parts(self, body: Body, ahead: Any, behind: Any) -> Parts:
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

    def parts(self, body: Body, ahead: Any, behind: Any) -> Parts:
        """The axles about a point `ahead` of the centre of gravity, `behind` the front axle [m]."""
        half = 0.5 * self.spread
        axles = [
            self.axle.parts(f"tandem_{i}", body.at(ahead + forward), behind=behind - forward, sides=2)
            for i, forward in ((1, half), (2, -half))
        ]
        bodies, links, tyres = zip(*axles, strict=True)
        return bodies, links, tyres
