"""A tyre that can lift off the road."""

from typing import final

import jax.numpy as jnp

from jaxdamp._smooth import ramp
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers import AbstractDamper, AbstractStateless, AbstractWrapper, Traits
from jaxdamp.parameters import nonnegative, positive, setting


@final
class LiftOff(AbstractStateless):
    """The correction of a linear tyre force for lift-off: a tyre can only push.

    With the linear tyre force L = k_t d + c_t ḋ [N], d = z_u − z_r [m], the contact force is N_c = r(W − L) ≥ 0, where
    W is the static load and r a smooth ramp of width w = 1 % of W. The tyre force is then F_t = W − N_c, and with r(u)
    = u + r(−u) its difference from the linear force is

        F(d, ḋ) = F_t − L = −r(L − W) + r(−W),

    whose last term makes F(0, 0) = 0 (it is 4e-44 W). On the road, at L < 0.8 W, F is below 1e-8 W; in the air F_t = W:
    the wheel falls freely. The ramp applies to spring and dashpot together, so the dashpot cannot pull either.

    >>> law = LiftOff(tyre_stiffness=200e3, tyre_damping=0.0, static_load=3000.0)
    >>> [round(float(200e3 * d + law.force_stroke_velocity(d, 0.0)), 3) for d in (-0.02, 0.0, 0.01, 0.05)]
    [-4000.0, 0.0, 2000.0, 3000.0]
    """

    tyre_stiffness: Number = setting("N/m", "vertical tyre stiffness", positive)
    tyre_damping: Number = setting("N s/m", "vertical tyre damping", nonnegative)
    static_load: Number = setting("N", "load of the wheel at rest", positive)
    width: Number = setting("", "share of the static load over which the contact ends", positive, default=0.01)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] in addition to the linear tyre, at deflection x [m], positive in extension, and rate v [m/s]."""
        return self.beside(self.tyre_stiffness * x + self.tyre_damping * v)

    def beside(self, force: ScalarLike) -> Scalar:
        """Force [N] that must be added to the force of spring and dashpot so that the tyre never pulls."""
        width = self.width * self.static_load
        return ramp(-self.static_load, width) - ramp(force - self.static_load, width)

    def contact_force(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force between tyre and road [N], never negative."""
        linear = self.tyre_stiffness * x + self.tyre_damping * v
        return jnp.asarray(ramp(self.static_load - linear, self.width * self.static_load))


@final
class LiftOffWithLaws(AbstractWrapper):
    """The correction for lift-off of a wheel with laws between it and the road: their total force can only push.

    As `LiftOff`, with the sum of the linear force and the force D of the laws instead of the linear force,
    F = −r(L + D − W) + r(−W). The laws are computed here a second time, with the same states.

    A wheel without mass, as of a `TrackedHull`, exerts no force on the vehicle in the air. The stroke of its laws still
    follows the ground, so their own channels have no meaning in the air, and contact begins again when the total force
    becomes a push.

    Arguments:
        linear: the correction for the linear spring and dashpot.
        law: the sum of the laws between wheel and road.
    """

    linear: LiftOff
    law: AbstractDamper

    def inner_law(self) -> AbstractDamper:
        """The laws parallel to the tyre."""
        return self.law

    def traits(self) -> Traits:
        """Those of the laws, and of the tyre, whose contact force is nonlinear."""
        return super().traits()._replace(has_feed_through=True, stroke_dependent=True, stroke_dependent_at_rest=True)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        spring = self.linear.tyre_stiffness * x + self.linear.tyre_damping * v
        return self.linear.beside(spring + self.law.force(x, v, state))
