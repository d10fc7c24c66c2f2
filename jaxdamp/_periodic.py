"""The state in which a system is again after one period, by shooting, with the derivatives of the implicit function.

The map P carries a state s over a period, J = ∂P/∂s is the monodromy matrix, and s = P(s) is the steady motion. Its
multipliers, the eigenvalues of J, say whether small disturbances die out.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxdamp._matrices import solve
from jaxdamp._root import ImplicitDerivatives
from jaxdamp._sharded import varying_as
from jaxdamp._types import Scalar, State


SETTLED = {"float64": 1e-10, "float32": 2e-5}  # change over a period, relative to the largest values: steady
PATIENT = 40  # rounds in which an unstable motion is left, as it is on a test rig; then it is taken
MOST_ROUNDS = 80
DOUBLINGS = 14  # of the number of periods after which a disturbance is looked at
GROWN = 1e6

Setting: TypeAlias = PyTree
Period: TypeAlias = Callable[[State, Setting], tuple[State, State]]  # P(s), and the scale of each entry


class Shot(NamedTuple):
    """A period from a state."""

    after: State  # P(s)
    monodromy: Float[Array, "state state"]  # J = ∂P/∂s
    change: Scalar  # the largest |P(s) − s| relative to the scale


class _Search(NamedTuple):
    """The state, that to try instead if it is no better than the one before, and the change over a period before it."""

    state: State
    otherwise: State
    change: Scalar
    rounds: Int[Array, ""]
    done: Bool[Array, ""]


def shoot(period: Period, state: State, setting: Setting) -> Shot:
    """A period from a state, with its derivatives."""

    def both(state: State) -> tuple[State, tuple[State, State]]:
        after, scale = period(state, setting)
        return after, (after, scale)

    slopes, (after, scale) = jax.jacfwd(both, has_aux=True)(state)
    used = ~(scale <= 0)  # NaN counts
    return Shot(after, slopes, jnp.max(jnp.where(used, jnp.abs(after - state) / jnp.where(used, scale, 1.0), 0.0)))


def is_stable(monodromy: Float[Array, "state state"]) -> Bool[Array, ""]:
    """Whether no disturbance grows a million times over 2¹⁴ periods; a multiplier of 1.001 does."""
    power = monodromy
    for _ in range(DOUBLINGS):
        power = power @ power
    return jnp.max(jnp.abs(power)) < GROWN  # False for NaN


def steady_state(period: Period, start: State, setting: Setting) -> State:
    """The state s = P(s) near a start, without derivatives.

    Newton's method, s + (1 − J)⁻¹ (P(s) − s); where that leads further away, the system runs on for a period and it is
    tried again. A motion that is unstable is left in the same way, as it would be on a test rig: only if none that is
    stable is found for 40 rounds, it is taken. The caller decides by `shoot` whether the result is steady.
    """
    settled = SETTLED[str(start.dtype)]
    one = jnp.eye(start.size, dtype=start.dtype)

    def going(now: _Search) -> Bool[Array, ""]:
        return ~now.done & (now.rounds < MOST_ROUNDS)

    def again(now: _Search) -> _Search:
        shot = shoot(period, now.state, setting)
        patient, stable = now.rounds < PATIENT, is_stable(shot.monodromy)
        good = stable | ~patient
        ahead = now.state + solve(one - shot.monodromy, shot.after - now.state)
        ahead = jnp.where(good & jnp.all(jnp.isfinite(ahead)), ahead, shot.after)
        worse = ~(shot.change < now.change)
        done = good & (shot.change <= settled) | ~jnp.all(jnp.isfinite(now.otherwise))
        state = jnp.where(worse & ~done, now.otherwise, ahead)
        change = jnp.where(worse | ~good, jnp.inf, shot.change)
        return _Search(state, jnp.where(worse, now.otherwise, shot.after), change, now.rounds + 1, done)

    never = jnp.full((), jnp.inf, start.dtype)
    search = _Search(start, start, never, jnp.zeros((), int), jnp.zeros((), bool))
    search = varying_as(search, *jax.tree.leaves(setting))
    return jax.lax.while_loop(going, again, search).state


def _as_it_is(inputs: tuple[PyTree, ...]) -> tuple[State, tuple[()]]:
    return inputs[0], ()


def _missing(state: State, _: object, inputs: tuple[PyTree, ...]) -> State:
    _, period, setting, *_ = inputs
    return period(state, setting)[0] - state


def with_derivatives(period: Period, state: State, setting: Setting) -> State:
    """A steady state with its derivatives by the numbers in the setting, (1 − J)⁻¹ ∂P, of any order and mode."""
    state = jax.lax.stop_gradient(state)
    return ImplicitDerivatives().apply(_as_it_is, _missing, (state, period, setting), frozenset())[0]
