"""Any law whose force falls in motion and recovers at rest: a thixotropic fluid."""

from typing import final

import jax.numpy as jnp

from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._steps import travels
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import parameter, positive


@final
class Thinned(AbstractWrapper):
    """F = (1 − s) F_law, τ ṡ = (1 − s) |v|/v_s − s: motion breaks the structure of a fluid, which recovers at rest.

    s, between 0 and 1, is the share of the structure that is broken. In steady motion it is |v|/(|v| + v_s), so that
    the force is F_law/(1 + |v|/v_s); in an oscillation much faster than τ it keeps the value of the mean speed, and the
    curve of force over velocity is that of the law inside, only smaller. This is the structure kinetics of thixotropic
    fluids (Moore 1959; Mewis and Wagner 2009): λ̇ = (1 − λ)/τ − k |v| λ with λ = 1 − s and k = 1/(v_s τ). Around
    `ViscoPlastic`, the yield curve of Herschel and Bulkley, it describes a magnetorheological damper without current.

    A law that dissipates at every instant still does; one that stores energy in elastic elements may give back more
    than it took while the structure recovers.

    State: s, then the states of the law. The step is exact for a constant speed, second order in general, and stable
    for any τ.

    Arguments:
        law: the force of the fluid that is at rest for long.
        thinning_velocity: v_s [m/s], steady speed that halves the force.
        recovery_time: τ [s].

    >>> from jaxdamp.dampers import Linear
    >>> law = Thinned(Linear(2000.0), thinning_velocity=0.1, recovery_time=0.5)
    >>> steady = law.advance(0.0, 0.3, 0.0, 0.3, law.initial_state(), 100.0)
    >>> round(float(law.force(0.0, 0.3, steady)), 6)  # 600 N/(1 + 3)
    150.0
    """

    law: AbstractDamper
    thinning_velocity: Number = parameter("m/s", "v_s, steady speed that halves the force", positive, adjustable=False)
    recovery_time: Number = parameter("s", "τ, time in which the force recovers at rest", positive, adjustable=False)

    def is_linear_in_law(self) -> bool:
        """The structure does not depend on the force."""
        return True

    def own_state_count(self) -> int:
        """The broken share."""
        return 1

    def traits(self) -> Traits:
        """The rate of the structure has a kink where the velocity changes its sign."""
        return super().traits()._replace(extrapolable_states=False)

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same motion; the force inside is not known."""
        return [(self.law, motion.with_force(None))]

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        (broken,), inner = self.split(state)
        return (1.0 - broken) * self.law.force(x, v, inner)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """ṡ [1/s], then the rates of the law."""
        (broken,), inner = self.split(state)
        rate = ((1.0 - broken) * jnp.abs(v) / self.thinning_velocity - broken) / self.recovery_time
        return jnp.concatenate([rate[None], self.law.state_rate(x, v, inner)])

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Exact for a constant speed; the step of the law."""
        (broken,), inner = self.split(state)
        before, after = travels(v0, v1, dt)
        strain = (jnp.abs(before) + jnp.abs(after)) / self.thinning_velocity  # |v|/v_s, times dt
        steady = strain / (dt + strain)
        broken = steady + (broken - steady) * jnp.exp(-(dt + strain) / self.recovery_time)
        return jnp.concatenate([broken[None], self.law.advance(x0, v0, x1, v1, inner, dt)])
