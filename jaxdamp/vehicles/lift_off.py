"""A tyre that can leave the road."""

from typing import final

import jax.numpy as jnp

from jaxdamp._smooth import ramp
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers import AbstractDamper, AbstractStateless, AbstractWrapper, Traits
from jaxdamp.parameters import nonnegative, positive, setting


@final
class LiftOff(AbstractStateless):
    """What a tyre that can leave the road has beside its linear spring and dashpot: a tyre only pushes.

    Of the linear tyre force L = k_t d + c_t ḋ [N], d = z_u − z_r [m], the road takes the contact force
    N_c = r(W − L) ≥ 0 with the static load W and the smooth ramp r of width w = 1 % of W. The tyre force is then
    F_t = W − N_c, and with r(u) = u + r(−u) the part beside the linear one is

        F(d, ḋ) = F_t − L = −r(L − W) + r(−W),

    whose last term makes F(0, 0) = 0 (it is 4e-44 W). On the road, at L < 0.8 W, F is below 1e-8 W; in the air F_t = W:
    the wheel falls freely. The ramp is around spring and dashpot together, so that the dashpot cannot pull either.

    >>> law = LiftOff(tyre_stiffness=200e3, tyre_damping=0.0, static_load=3000.0)
    >>> [round(float(200e3 * d + law.force_stroke_velocity(d, 0.0)), 3) for d in (-0.02, 0.0, 0.01, 0.05)]
    [-4000.0, 0.0, 2000.0, 3000.0]
    """

    tyre_stiffness: Number = setting("N/m", "vertical tyre stiffness", positive)
    tyre_damping: Number = setting("N s/m", "vertical tyre damping", nonnegative)
    static_load: Number = setting("N", "load of the wheel at rest", positive)
    width: Number = setting("", "share of the static load over which the contact ends", positive, default=0.01)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] beside the linear tyre at deflection x [m], positive when stretched, and rate v [m/s]."""
        return self.beside(self.tyre_stiffness * x + self.tyre_damping * v)

    def beside(self, force: ScalarLike) -> Scalar:
        """Force [N] beside one that would pull the wheel and the road together, so that both only push."""
        width = self.width * self.static_load
        return ramp(-self.static_load, width) - ramp(force - self.static_load, width)

    def contact_force(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force between tyre and road [N], never negative."""
        linear = self.tyre_stiffness * x + self.tyre_damping * v
        return jnp.asarray(ramp(self.static_load - linear, self.width * self.static_load))


@final
class LiftOffWithLaws(AbstractWrapper):
    """What a wheel with laws between it and the road has beside them and its spring: all together, they only push.

    As `LiftOff`, with the sum of the linear force and of the laws D in place of the linear force alone,
    F = −r(L + D − W) + r(−W). The laws run here a second time, with states that are those of the laws themselves.

    A wheel without mass, as of a `TrackedHull`, carries nothing in the air: this is its force on the vehicle. The laws
    are driven as if the wheel still followed the ground, so in the air their own channels say nothing, and the wheel
    touches down where the force becomes a push again.

    Arguments:
        linear: of the linear spring and dashpot.
        law: beside them, the sum of all.
    """

    linear: LiftOff
    law: AbstractDamper

    def inner_law(self) -> AbstractDamper:
        """The laws beside the tyre."""
        return self.law

    def traits(self) -> Traits:
        """Those of the laws, and of the tyre, whose force on the road is not linear."""
        return super().traits()._replace(has_feed_through=True, stroke_dependent=True, stroke_dependent_at_rest=True)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        spring = self.linear.tyre_stiffness * x + self.linear.tyre_damping * v
        return self.linear.beside(spring + self.law.force(x, v, state))
