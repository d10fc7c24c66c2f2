"""A law in series with a spring: top mount, rod bushing or oil column."""

import math
from collections.abc import Callable
from typing import final

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._root import increasing_root
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers.base import AbstractDamper, Sum, own_and_inner
from jaxdamp.dampers.lag import Lag
from jaxdamp.parameters import nonnegative, parameter, positive


_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)  # of the two-stage, second-order, L-stable SDIRK method


def _answers_at_once(law: AbstractDamper) -> bool:
    """Whether the force depends on the velocity directly, not only through states."""
    if isinstance(law, Sum):
        return any(_answers_at_once(term) for term in law.terms)
    inner = getattr(law, "law", None)
    if not getattr(law, "answers_at_once", True):
        return False
    return not isinstance(law, Lag | SeriesSpring) and (inner is None or _answers_at_once(inner))


def series_rate(
    law: AbstractDamper,
    spring: Callable[[Scalar], Scalar],
    x: ScalarLike,
    v: ScalarLike,
    deflection: Scalar,
    inner: Float[Array, " inner"],
) -> State:
    """Rates of the deflection, v − v_d with F_law(v_d) = F_spring, and of the law's states."""
    limit = jnp.asarray(1e3, dtype=inner.dtype)  # m/s, far above any damper

    def surplus(w: Scalar) -> Scalar:
        return law.force(x - deflection, w, inner) - spring(deflection)

    guess = jnp.clip(jnp.asarray(v, dtype=inner.dtype), -limit, limit)
    velocity = increasing_root(surplus, guess, -limit, limit, steps=60)
    return jnp.concatenate([(v - velocity)[None], law.state_rate(x - deflection, velocity, inner)])


def series_step(
    law: AbstractDamper,
    spring: Callable[[Scalar], Scalar],
    reach: Callable[[Scalar], Scalar],
    x0: ScalarLike,
    v0: ScalarLike,
    v1: ScalarLike,
    deflection: Scalar,
    inner: Float[Array, " inner"],
    dt: ScalarLike,
) -> State:
    """Deflection and states of the law after a step of the two-stage SDIRK method.

    Each stage finds the law's velocity w with F_law(w) = spring(free − duration w), where `free` is the deflection of a
    locked law. `reach(force)` is a deflection at which the spring carries at least this force.
    """

    def stage(stroke: ScalarLike, free: Scalar, inner_stroke: Scalar, state: State) -> tuple[Scalar, Scalar, State]:
        def law_states(w: Scalar) -> State:
            return law.advance(inner_stroke, w, stroke - free + duration * w, w, state, duration)

        def surplus(w: Scalar) -> Scalar:
            resisting = law.force(stroke - free + duration * w, w, law_states(w))
            return resisting - spring(free - duration * w)

        at_rest = jnp.abs(law.force(stroke - free, jnp.zeros_like(free), law_states(jnp.zeros_like(free))))
        limit = (jnp.abs(free) + reach(at_rest)) / duration + jnp.finfo(free.dtype).tiny
        w = increasing_root(surplus, jnp.zeros_like(free), -limit, limit)
        return w, free - duration * w, law_states(w)

    duration = _GAMMA * dt
    moved_first = duration * (v0 + _GAMMA * (v1 - v0))
    moved = 0.5 * dt * (v0 + v1)
    stroke = x0 - deflection
    w1, _, _ = stage(x0 + moved_first, deflection + moved_first, stroke, inner)
    second = (1.0 - _GAMMA) * dt  # taken at w1, the rest at w2
    stroke_second = stroke + second * w1
    inner = law.advance(stroke, w1, stroke_second, w1, inner, second)
    _, after, inner = stage(x0 + moved, deflection + moved - second * w1, stroke_second, inner)
    return jnp.concatenate([after[None], inner])


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
        if not _answers_at_once(self.law):
            must = "be a law whose force answers the velocity at once"
            remedy = "Put the lag outside, `Lag(SeriesSpring(law))`, or combine two springs into one."
            _checks.refuse("law", must, f"a {type(self.law).__name__}", remedy)

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
        return series_rate(self.law, self.spring, x, v, *own_and_inner(self, state))

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Two-stage SDIRK step; the velocity is taken as linear over the step."""
        del x1

        def reach(force: Scalar) -> Scalar:
            return force / self.stiffness

        return series_step(self.law, self.spring, reach, x0, v0, v1, *own_and_inner(self, state), dt)
