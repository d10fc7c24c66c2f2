"""A law in series with a spring: top mount, rod bushing or oil column."""

import math
from typing import final

import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._root import increasing_root
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.lag import Lag
from jaxdamp.parameters import check_parameters, nonnegative, parameter, positive


_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)  # of the two-stage, second-order, L-stable SDIRK method


@final
class SeriesSpring(AbstractDamper):
    """F = k₁ x_s + k₂ x_s³ = F_law(v_d), x = x_d + x_s: the spring and the law carry the same force (paper 001).

    State: the spring's deflection x_s [m] (then the law's own states), ẋ_s = v − v_d. The law must resist more the
    faster it moves. The step is the two-stage SDIRK method (second order, L-stable): each stage solves one monotone
    scalar equation for v_d, so a spring of any stiffness is stable at any step, and derivatives come from the implicit
    function theorem. A linear law with coefficient c is the Maxwell element of time constant c/k₁.

    Paper 001 publishes k₁ = 150 N/mm, which puts the corner of the damper at 1.6 Hz; ten times that is plausible.

    >>> from jaxdamp.dampers import Linear
    >>> law = SeriesSpring(Linear(2000.0), stiffness=1e6)
    >>> round(float(law.force(0.0, 0.0, jnp.array([1e-3]))), 6)
    1000.0
    """

    law: AbstractDamper
    stiffness: Number = parameter("N/m", "k₁, series stiffness", positive)
    cubic_stiffness: Number = parameter("N/m³", "k₂, cubic series stiffness", nonnegative, default=0.0)

    def __check_init__(self) -> None:
        if isinstance(self.law, Lag | SeriesSpring):
            must = "be a law whose force answers the velocity at once"
            remedy = "Put the lag outside, `Lag(SeriesSpring(law))`, or combine two springs into one."
            _checks.refuse("law", must, f"a {type(self.law).__name__}", remedy)
        check_parameters(self)

    def spring(self, deflection: ScalarLike) -> Scalar:
        """Spring force [N] at a deflection [m]."""
        return (self.stiffness + self.cubic_stiffness * deflection * deflection) * deflection

    def initial_state(self) -> State:
        """An unloaded spring; then the states of the law."""
        return jnp.concatenate([jnp.zeros(1), self.law.initial_state()])

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        del x, v
        return self.spring(state[0])

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rate of the deflection [m/s], v − v_d with F_law(v_d) = F, and of the law's states."""
        inner, deflection = state[1:], state[0]
        limit = jnp.asarray(1e3, dtype=state.dtype)  # m/s, far above any damper

        def surplus(w: Scalar) -> Scalar:
            return self.law.force(x - deflection, w, inner) - self.spring(deflection)

        guess = jnp.clip(jnp.asarray(v, dtype=state.dtype), -limit, limit)
        velocity = increasing_root(surplus, guess, -limit, limit, steps=60)
        return jnp.concatenate([(v - velocity)[None], self.law.state_rate(x - deflection, velocity, inner)])

    def _stage(
        self, stroke: ScalarLike, free: Scalar, inner_stroke: Scalar, state: State, duration: Scalar
    ) -> tuple[Scalar, Scalar, State]:
        """One implicit stage: the law's velocity w with F_law(w) = spring(free − duration w)."""

        def law_states(w: Scalar) -> State:
            return self.law.advance(inner_stroke, w, stroke - free + duration * w, w, state, duration)

        def surplus(w: Scalar) -> Scalar:
            resisting = self.law.force(stroke - free + duration * w, w, law_states(w))
            return resisting - self.spring(free - duration * w)

        at_rest = jnp.abs(self.law.force(stroke - free, jnp.zeros_like(free), law_states(jnp.zeros_like(free))))
        limit = (jnp.abs(free) + at_rest / self.stiffness) / duration + jnp.finfo(free.dtype).tiny
        w = increasing_root(surplus, jnp.clip(free / duration, -limit, limit), -limit, limit, steps=10)
        return w, free - duration * w, law_states(w)

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Two-stage SDIRK step; the velocity is taken as linear over the step."""
        del x1
        deflection, inner = state[0], state[1:]
        first = _GAMMA * dt
        moved_first = first * (v0 + 0.5 * _GAMMA * (v1 - v0))
        moved = 0.5 * dt * (v0 + v1)
        w1, _, inner1 = self._stage(x0 + moved_first, deflection + moved_first, x0 - deflection, inner, first)
        inner_stroke = x0 - deflection + (1.0 - _GAMMA) * dt * w1
        _, after, inner2 = self._stage(
            x0 + moved, deflection + moved - (1.0 - _GAMMA) * dt * w1, inner_stroke, inner1, first
        )
        return jnp.concatenate([after[None], inner2])
