"""A law in series with its oil column and with a rubber bushing that damps by itself."""

from typing import ClassVar, final

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._series import Deflections, Springs, refuse_late, series_rate, series_step
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.motion import Motion
from jaxdamp.parameters import parameter, positive


@final
class Bushing(AbstractDamper):
    """F = F_law(v_d) = k_o x_o = k_b x_b + c_b ẋ_b, x = x_d + x_o + x_b: oil column and bushing carry the law's force.

    Rubber loses energy when it is deflected; a spring in series (`SeriesSpring`) does not. A linear law of coefficient
    c gives the complex stiffness F/x = 1/(1/(iωc) + 1/k_o + 1/(k_b + iωc_b)) at the angular frequency ω. A bushing
    without damping is a spring: `SeriesSpring` with 1/(1/k_o + 1/k_b). The law must resist more the faster it moves;
    the whole is passive if the law is.

    States: the deflections x_o and x_b [m], then the law's own; ẋ_b = (F − k_b x_b)/c_b, ẋ_o = v − v_d − ẋ_b. The step
    is that of `SeriesSpring`, one monotone scalar equation a stage, stable for any stiffness and step.

    Arguments:
        law: a law whose force answers the velocity at once.
        oil_stiffness: k_o [N/m]; of a column of oil A² B (1/V₁ + 1/V₂), with piston area A [m²], bulk modulus B [Pa]
            and volumes V₁, V₂ [m³] above and below the piston.
        stiffness: k_b [N/m].
        damping: c_b [N s/m]; k_b tan δ/ω for a loss angle δ at ω.

    Raises:
        ValueError: a law whose force is a state, such as `Lag`.

    >>> from jaxdamp.dampers import Linear
    >>> law = Bushing(Linear(2000.0), oil_stiffness=2e6, stiffness=8e5, damping=600.0)
    >>> round(float(law.force(0.0, 0.0, jnp.array([5e-4, 1e-3]))), 6)
    1000.0
    """

    law: AbstractDamper
    oil_stiffness: Number = parameter("N/m", "k_o, stiffness of the oil column", positive)
    stiffness: Number = parameter("N/m", "k_b, stiffness of the bushing", positive)
    damping: Number = parameter("N s/m", "c_b, damping of the bushing", positive)

    answers_at_once: ClassVar[bool] = False

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same force; stroke and velocity of the whole, of which the rubber takes a part, so mostly a bound."""
        return [(self.law, motion)]

    def __check_init__(self) -> None:
        refuse_late("law", self.law, "Bushing")

    def initial_state(self) -> State:
        """Nothing deflected; then the states of the law."""
        return jnp.concatenate([jnp.zeros(2), self.law.initial_state()])

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        del x, v
        (oil, _), _ = self._split(state)
        return self.oil_stiffness * oil

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of both deflections [m/s] and of the law's states."""
        (oil, rubber), inner = self._split(state)
        force = self.oil_stiffness * oil
        rate = series_rate(self.law, force, x - oil - rubber, v, inner)
        rubber_rate = (force - self.stiffness * rubber) / self.damping
        return jnp.concatenate([jnp.stack([rate[0] - rubber_rate, rubber_rate]), rate[1:]])

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Two-stage SDIRK step; the velocity is taken as linear over the step."""
        del x1
        own, inner = self._split(state)
        springs = Springs(lambda own: self.oil_stiffness * own[0], self._shared, self._reach)
        return series_step(self.law, springs, x0, v0, v1, own, inner, dt)

    def _split(self, state: State) -> tuple[Deflections, Float[Array, " inner"]]:
        if state.size < 2:
            must = "hold the two deflections of Bushing first"
            _checks.refuse("state", must, f"of shape {state.shape}", "Start from `law.initial_state()`.")
        return (state[0], state[1]), state[2:]

    def _shared(self, total: Scalar, begun: Deflections, duration: ScalarLike) -> Deflections:
        # k_o x_o = k_b x_b + c_b (x_b − begun)/duration with x_o + x_b = total
        carried = duration * self.stiffness * total + self.damping * (total - begun[1])
        oil = carried / (duration * (self.oil_stiffness + self.stiffness) + self.damping)
        return oil, total - oil

    def _reach(self, force: Scalar, begun: Deflections) -> Scalar:
        return jnp.abs(begun[1]) + force / self.oil_stiffness + force / self.stiffness
