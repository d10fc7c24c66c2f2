"""Laws without states whose force depends on the stroke as well as on the velocity."""

from abc import abstractmethod

import jax.numpy as jnp

from jaxdamp._types import Scalar, ScalarLike, State
from jaxdamp.dampers.base import AbstractDamper, _check_stateless


class AbstractStateless(AbstractDamper):
    """A law whose force depends on stroke and velocity at this instant: it has one method, `force_stroke_velocity`."""

    @abstractmethod
    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m] and velocity v [m/s]."""

    def initial_state(self) -> State:
        """No states."""
        return jnp.zeros(0)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N] at stroke x [m] and velocity v [m/s]."""
        _check_stateless(self, state)
        return self.force_stroke_velocity(x, v)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """No states."""
        del x, v
        _check_stateless(self, state)
        return state

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """No states."""
        del x0, v0, x1, v1, dt
        _check_stateless(self, state)
        return state
