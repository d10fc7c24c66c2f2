"""Laws in parallel, and a law times a factor."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._guesses import Elsewhere
from jaxdamp._traced import behind
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp._vectors import joined
from jaxdamp._words import class_words
from jaxdamp.dampers._states import refuse_number
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits, combined_traits
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.dampers.range_use import with_fitted_range
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import nonnegative, parameter, real


@final
class Scaled(AbstractWrapper):
    """A law whose force is multiplied by a factor, F = factor · F_law; made by `2.0 * law`.

    Arguments:
        law: the law.
        factor: factor on the force, not negative: a negative one would add energy to the motion, F v ≤ 0.
        allow_active: accept a negative factor, for example for stability studies.
    """

    law: AbstractDamper
    factor: Number = parameter("", "factor on the force", lambda law: real if law.allow_active else nonnegative)
    allow_active: bool = eqx.field(static=True, default=False)

    def __check_init__(self) -> None:
        factor = behind(self.factor)
        if factor is not None and np.any(factor < 0) and not self.allow_active:
            remedy = "The law would add energy. If this is intended: `Scaled(law, factor, allow_active=True)`."
            _checks.refuse("factor", "not be negative", factor, remedy)

    def is_linear_in_law(self) -> bool:
        """A factor is linear."""
        return True

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same motion with the force divided by the factor."""
        return [(self.law, motion.divided(self.factor))]

    def outer_force(self, force: Scalar) -> Scalar:
        """Force [N]."""
        return self.factor * force


@final
class Sum(AbstractDamper):
    """Laws in parallel, F = Σ Fᵢ; created by `law + law`. States are concatenated in order.

    Attributes:
        terms: the laws.
    """

    terms: tuple[AbstractDamper, ...]
    force_velocity = Elsewhere("`jaxdamp.rig.quasi_static(law, velocities).force`, as terms may have states")

    def __check_init__(self) -> None:
        if not self.terms:
            _checks.refuse("terms", "hold at least one law", self.terms)

    def traits(self) -> Traits:
        """The combined traits of all terms."""
        return combined_traits(term.traits() for term in self.terms)

    def side_by_side(self) -> tuple[AbstractDamper, ...]:
        """The terms, and the terms inside them."""
        return tuple(law for term in self.terms for law in term.side_by_side())

    @property
    def stroke_limits(self) -> tuple[ScalarLike, ScalarLike]:
        """Strokes [m] within which all terms are valid."""
        lows, highs = zip(*(term.stroke_limits for term in self.terms), strict=True)
        return jnp.max(jnp.stack([*map(jnp.asarray, lows)])), jnp.min(jnp.stack([*map(jnp.asarray, highs)]))

    def initial_state(self) -> State:
        """The states of all terms."""
        return joined([term.initial_state() for term in self.terms])

    def state_at_rest(self, x: ScalarLike) -> State:
        """The states of all terms at rest."""
        return joined([term.state_at_rest(x) for term in self.terms])

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Sum of the forces [N]."""
        return jnp.sum(jnp.stack([term.force(x, v, s) for term, s in self._with_states(state)]), axis=0)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of all terms."""
        return jnp.concatenate([term.state_rate(x, v, s) for term, s in self._with_states(state)])

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Every term takes its own step."""
        return jnp.concatenate([term.advance(x0, v0, x1, v1, s, dt) for term, s in self._with_states(state)])

    def predict(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """The predictions of all terms."""
        return jnp.concatenate([term.predict(x0, v0, x1, v1, s, dt) for term, s in self._with_states(state)])

    def implicit_stage(self, x: ScalarLike, v: ScalarLike, state: State, duration: ScalarLike) -> State:
        """The stages of all terms."""
        return jnp.concatenate([term.implicit_stage(x, v, s, duration) for term, s in self._with_states(state)])

    def _with_states(self, state: State) -> list[tuple[AbstractDamper, Array]]:
        """The terms, each with its own states, cut out of the concatenated ones."""
        sizes = [term.initial_state().size for term in self.terms]
        ends = [sum(sizes[: i + 1]) for i in range(len(sizes))]
        if state.size != ends[-1]:
            refuse_number(state, f"{ends[-1]} numbers for the terms of the sum")
        return [(term, state[end - size : end]) for term, size, end in zip(self.terms, sizes, ends, strict=True)]


def terms_of(law: AbstractDamper) -> tuple[AbstractDamper, ...]:
    """The terms of a sum, or the law itself. The fitted range of a sum applies to its terms, except the force."""
    if not isinstance(law, Sum):
        return (law,)
    if law.fitted_to is None:
        return law.terms
    covered = law.fitted_to.without("force")
    return tuple(with_fitted_range(term, covered) if term.fitted_to is None else term for term in law.terms)


def law_name(law: AbstractDamper) -> str:
    """The classes of a law in words: "Besinger + series spring", "linear + Coulomb friction"."""
    if isinstance(law, Sum):
        return " + ".join(law_name(term) for term in law.terms)
    words, inside = class_words(law), law.inner_laws()
    return f"{law_name(inside[0])} + {words}" if len(inside) == 1 else words
