"""A law with a first-order lag of the force."""

from typing import final

import jax.numpy as jnp

from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp._vectors import joined
from jaxdamp.dampers._steps import follow
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import parameter, positive


@final
class Lag(AbstractWrapper):
    """τ Ḟ + F = F_law: the force of any law with a first-order lag. One state, the force.

    Compressibility of oil and hoses delays the force. For a linear law the loop of a sine is that of a
    spring c/τ in series; |F(v = 0)|/F_peak = ωτ/√(1 + (ωτ)²). The step is exact for a law force that is linear over
    the step, so any τ is stable and τ ≪ dt gives the law itself.

    >>> from jaxdamp.dampers import Linear
    >>> Lag(Linear(2000.0), lag_time=0.004).initial_state().shape
    (1,)
    """

    law: AbstractDamper
    lag_time: Number = parameter("s", "time constant of the lag", positive, adjustable=False)

    def is_linear_in_law(self) -> bool:
        """A lag is linear."""
        return True

    def own_state_count(self) -> int:
        """The force [N]."""
        return 1

    def traits(self) -> Traits:
        """The force is a state, which is smooth where the velocity has a kink."""
        return super().traits()._replace(has_feed_through=False)

    def state_at_rest(self, x: ScalarLike) -> State:
        """The force of the law at rest [N], and its states."""
        inner = self.law.state_at_rest(x)
        return joined([self.law.force(x, jnp.zeros_like(x), inner)[None], inner])

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        del x, v
        (force,), _ = self.split(state)
        return force

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of the force [N/s] and of the law's states."""
        (force,), inner = self.split(state)
        rate = (self.law.force(x, v, inner) - force) / self.lag_time
        return jnp.concatenate([rate[None], self.law.state_rate(x, v, inner)])

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Exact for a law force linear over the step."""
        (force,), inner = self.split(state)
        before = self.law.force(x0, v0, inner)
        inner = self.law.advance(x0, v0, x1, v1, inner, dt)
        after = self.law.force(x1, v1, inner)
        force = follow(force, before, after, dt, self.lag_time)
        return jnp.concatenate([force[None], inner])
