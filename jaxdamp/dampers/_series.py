"""A law in series with massless springs: all have the same force, the spring deflections are states."""

from abc import abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._limits import between_numbers, within
from jaxdamp._root import increasing_root
from jaxdamp._types import Scalar, ScalarLike, State
from jaxdamp._vectors import joined
from jaxdamp.dampers._steps import GAMMA, sdirk2
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.dampers.wrapper import AbstractWrapper


FASTEST = 1e3  # m/s, far above any damper
MOST_STEPS = 60  # of a search; a dozen are enough unless the law levels off far from the root

Deflections = tuple[Scalar, ...]


class _StageState(NamedTuple):
    """The state of the parts in series within a step."""

    deflections: Deflections  # of the springs [m]
    stroke: ScalarLike  # of the law [m]
    inner: State  # states of the law
    guess: Scalar  # velocity of the law expected in the next stage [m/s]


class _StageResult(NamedTuple):
    """The result of a stage."""

    velocity: Scalar  # of the law [m/s]
    change: Deflections  # of the springs over the stage [m]


class AbstractSeries(AbstractWrapper):
    """A law in series with springs, whose deflections are additional states; all have the same force.

    The step is the two-stage SDIRK method: each stage finds the law's velocity w with F_law(w) = F_springs(free −
    duration w), where `free` is the springs' total deflection for a locked law.
    """

    @abstractmethod
    def spring_force(self, deflections: Deflections) -> Scalar:
        """Force [N] at these deflections [m]; it does not decrease with their total."""

    @abstractmethod
    def largest_deflection(self, force: Scalar, begun: Deflections) -> Scalar:
        """A total deflection [m] at which the springs have at least this force [N] at the end of any stage."""

    def spring_in_stage(
        self, law_force: Callable[[Scalar], Scalar], free: Scalar, duration: ScalarLike
    ) -> Callable[[Deflections], Scalar]:
        """The force [N] by the deflections at the end of a stage, for the search of its velocity.

        By default `spring_force`. A spring with kinks gives the piece on which the stage ends, continued without kinks.

        Arguments:
            law_force: of the law at its constant velocity over the stage.
            free: deflection [m] at the end for a locked law.
            duration: duration of the stage [s].
        """
        del law_force, free, duration
        return self.spring_force

    def shared(self, total: Scalar, begun: Deflections, duration: ScalarLike) -> Deflections:
        """The deflection of each spring at the end of an implicit stage, from their total; by default one spring.

        Arguments:
            total: sum of the deflections at the end [m].
            begun: deflections at the beginning of the stage [m].
            duration: duration of the stage [s].
        """
        del begun, duration
        return (total,)

    def shared_rate(self, total_rate: Scalar, deflections: Deflections) -> Deflections:
        """Rates of the deflections [m/s] that make up a total rate."""
        del deflections
        return (total_rate,)

    def shared_at_rest(self, total: Scalar) -> Deflections:
        """The deflection of each spring at rest, from their total [m]; by default one spring."""
        return (total,)

    def force_at_rest(self, total: Scalar) -> Scalar:
        """Force [N] of the springs at rest at their total deflection [m], strictly increasing."""
        return self.spring_force(self.shared_at_rest(total))

    def own_state_count(self) -> int:
        """One deflection [m]."""
        return 1

    def state_at_rest(self, x: ScalarLike) -> State:
        """The deflections at which the springs have the force of the law at rest, and the states of the law there."""
        law = self.inner_law()

        def law_force(y: Scalar) -> Scalar:
            return law.force(y, jnp.zeros_like(y), law.state_at_rest(y))

        locked, everywhere = law_force(jnp.asarray(x)), not law.traits().stroke_dependent_at_rest
        zero = jnp.zeros_like(locked)
        reach = self.largest_deflection(jnp.abs(locked), self.shared_at_rest(zero))
        total = increasing_root(
            lambda total: self.force_at_rest(total) - (locked if everywhere else law_force(x - total)),
            zero,
            -reach,
            reach,
            steps=MOST_STEPS,
            close=None,
        )
        return joined([jnp.stack(self.shared_at_rest(total)), law.state_at_rest(x - total)])

    def traits(self) -> Traits:
        """The force is that of the springs, which depends on states alone."""
        return super().traits()._replace(has_feed_through=False)

    @property
    def stroke_limits(self) -> tuple[ScalarLike, ScalarLike]:
        """No limits: the springs have a part of the stroke."""
        return -jnp.inf, jnp.inf

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same force; stroke and velocity of the assembly, which are usually larger than those of the law."""
        return [(law, motion) for law in self.inner_laws()]

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N] of the springs."""
        del x, v
        return self.spring_force(self.split(state)[0])

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of the deflections [m/s], v − v_d in total with F_law(v_d) = F, and of the law's states."""
        law, (deflections, inner) = self.inner_law(), self.split(state)
        force, stroke = self.spring_force(deflections), x - _total(deflections)
        limit = jnp.asarray(FASTEST, dtype=inner.dtype)
        guess = within(jnp.asarray(v, dtype=inner.dtype), -limit, limit)
        velocity = increasing_root(lambda w: law.force(stroke, w, inner) - force, guess, -limit, limit, steps=60)
        rates = self.shared_rate(v - velocity, deflections)
        return jnp.concatenate([jnp.stack(rates), law.state_rate(stroke, velocity, inner)])

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Two-stage SDIRK step; the velocity is taken as linear over the step."""
        del x1
        law, (deflections, inner) = self.inner_law(), self.split(state)
        total = _total(deflections)
        v0, gained = jnp.asarray(v0, total.dtype), jnp.asarray(v1 - v0, total.dtype)

        def stage(share: float, now: _StageState) -> _StageResult:
            free = _total(now.deflections) + GAMMA * dt * (v0 + share * gained)
            return self._stage(law, free, now, GAMMA * dt, likely=3 if share < 1.0 else 2)

        def moved(rate: _StageResult, now: _StageState, part: float) -> _StageState:
            w, duration = rate.velocity, part * dt
            pairs = zip(now.deflections, rate.change, strict=True)
            stroke = now.stroke + duration * w
            inner = law.advance(now.stroke, w, stroke, w, now.inner, duration)
            after = tuple(old + (part / GAMMA) * change for old, change in pairs)
            return _StageState(after, stroke, inner, w + (1.0 - GAMMA) * gained)

        after = sdirk2(stage, moved, _StageState(deflections, x0 - total, inner, v0))
        return jnp.concatenate([jnp.stack(after.deflections), after.inner])

    def _stage(
        self, law: AbstractDamper, free: Scalar, now: _StageState, duration: ScalarLike, likely: int
    ) -> _StageResult:
        """The constant velocity of the law for which law and springs have the same force at the end of the stage."""

        def law_force(w: Scalar) -> Scalar:
            stroke = now.stroke + duration * w
            return law.force(stroke, w, law.implicit_stage(stroke, w, now.inner, duration))

        def deflections(w: Scalar) -> Deflections:
            return self.shared(free - duration * w, now.deflections, duration)

        at_rest = jnp.abs(law_force(jnp.zeros_like(free)))
        reach = self.largest_deflection(at_rest, now.deflections)
        spring_force = self.spring_in_stage(law_force, free, duration)
        limit = (jnp.abs(free) + reach) / duration + jnp.finfo(free.dtype).tiny
        velocity = increasing_root(
            lambda w: law_force(w) - spring_force(deflections(w)),
            between_numbers(now.guess, -limit, limit),
            -limit,
            limit,
            steps=MOST_STEPS,
            likely=0 if law.traits().solves_equation else likely,
            close=1e-4,
        )
        pairs = zip(now.deflections, deflections(velocity), strict=True)
        return _StageResult(velocity, tuple(new - old for old, new in pairs))


def require_feed_through(argument: str, law: AbstractDamper, name: str) -> None:
    """Refuse a law whose force does not depend directly on the velocity: no velocity could balance the springs."""
    if not law.traits().has_feed_through:
        must = "be a law whose force depends directly on the velocity"
        remedy = f"Put the lag outside, `Lag({name}(law))`, or combine two springs into one."
        _checks.refuse(argument, must, f"a {type(law).__name__}", remedy)


def _total(deflections: Deflections) -> Scalar:
    return sum(deflections[1:], deflections[0])
