"""A law in series with massless springs: all carry one force, the spring deflections are states."""

import math
from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import within
from jaxdamp._root import increasing_root
from jaxdamp._types import Scalar, ScalarLike, State
from jaxdamp.dampers.base import AbstractDamper, parts


GAMMA = 1.0 - 1.0 / math.sqrt(2.0)  # of the two-stage, second-order, L-stable SDIRK method

Deflections = tuple[Scalar, ...]


class Springs(NamedTuple):
    """What stands in series with a law.

    Arguments:
        force: carried at these deflections; it does not fall when the total grows.
        shared: the deflections that make up a total at the end of an implicit stage of a duration that began at others.
        reach: a total at which, at the end of any such stage, they carry at least this force.
    """

    force: Callable[[Deflections], Scalar]
    shared: Callable[[Scalar, Deflections, ScalarLike], Deflections]
    reach: Callable[[Scalar, Deflections], Scalar]


def one_spring(spring: Callable[[Scalar], Scalar], reach: Callable[[Scalar], Scalar]) -> Springs:
    """A single spring, which bears the whole deflection."""
    return Springs(lambda own: spring(own[0]), lambda total, _, __: (total,), lambda force, _: reach(force))


def answers_at_once(law: AbstractDamper) -> bool:
    """Whether the force depends on the velocity directly, not only through states."""
    inside = parts(law)
    return law.answers_at_once and (not inside or any(map(answers_at_once, inside)))


def refuse_late(argument: str, law: AbstractDamper, name: str) -> None:
    """Refuse a law that does not answer at once: no velocity of it would match the force of the springs."""
    if not answers_at_once(law):
        must = "be a law whose force answers the velocity at once"
        remedy = f"Put the lag outside, `Lag({name}(law))`, or combine two springs into one."
        _checks.refuse(argument, must, f"a {type(law).__name__}", remedy)


def series_rate(
    law: AbstractDamper, force: Scalar, x: ScalarLike, v: ScalarLike, inner: Float[Array, " inner"]
) -> State:
    """Rate of the springs' total deflection, v − v_d with F_law(v_d) = force, and of the states of the law at x."""
    limit = jnp.asarray(1e3, dtype=inner.dtype)  # m/s, far above any damper

    def surplus(w: Scalar) -> Scalar:
        return law.force(x, w, inner) - force

    guess = within(jnp.asarray(v, dtype=inner.dtype), -limit, limit)
    velocity = increasing_root(surplus, guess, -limit, limit, steps=60)
    return jnp.concatenate([(v - velocity)[None], law.state_rate(x, velocity, inner)])


def series_step(
    law: AbstractDamper,
    springs: Springs,
    x0: ScalarLike,
    v0: ScalarLike,
    v1: ScalarLike,
    own: Deflections,
    inner: Float[Array, " inner"],
    dt: ScalarLike,
) -> State:
    """Deflections and states of the law after a step of the two-stage SDIRK method.

    Each stage finds the law's velocity w with F_law(w) = F_springs(free − duration w), where `free` is the springs'
    total deflection for a locked law.
    """

    def stage(
        stroke: ScalarLike,
        free: Scalar,
        begun: Deflections,
        inner_stroke: Scalar,
        state: State,
        guess: Scalar,
        likely: int,
    ) -> tuple[Scalar, Deflections, State]:
        def law_states(w: Scalar) -> State:
            return law.advance(inner_stroke, w, stroke - free + duration * w, w, state, duration)

        def deflections(w: Scalar) -> Deflections:
            return springs.shared(free - duration * w, begun, duration)

        def surplus(w: Scalar) -> Scalar:
            resisting = law.force(stroke - free + duration * w, w, law_states(w))
            return resisting - springs.force(deflections(w))

        at_rest = jnp.abs(law.force(stroke - free, jnp.zeros_like(free), law_states(jnp.zeros_like(free))))
        limit = (jnp.abs(free) + springs.reach(at_rest, begun)) / duration + jnp.finfo(free.dtype).tiny
        w = increasing_root(surplus, within(guess, -limit, limit), -limit, limit, likely=likely, close=1e-4)
        return w, deflections(w), law_states(w)

    duration = GAMMA * dt
    total = sum(own[1:], own[0])
    v0, gained = jnp.asarray(v0, total.dtype), jnp.asarray(v1 - v0, total.dtype)
    moved_first = duration * (v0 + GAMMA * gained)
    moved = dt * (v0 + 0.5 * gained)
    stroke = x0 - total
    w1, first, _ = stage(x0 + moved_first, total + moved_first, own, stroke, inner, v0, likely=3)
    second = (1.0 - GAMMA) * dt  # taken at the rates of the first stage, the rest at those of the second
    begun = tuple(old + (second / duration) * (new - old) for old, new in zip(own, first, strict=True))
    stroke_second = stroke + second * w1
    inner = law.advance(stroke, w1, stroke_second, w1, inner, second)
    ahead = w1 + (1.0 - GAMMA) * gained
    _, after, inner = stage(x0 + moved, total + moved - second * w1, begun, stroke_second, inner, ahead, likely=2)
    return jnp.concatenate([jnp.stack(after), inner])
