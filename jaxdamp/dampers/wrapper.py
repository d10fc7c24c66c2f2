"""The base class of laws around one inner law."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, ScalarLike, State
from jaxdamp._vectors import joined
from jaxdamp.dampers._states import refuse_number
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits


class AbstractWrapper(AbstractDamper):
    """A law around one inner law, to which all calls are passed on unless the wrapper overrides them.

    A wrapper that changes stroke, velocity or force overrides `inner_motion`, `outer_force` or both. A wrapper with its
    own states, which come before those of the inner law, declares their number in `own_state_count` and defines
    `force`, `state_rate` and `advance`.
    """

    def inner_law(self) -> AbstractDamper:
        """The law inside; by default the only field that is a law."""
        (law,) = self.inner_laws()
        return law

    def inner_motion(self, x: ScalarLike, v: ScalarLike) -> tuple[ScalarLike, ScalarLike]:
        """Stroke [m] and velocity [m/s] of the law inside."""
        return x, v

    def outer_force(self, force: Scalar) -> Scalar:
        """Force [N] of the wrapper for a force [N] of the law inside."""
        return force

    def own_state_count(self) -> int:
        """Number of states of the wrapper itself, which are zero at rest."""
        return 0

    def split(self, state: State) -> tuple[tuple[Scalar, ...], Float[Array, " inner"]]:
        """The wrapper's own states, and those of the law inside."""
        count = self.own_state_count()
        if state.size < count:
            refuse_number(state, f"{count} state{'s' * (count > 1)} of {type(self).__name__} first")
        return tuple(state[i] for i in range(count)), state[count:]

    def is_linear_in_law(self) -> bool:
        """Whether the force is linear in the force of the law inside.

        The wrapper around a sum is then the sum of the wrappers around its terms, and linear parameters stay linear.
        """
        return False

    def traits(self) -> Traits:
        """The traits of the law inside."""
        inner = self.inner_law().traits()
        return inner._replace(linear_in_parameters=inner.linear_in_parameters and self.is_linear_in_law())

    def side_by_side(self) -> tuple[AbstractDamper, ...]:
        """The wrapper around each term of a sum inside, if the force is linear in the force of the law inside."""
        if not self.is_linear_in_law():
            return (self,)
        return tuple(
            eqx.tree_at(lambda whole: whole.inner_law(), self, term) for term in self.inner_law().side_by_side()
        )

    @property
    def stroke_limits(self) -> tuple[ScalarLike, ScalarLike]:
        """Strokes [m] within which the law inside is valid."""
        return self.inner_law().stroke_limits

    def initial_state(self) -> State:
        """Own states at zero, then those of the law inside."""
        inner = self.inner_law().initial_state()
        count = self.own_state_count()
        return joined([jnp.zeros(count), inner]) if count else inner

    def state_at_rest(self, x: ScalarLike) -> State:
        """Own states as in `initial_state`, then those of the law inside at rest."""
        stroke, _ = self.inner_motion(x, jnp.zeros_like(x))
        inner = self.inner_law().state_at_rest(stroke)
        count = self.own_state_count()
        return joined([self.initial_state()[:count], inner]) if count else inner

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        return self.outer_force(self.inner_law().force(*self.inner_motion(x, v), state))

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of the law inside."""
        return self.inner_law().state_rate(*self.inner_motion(x, v), state)

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """The step of the law inside."""
        return self.inner_law().advance(*self.inner_motion(x0, v0), *self.inner_motion(x1, v1), state, dt)

    def predict(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """The prediction of the law inside; for a wrapper with own states, the step itself."""
        if self.own_state_count():
            return self.advance(x0, v0, x1, v1, state, dt)
        return self.inner_law().predict(*self.inner_motion(x0, v0), *self.inner_motion(x1, v1), state, dt)
