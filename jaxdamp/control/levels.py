"""The law of an element that takes a command: with its parameters at one, and at each level that was measured."""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._types import Scalar
from jaxdamp.dampers import AbstractDamper, Scheduled
from jaxdamp.vehicles import LiftOffWithLaws


HELD, STEPS = 0.2, 200  # s, and steps, in which friction and hysteresis at a velocity settle


def interpolated(law: AbstractDamper, command: Scalar) -> AbstractDamper:
    """The law of an element with the parameters, or forces, of its `Scheduled` law at a command."""
    return _replaced(law, lambda scheduled: scheduled.at(command))


def scheduled_in(law: AbstractDamper) -> list[Scheduled]:
    """The `Scheduled` laws in the law of an element."""
    return [node for node in jax.tree.leaves(law, is_leaf=_scheduled) if _scheduled(node)]


def takes_command(law: AbstractDamper) -> bool:
    """Whether a controller commands the law of an element; a lift-off repeats the laws of its wheel."""
    return len(scheduled_in(law)) == 1 and not isinstance(law, LiftOffWithLaws)


def laws_at_levels(law: AbstractDamper) -> list[AbstractDamper]:
    """The law of an element at each level of its `Scheduled` law."""
    count = len(scheduled_in(law)[0].laws)
    return [_replaced(law, lambda scheduled, number=number: scheduled.at_level(number)) for number in range(count)]


def _replaced(law: AbstractDamper, by: Callable[[Scheduled], AbstractDamper]) -> AbstractDamper:
    """The law of an element with another law in place of its `Scheduled` law."""
    return jax.tree.map(lambda node: by(node) if _scheduled(node) else node, law, is_leaf=_scheduled)


def _scheduled(node: object) -> bool:
    return isinstance(node, Scheduled)


def forces_at(laws: Sequence[AbstractDamper], velocity: Scalar) -> Float[Array, " laws"]:
    """The forces of laws [N] at a velocity that has been held, with the states that the first of them then has."""
    zero, first = jnp.zeros_like(velocity), laws[0]
    state = first.initial_state()
    if state.size:

        def held(state: Array, _: None) -> tuple[Array, None]:
            return first.advance(zero, velocity, zero, velocity, state, HELD / STEPS), None

        state, _ = jax.lax.scan(held, state, None, length=STEPS)
    return jnp.stack([law.force(zero, velocity, state) for law in laws])


def forces_both_ways(laws: Sequence[AbstractDamper], velocity: Scalar) -> Float[Array, "2 laws"]:
    """`forces_at` a velocity in extension and in compression."""
    return jnp.stack([forces_at(laws, velocity), forces_at(laws, -velocity)])


def outer_forces(law: AbstractDamper, velocity: Scalar) -> list[float]:
    """The sizes of the forces of an element [N] at its lowest and its highest level, at ± a velocity together.

    Arguments:
        law: with a `Scheduled` law.
        velocity: held [m/s].
    """
    laws = laws_at_levels(law)
    return np.abs(forces_both_ways([laws[0], laws[-1]], velocity)).sum(axis=0).tolist()
