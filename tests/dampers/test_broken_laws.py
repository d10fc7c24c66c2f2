"""The contract refuses laws that are broken on purpose, each by the check that is meant for it."""

from typing import final

import jax
import jax.numpy as jnp
import pytest

from jaxdamp import _checks
from jaxdamp.dampers import AbstractMemoryless, AbstractStateful, AbstractStateless, Traits, own_states
from jaxdamp.parameters import parameter, positive
from jaxdamp.testing import CHECKS, check_law


class _Jumping(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return self.rate * v + jnp.where(v > 0.0123, 5.0, 0.0)


class _Active(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return -self.rate * v


class _InfiniteSlope(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "size", positive)

    def force_velocity(self, v):
        return self.rate * jnp.sign(v) * jnp.sqrt(jnp.abs(v))


class _Preloaded(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return self.rate * v - 1.0


class _WithoutGradient(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return jax.lax.stop_gradient(self.rate) * v


class _Nameless(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "", positive)

    def force_velocity(self, v):
        return self.rate * v


@final
class _ActiveBetweenSines(AbstractStateful):
    """Takes energy in, but for a band about 45 Hz, which it amplifies: no sine of the contract lies there."""

    rate: jax.Array = parameter("N s/m", "slope", positive)

    def initial_state(self):
        return jnp.zeros(2)

    def force(self, x, v, state):
        return self.rate * (v - 8.0 * state[0])

    def state_rate(self, x, v, state):
        w = 2 * jnp.pi * 45.0
        return jnp.stack([w * (0.2 * (v - state[0]) - state[1]), w * state[0]])


class _Lagging(AbstractStateful):
    """A lag of 4 ms, as it should be."""

    rate: jax.Array = parameter("N s/m", "slope", positive)

    def initial_state(self):
        return jnp.zeros(1)

    def traits(self):
        return super().traits()._replace(has_feed_through=False, stroke_dependent_at_rest=False)

    def force(self, x, v, state):
        return own_states(self, state, 1)[0]

    def state_rate(self, x, v, state):
        (force,) = own_states(self, state, 1)
        return (self.rate * v - force)[None] / 0.004


class _FixedStep(_Lagging):
    """Its step takes every dt for a millisecond."""

    def advance(self, x0, v0, x1, v1, state, dt):
        return state + 1e-3 * self.state_rate(x1, v1, state)


class _Unsettled(_Lagging):
    """A spring behind a lag, in which a vehicle would start without the force of the spring."""

    def state_rate(self, x, v, state):
        return super().state_rate(x, v + x, state)


class _WrongPrediction(_Lagging):
    """A lag that is predicted to be where it was."""

    def predict(self, x0, v0, x1, v1, state, dt):
        return state


class _SaysItAnswers(_Lagging):
    """A law whose force is a state, and which does not say so."""

    def traits(self):
        return Traits()


class _SaysItIsLinear(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive, linear=True)

    def force_velocity(self, v):
        return self.rate * self.rate * v


class _SaysItHasNoStiffness(AbstractStateless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def traits(self):
        return super().traits()._replace(stroke_dependent_at_rest=False)

    def force_stroke_velocity(self, x, v):
        return self.rate * (v + x)


class _Vector(_Lagging):
    """Its force is a row of one number."""

    def force(self, x, v, state):
        return state


class _AnyStates(_Lagging):
    """Takes any number of states."""

    def state_rate(self, x, v, state):
        return (self.rate * v - state) / 0.004


class _Silent(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def __repr__(self):
        return "_Silent()"

    def force_velocity(self, v):
        return self.rate * v


class _Compiled(AbstractMemoryless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return self.rate * v * (1.1 if isinstance(v, jax.Array) and _checks.concrete(v) is not None else 1.0)


@jax.custom_jvp
def _itself(number):
    return number


@_itself.defjvp
def _slope_of_itself(primals, tangents):
    return primals[0], tangents[0] * (1.1 if _checks.concrete(primals[0]) is not None else 1.0)


class _CompiledSlope(AbstractMemoryless):
    """Has the same force compiled, but another derivative."""

    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return _itself(self.rate) * v


class _Cancelling(AbstractMemoryless):
    """Loses its digits in single precision."""

    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return self.rate * ((1e4 + v) * (1e4 + v) - 1e8) / 2e4


class _Gap(AbstractStateless):
    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_stroke_velocity(self, x, v):
        return jnp.where(x > 0.003, jnp.nan, self.rate * v)


class _Deaf(AbstractMemoryless):
    """Has the same force whatever its number."""

    rate: jax.Array = parameter("N s/m", "slope", positive)

    def force_velocity(self, v):
        return jnp.asarray(1000.0 * v)


@pytest.mark.parametrize(
    ("broken", "check"),
    [
        (_Jumping, "continuous"),
        (_Active, "passive"),
        (_ActiveBetweenSines, "passive"),
        (_InfiniteSlope, "finite"),
        (_Preloaded, "rest"),
        (_WithoutGradient, "derivatives"),
        (_Nameless, "parameters"),
        (_FixedStep, "step"),
        (_Unsettled, "step"),
        (_WrongPrediction, "prediction"),
        (_SaysItAnswers, "traits"),
        (_SaysItIsLinear, "traits"),
        (_SaysItHasNoStiffness, "traits"),
        (_Vector, "shapes"),
        (_AnyStates, "refusals"),
        (_Silent, "text"),
        (_Compiled, "compiled"),
        (_CompiledSlope, "compiled"),
        (_Cancelling, "single precision"),
        (_Gap, "inside wrappers"),
        (_Deaf, "alike ports"),
    ],
)
def test_broken_law_fails(broken, check):
    with pytest.raises(AssertionError, match=f"^{broken.__name__} breaks '{check}': "):
        check_law(broken(1000.0), leave_out=set(CHECKS) - {check})


def test_an_infinite_slope_is_named_before_what_follows_from_it() -> None:
    with pytest.raises(AssertionError, match=r"_InfiniteSlope breaks 'finite': .* not finite at v = "):
        check_law(_InfiniteSlope(jnp.asarray(1000.0)), leave_out={"shapes", "refusals", "parameters", "text", "file"})
