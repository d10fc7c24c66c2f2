"""A suspension between two points of a vehicle: a spring, a damper and optional further laws."""

from typing import final

import equinox as eqx

from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers import AbstractDamper, AbstractStateless, Traits
from jaxdamp.parameters import nonnegative, parameter, positive
from jaxdamp.vehicles.parts import AbstractPart, Element, Link, Point


@final
class CubicSpring(AbstractStateless):
    """F = k₂ x² + k₃ x³: the nonlinear part of a progressive spring, parallel to its linear rate.

    Its tangent rate is k + 2 k₂ x + 3 k₃ x² with the linear rate k of the vehicle. With k₂ < 0 it is stiffer in
    compression than in extension; the total rate is positive at every stroke if k₂² < 3 k k₃. No energy is dissipated.

    >>> float(CubicSpring(quadratic_stiffness=-1e5, cubic_stiffness=2e6).force_stroke_velocity(-0.1, 0.0))
    -3000.0
    """

    quadratic_stiffness: Number = parameter("N/m²", "k₂, quadratic stiffness", default=0.0, linear=True)
    cubic_stiffness: Number = parameter("N/m³", "k₃, cubic stiffness", nonnegative, default=0.0, linear=True)

    def traits(self) -> Traits:
        """Independent of the velocity."""
        return super().traits()._replace(has_feed_through=False)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m], independent of the velocity."""
        del v
        return (self.quadratic_stiffness + self.cubic_stiffness * x) * x * x


@final
class Suspension(AbstractPart):
    """A spring, a damper and optional parallel laws, between a wheel and the body or under a cab or a seat.

    Arguments:
        spring_rate: rate of the linear spring [N/m].
        damper: law; `dampers.MotionRatio(law, ratio)` if the damper has another travel than the suspension.
        extra_spring: law parallel to the linear spring, such as `CubicSpring` or `dampers.GasSpring`.
        bump_stop: law such as `dampers.BumpStop`.
        friction: law such as `dampers.CoulombFriction`.
        damper_count: number of equal dampers; the channels of force and power are those of one.

    >>> from jaxdamp.dampers import BumpStop, Linear
    >>> from jaxdamp.vehicles import Body
    >>> body, axle = Body("sprung", 600.0), Body("unsprung", 60.0)
    >>> suspension = Suspension(45e3, Linear(3000.0), bump_stop=BumpStop(clearance=0.06, stiffness=5e4))
    >>> [element.name for element in suspension.link("", body.at() - axle.at()).elements]
    ['damper', 'bump_stop']
    """

    spring_rate: Number = parameter("N/m", "spring rate", positive)
    damper: AbstractDamper | None = None
    extra_spring: AbstractDamper | None = None
    bump_stop: AbstractDamper | None = None
    friction: AbstractDamper | None = None
    damper_count: int = eqx.field(static=True, default=1)

    @property
    def elements(self) -> tuple[Element, ...]:
        """Its laws."""
        named = [("damper", self.damper, self.damper_count), ("extra_spring", self.extra_spring, 1)]
        named += [("bump_stop", self.bump_stop, 1), ("friction", self.friction, 1)]
        return tuple(Element(name, law, count) for name, law, count in named if law is not None)

    def link(self, name: str, extension: Point, *, sides: int = 1) -> Link:
        """The suspension as a link; its extension is the upper point minus the lower point."""
        return Link(name, extension, self.spring_rate, elements=self.elements, sides=sides)
