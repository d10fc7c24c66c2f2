"""The friction law of Dahl: elastic before sliding."""

from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._guesses import ELASTIC_TRAVEL, sliding_fit
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers._steps import direction, travels
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.parameters import parameter, positive


def dahl_step(travel: ScalarLike, force: ScalarLike, stiffness: ScalarLike, friction: ScalarLike) -> Scalar:
    """F [N] after a travel [m] in one direction, exact: ±F_c is approached with exp(−σ₀ |travel|/F_c)."""
    sign = direction(travel)
    sliding = sign * friction
    return sliding + (force - sliding) * jnp.exp(-stiffness * sign * travel / friction)


@final
class Dahl(AbstractDamper):
    """Ḟ = σ₀ (v − |v| F/F_c) (Dahl 1968, exponent 1): dry friction of seals and guides with an elastic contact.

    For small travel it is a spring of stiffness σ₀, for large it saturates at ±F_c; the force depends on the travel and
    its reversals, not on the rate. It dissipates energy over a full cycle. Unlike `CoulombFriction` it holds a load at
    rest. Use it parallel to a viscous law, `Linear(...) + Dahl(...)`.

    State: the force [N]. The step is exact for a velocity linear over the step, a reversal included, so that
    F_c/σ₀ may be much smaller than the travel of a step. Inside a `SeriesSpring` it needs a parallel law with viscous
    damping.

    >>> law = Dahl(stiffness=4e5, friction_force=40.0)
    >>> state = law.advance(0.0, 0.1, 1e-4, 0.1, law.initial_state(), 1e-3)
    >>> round(float(law.force(1e-4, 0.1, state)), 6)
    25.284822
    """

    stiffness: Number = parameter("N/m", "σ₀, stiffness of the contact at rest", positive, adjustable=False)
    friction_force: Number = parameter("N", "F_c, sliding friction", positive, adjustable=False)

    def traits(self) -> Traits:
        """The force is a state."""
        return Traits(has_feed_through=False, stroke_dependent_at_rest=False)

    def initial_state(self) -> State:
        """No force."""
        return jnp.zeros(1)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        del x, v
        return own_states(self, state, 1)[0]

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Ḟ [N/s]."""
        del x
        (force,) = own_states(self, state, 1)
        return (self.stiffness * (v - jnp.abs(v) * force / self.friction_force))[None]

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Exact for a velocity linear over the step."""
        del x0, x1
        (force,) = own_states(self, state, 1)
        for travel in travels(v0, v1, dt):
            force = dahl_step(travel, force, self.stiffness, self.friction_force)
        return force[None]

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "Dahl":
        """Start values from measured data: friction at high velocities, elastic contact over 0.5 mm."""
        level = sliding_fit(velocity, force)[1]
        return cls(level / ELASTIC_TRAVEL, level)
