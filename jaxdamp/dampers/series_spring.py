"""A law in series with a spring: top mount, rod bushing or oil column."""

from typing import ClassVar, final

import jax.numpy as jnp

from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._series import one_spring, refuse_late, series_rate, series_step
from jaxdamp.dampers.base import AbstractDamper, own_and_inner
from jaxdamp.dampers.motion import Motion
from jaxdamp.parameters import nonnegative, parameter, positive


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

    answers_at_once: ClassVar[bool] = False
    smooth_state: ClassVar[bool] = True

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same force; stroke and velocity of the whole, of which the spring takes a part, so mostly a bound."""
        return [(self.law, motion)]

    def __check_init__(self) -> None:
        refuse_late("law", self.law, "SeriesSpring")

    def spring(self, deflection: ScalarLike) -> Scalar:
        """Spring force [N] at a deflection [m]."""
        return (self.stiffness + self.cubic_stiffness * deflection * deflection) * deflection

    def initial_state(self) -> State:
        """An unloaded spring; then the states of the law."""
        return jnp.concatenate([jnp.zeros(1), self.law.initial_state()])

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        del x, v
        return self.spring(own_and_inner(self, state)[0])

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rate of the deflection [m/s], v − v_d with F_law(v_d) = F, and of the law's states."""
        deflection, inner = own_and_inner(self, state)
        return series_rate(self.law, self.spring(deflection), x - deflection, v, inner)

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Two-stage SDIRK step; the velocity is taken as linear over the step."""
        del x1
        deflection, inner = own_and_inner(self, state)
        springs = one_spring(self.spring, lambda force: force / self.stiffness)
        return series_step(self.law, springs, x0, v0, v1, (deflection,), inner, dt)
