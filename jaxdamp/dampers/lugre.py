"""Friction with breakaway: the LuGre law (Lund and Grenoble)."""

from collections.abc import Sequence
from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._guesses import ELASTIC_TRAVEL, sliding_fit
from jaxdamp.dampers._plainer import sliding
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers._steps import direction, travels
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.dahl import Dahl
from jaxdamp.dampers.stribeck_friction import stribeck_force
from jaxdamp.parameters import nonnegative, parameter, positive


NO_FRICTION = 1e-3  # of the breakaway force: as good as zero, which the sliding bristles cannot have


@final
class LuGre(AbstractDamper):
    """F = σ₀ z + σ₁(v) ż + σ₂ v, ż = v − σ₀ |v| z/g(v) (Canudas de Wit et al. 1995): stick, breakaway and sliding.

    z [m] is the mean deflection of bristles of stiffness σ₀; in steady sliding F = g(v) sgn v + σ₂ v with the Stribeck
    curve g(v) = F_c + (F_s − F_c) exp(−(v/v_s)²). With a constant σ₁ the law may not be passive; it is passive if σ₁(v)
    ≤ 4 g/|v|. Here σ₁(v) = σ₁/√(1 + (σ₁ v/4g)²): the damping is σ₁ at rest and decreases with sliding, and the law is
    passive for any parameters. With σ₁ = 0 and F_s = F_c it is `Dahl` parallel to a viscous law.

    State: z. The step is exact at constant velocity, second order, and stable for any stiffness; it includes a reversal
    within the step. Up to about σ₀ = 1e7 N/m, steps of 1 ms are possible in a car. Inside a `SeriesSpring` it needs σ₁
    or σ₂ above zero.

    >>> law = LuGre(4e5, 300.0, 0.0, friction_force=40.0, breakaway_force=60.0, stribeck_velocity=0.01)
    >>> state = law.advance(0.0, 0.1, 0.01, 0.1, law.initial_state(), 0.1)
    >>> round(float(law.force(0.01, 0.1, state)), 6)
    40.0
    """

    stiffness: Number = parameter("N/m", "σ₀, stiffness of the bristles", positive, adjustable=False)
    contact_damping: Number = parameter("N s/m", "σ₁, damping of the bristles at rest", nonnegative, adjustable=False)
    viscous_rate: Number = parameter("N s/m", "σ₂, viscous damping coefficient", nonnegative)
    friction_force: Number = parameter("N", "F_c, friction at high sliding velocity", positive, adjustable=False)
    breakaway_force: Number = parameter("N", "F_s, friction at low sliding velocity", positive, adjustable=False)
    stribeck_velocity: Number = parameter(
        "m/s", "v_s, velocity over which F_s decreases to F_c", positive, adjustable=False
    )

    def traits(self) -> Traits:
        """No force at rest."""
        return Traits(stroke_dependent_at_rest=False)

    def sliding_force(self, v: ScalarLike) -> Scalar:
        """g(v) [N], positive."""
        return stribeck_force(v, self.friction_force, self.breakaway_force, self.stribeck_velocity)

    def initial_state(self) -> State:
        """No deflection of the bristles."""
        return jnp.zeros(1)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        (z,) = own_states(self, state, 1)
        (rate,) = self.state_rate(x, v, state)
        fading = jnp.sqrt(1.0 + (0.25 * self.contact_damping * v / self.sliding_force(v)) ** 2)
        return self.stiffness * z + self.contact_damping / fading * rate + self.viscous_rate * v

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """ż [m/s]."""
        del x
        (z,) = own_states(self, state, 1)
        return (v - self.stiffness * jnp.abs(v) * z / self.sliding_force(v))[None]

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Exact for a sliding friction that is linear in the travel, before and after a reversal."""
        del x0, x1
        (z,) = own_states(self, state, 1)
        before, after = travels(v0, v1, dt)
        zero = 0.0 * after
        turn = jnp.where(before != 0.0, zero, v0)
        for travel, start, end in ((before, v0, zero), (after, turn, v1)):
            sign = direction(travel)
            middle = self.sliding_force(0.5 * (start + end))
            lengths = self.stiffness * sign * travel / middle
            safe = jnp.where(lengths > 1e-6, lengths, 1.0)
            decay = jnp.exp(-lengths)
            mean = jnp.where(lengths > 1e-6, -jnp.expm1(-safe) / safe, 1.0 - 0.5 * lengths)
            sliding = (mean - decay) * self.sliding_force(start) + (1.0 - mean) * self.sliding_force(end)
            z = decay * z + sign * sliding / self.stiffness
        return z[None]

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "LuGre":
        """Start values from measured data: c and friction at high velocities; elastic deflection over 0.5 mm."""
        rate, level, _ = sliding_fit(velocity, force)
        slow = max(0.2 * float(np.max(np.abs(velocity))), 1e-6)
        return cls(level / ELASTIC_TRAVEL, 0.1 * level / slow, rate, level, level, slow)

    def plainer(self, undetermined: Sequence[str], fastest: float) -> AbstractDamper:
        """This one with almost no friction at high velocity; or friction without breakaway, half of it elastic."""
        if "friction_force" in undetermined and self.friction_force < NO_FRICTION * self.breakaway_force:
            return self
        half = 0.5 * self.friction_force
        return sliding(self.viscous_rate, half, self.stribeck_velocity, Dahl(self.stiffness, half), fastest)

    def without_effect(self, fastest: float) -> tuple[str, ...]:
        """The friction at high velocity, if it is almost zero."""
        del fastest
        return ("friction_force",) * bool(self.friction_force < NO_FRICTION * self.breakaway_force)
