"""A damper that is softer at high frequency than in slow motion."""

from typing import final

import jax.numpy as jnp

from jaxdamp._field_types import check_field_types
from jaxdamp._limits import at_least, within
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers._steps import follow
from jaxdamp.dampers.base import AbstractDamper, refuse_states
from jaxdamp.dampers.contract import Traits
from jaxdamp.parameters import parameter, positive


@final
class FrequencySelective(AbstractDamper):
    """τ_r Ḟ + F = F_high(v) + F_low(w), w = clip(s, 0, max(v, 0)), τ_f ṡ + s = v: a second valve reacts slowly.

    In slow rebound the filtered velocity s reaches v and both laws act; in fast oscillation s is near the mean
    velocity, zero, and only `high` acts, as always in compression. Without the response lag, the law is passive if both
    laws are.

    The frequency-selective damper of the FEDA truck in Project Chrono (FEDA_DoubleWishbone.cpp, 7689fbc0) has
    w = min(v, s) in rebound. The two are equal for s ≥ 0. For s < 0, just after compression, Chrono's F_low(s) jumps
    at v = 0 and acts in the direction of the rebound; here the force of the second valve is then zero.

    States: the filtered velocity s [m/s], the force [N]. Both steps are exact for inputs linear over the step, so all
    time constants are stable.

    Arguments:
        high: law without states that acts at all frequencies.
        low: law without states that is added in slow rebound.
        filter_time: τ_f [s] of the velocity. FEDA: 0.04 s. At 1/(2π τ_f) = 4 Hz, a linear second law dissipates half
            as much as in slow motion.
        response_time: τ_r [s] of the force. FEDA: 0.001 s.

    Raises:
        ValueError: laws with states.

    >>> from jaxdamp.dampers import Linear
    >>> law = FrequencySelective(Linear(2000.0), Linear(3000.0), filter_time=0.04, response_time=0.001)
    >>> settled = jnp.array([0.1, 500.0])
    >>> [round(float(law.state_rate(0.0, v, settled)[1]), 6) for v in (0.1, -0.25)]  # N/s
    [0.0, -1000000.0]
    """

    high: AbstractDamper
    low: AbstractDamper
    filter_time: Number = parameter("s", "τ_f, time constant of the velocity filter", positive, adjustable=False)
    response_time: Number = parameter("s", "τ_r, time constant of the force", positive, adjustable=False)

    def traits(self) -> Traits:
        """The force is a state, linear in that of the laws inside."""
        linear = self.high.traits().linear_in_parameters and self.low.traits().linear_in_parameters
        inside = super().traits()
        return inside._replace(has_feed_through=False, linear_in_parameters=linear)

    def __check_init__(self) -> None:
        check_field_types(self)
        for name in ("high", "low"):
            refuse_states(name, getattr(self, name), "Use a law without states here, and put the states outside.")

    def settled_force(self, x: ScalarLike, v: ScalarLike, filtered_velocity: ScalarLike) -> Scalar:
        """Force [N] that the response lag approaches."""
        slow = within(filtered_velocity, 0.0, at_least(v, 0.0))
        high, low = self.high, self.low
        return high.force(x, v, high.initial_state()) + low.force(x, slow, low.initial_state())

    def initial_state(self) -> State:
        """Zero velocity and no force."""
        return jnp.zeros(2)

    def state_at_rest(self, x: ScalarLike) -> State:
        """Zero velocity and the force of both laws at rest [N]."""
        still = jnp.zeros_like(x)
        return jnp.stack([still, self.settled_force(x, still, still)])

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        del x, v
        return own_states(self, state, 2)[1]

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of the filtered velocity [m/s²] and of the force [N/s]."""
        slow, force = own_states(self, state, 2)
        target = self.settled_force(x, v, slow)
        return jnp.stack([(v - slow) / self.filter_time, (target - force) / self.response_time])

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Each lag exact for an input linear over the step."""
        slow, force = own_states(self, state, 2)
        before = self.settled_force(x0, v0, slow)
        slow = follow(slow, v0, v1, dt, self.filter_time)
        force = follow(force, before, self.settled_force(x1, v1, slow), dt, self.response_time)
        return jnp.stack([slow, force])
