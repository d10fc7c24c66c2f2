"""The damper contract: the interface of every law.

Stroke x [m] and velocity v [m/s] are positive in extension (rebound), the force [N] is positive when it resists
extension: a passive law dissipates energy, ∮ F v dt ≥ 0. One instance is one damper; use `jax.vmap` for batches.
"""

import dataclasses
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, SupportsIndex

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, State
from jaxdamp.dampers._functions import by_name, with_functions
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers.contract import (
    Condition,
    Reach,
    Traits,
    check_conditions,
    combined_traits,
    from_samples,
    starts_of_bends,
)
from jaxdamp.dampers.fitted_range import FittedRange, Motion, RangeNote, StandardError
from jaxdamp.parameters import Module, check_parameters, readable


class AbstractDamper(Module):
    """A force law between two points, with a flat array of states (empty for memoryless laws).

    A law whose states are fast compared with a step of about a millisecond derives from this class and defines its own
    `advance`, exact or implicit. Other laws derive from `AbstractStateful`, `AbstractStateless` or
    `AbstractMemoryless`, which define it.
    `traits()` are the properties of a law that solvers, fits and other laws need to know besides its forces.
    """

    range_note: RangeNote = eqx.field(kw_only=True, default=RangeNote(), repr=False)

    def __check_init__(self) -> None:
        if "range_note" not in vars(self):  # after a hand-written `__init__`; JAX needs the field
            object.__setattr__(self, "range_note", RangeNote())
        check_parameters(self)
        check_conditions(self)

    # By identity, whatever is equal, as JAX asks of a function: `jax.jit(law.force)`.
    __hash__ = object.__hash__  # pyright: ignore[reportAssignmentType]

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[object, ...]:
        """Functions of JAX, such as the activation of a network, travel by their names: JAX pickles few of them."""
        named = jax.tree.map(by_name, self)
        if any(new is not old for new, old in zip(*map(jax.tree.leaves, (named, self)), strict=True)):
            return with_functions, (named,)
        return super().__reduce_ex__(protocol)

    def __repr__(self) -> str:
        return readable(self)

    @property
    def fitted_to(self) -> FittedRange | None:
        """The range of the records that the law was fitted to (`with_fitted_range`); results of `jit` have none."""
        return self.range_note.fitted_to

    @property
    def standard_errors(self) -> tuple[StandardError, ...]:
        """Standard errors of the fit that gave the law, whatever was changed later; empty for a law without one."""
        return self.range_note.standard_errors

    @abstractmethod
    def initial_state(self) -> State:
        """The states of a damper at rest without dynamic force."""

    def state_at_rest(self, x: ScalarLike) -> State:
        """The states of a damper that is held at stroke x [m] for long, in which vehicles start and are linearised.

        By default `initial_state()`, as of friction, which holds what it has. A law whose states follow its static
        force, or that of a law inside, overrides it: `state_rate(x, 0, state_at_rest(x))` is zero.
        """
        del x
        return self.initial_state()

    @abstractmethod
    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N] at stroke x [m], velocity v [m/s] and these states."""

    @abstractmethod
    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Time derivative of the states [1/s], for solvers of ordinary differential equations."""

    @abstractmethod
    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """The states after a step dt [s] over which stroke and velocity go from (x0, v0) to (x1, v1)."""

    def predict(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """An approximation of `advance` that may cost less, with which a solver predicts the force."""
        return self.advance(x0, v0, x1, v1, state, dt)

    def implicit_stage(self, x: ScalarLike, v: ScalarLike, state: State, duration: ScalarLike) -> State:
        """The states after a stage [s] of constant velocity v that ends at stroke x, in the step of a law in series.

        By default a step. A law whose own step has several implicit stages gives one, first order, at less cost.
        """
        return self.advance(x - duration * v, v, x, v, state, duration)

    def inner_laws(self) -> list["AbstractDamper"]:
        """The laws directly inside, in the order of the fields."""
        values = [getattr(self, field.name) for field in dataclasses.fields(self)]
        inside = [item for value in values for item in (value if isinstance(value, tuple) else (value,))]
        return [item for item in inside if isinstance(item, AbstractDamper)]

    def traits(self) -> Traits:
        """Properties that solvers, fits and other laws need to know; not defined for stacked laws.

        By default the combined traits of the laws inside, but without linearity in the parameters and without states
        that may be extrapolated, since these depend on the outer law.
        """
        inside = [law.traits() for law in self.inner_laws()]
        traits = combined_traits(inside) if inside else Traits()
        offset = traits.contains_offset or bool(self.constant_forces())
        return traits._replace(extrapolable_states=False, linear_in_parameters=False, contains_offset=offset)

    def at_temperature(self, temperature: ScalarLike) -> "AbstractDamper":
        """This law with its oil at a known temperature [K]; by default with the laws inside at this temperature.

        Unless `traits().temperature_dependent`, it is this law. The states may be fewer: a temperature that is known is
        no state.
        """
        if not any(law.traits().temperature_dependent for law in self.inner_laws()):
            return self
        inner = [law.at_temperature(temperature) for law in self.inner_laws()]
        return eqx.tree_at(lambda law: law.inner_laws(), self, inner)

    def values_at_start(self, temperature: ScalarLike) -> dict[str, ScalarLike]:
        """Own numbers that a temperature [K] at the first instant of a motion sets, by name; none by default."""
        del temperature
        return {}

    def side_by_side(self) -> tuple["AbstractDamper", ...]:
        """Laws whose forces add up to the force of this law; the law itself if it is no sum."""
        return (self,)

    @property
    def stroke_limits(self) -> tuple[ScalarLike, ScalarLike]:
        """Lowest and highest stroke [m] at which the law is valid; infinite without limits."""
        return -jnp.inf, jnp.inf

    def validity(self) -> str:
        """The valid range in words, for a law from data that has no force outside this range; empty for others."""
        return ""

    def motion_inside(self, motion: Motion) -> list[tuple["AbstractDamper", Motion]]:
        """The motion of each law directly inside for a motion of this law, as far as it is known.

        By default with the same stroke and velocity and an unknown force. A wrapper whose inner law has another motion
        overrides this.
        """
        return [(law, motion.with_force(None)) for law in self.inner_laws()]

    def conditions(self) -> tuple[Condition, ...]:
        """Conditions between several parameters of this law, without those of laws inside.

        The constructor refuses a law that violates one, and fits satisfy them. Write them with operators only, so that
        they also work on NumPy arrays without JAX.
        """
        return ()

    def constant_forces(self) -> tuple[str, ...]:
        """Own parameters whose only part, or a common part of whose numbers, is a force that never changes [N].

        A zero error of the load cell has the same effect, so that a fit with one gives these no part of it. A law whose
        static force has a meaning of its own, such as a gas charge, names none and has the trait `contains_offset`.
        """
        return ()

    @classmethod
    def has_conditions(cls) -> bool:
        """Whether the class has any conditions."""
        return cls.conditions is not AbstractDamper.conditions

    @classmethod
    def guess(cls, *samples: Any, **options: Any) -> "AbstractDamper":
        """A law of this class with starting values for a fit: `guess(velocity, force)`, arrays of all samples.

        A law that can estimate its parameters defines it with these two arguments, and `stroke` or `time` if it needs
        them; further arguments need defaults.

        Raises:
            ValueError: a class of laws without an estimate.
        """
        remedy = f"Pass an instance, `{cls.__name__}(...)`, as the start."
        _checks.refuse("law", "be a class that defines `guess`", f"the class {cls.__name__}", remedy)

    @classmethod
    def from_runs(cls, runs: Sequence[object]) -> "AbstractDamper":
        """A law of this class with starting values for a fit to bench records; by default `guess` of all samples."""
        return from_samples(cls.guess, runs)

    def other_starts(self, reach: Reach) -> list[dict[str, float]]:
        """Further starting values, from which a fit may reach another minimum.

        The sum of squares can have several minima if a parameter determines at which velocity, stroke or time the force
        curve bends. By default, each positive parameter in m/s, m or s in which the force is not linear is therefore
        tried at a quarter and at four times its value, limited to between 1 % and 100 % of the reach of the records. A
        law that needs other starts overrides this; one whose sum of squares has a single minimum returns an empty list.

        Arguments:
            reach: largest stroke and velocity in the records to be fitted.

        Returns:
            For each start, values by name of the field; other fields do not change. Laws inside define their own
            starts, and the starts of a composition change one law at a time.
        """
        return starts_of_bends(self, reach)

    def plainer(self, undetermined: Sequence[str], fastest: float) -> "AbstractDamper | None":
        """A law with fewer numbers to put in place of this one, where records do not determine some of its numbers.

        `identify.compare` fits it, and recommends it if it predicts as well. Terms of sums and laws in wrappers are
        left out without this, and numbers that may be zero are tried at zero.

        Arguments:
            undetermined: names of the numbers that the records do not determine, of a vector once for each.
            fastest: largest velocity of the records [m/s].

        Returns:
            The start of its fit; None if there is no plainer law.
        """
        del undetermined, fastest
        return None

    def without_effect(self, fastest: float) -> tuple[str, ...]:
        """Names of numbers that do not change the force of this law at its values; held in fits of plainer laws.

        Numbers at zero that may be zero are held without this.

        Arguments:
            fastest: largest velocity of the records [m/s].
        """
        del fastest
        return ()

    def __add__(self, other: "AbstractDamper") -> "AbstractDamper":
        """Two laws in parallel: the forces add."""
        if not isinstance(other, AbstractDamper):
            return NotImplemented
        from jaxdamp.dampers.sum import Sum, terms_of

        return Sum(terms_of(self) + terms_of(other))

    def __mul__(self, factor: ScalarLike | int) -> "AbstractDamper":
        """The force times a factor."""
        if isinstance(factor, AbstractDamper):
            return NotImplemented
        from jaxdamp.dampers.sum import Scaled

        return Scaled(self, factor)

    __rmul__ = __mul__


class AbstractStateless(AbstractDamper):
    """A law without states, whose force depends on stroke and velocity: it has one method, `force_stroke_velocity`."""

    def traits(self) -> Traits:
        """No states; linear in the parameters declared as linear, unless there are laws inside."""
        inside = self.inner_laws()
        feed_through = not inside or any(law.traits().has_feed_through for law in inside)
        offset = bool(self.constant_forces()) or any(law.traits().contains_offset for law in inside)
        temperature = any(law.traits().temperature_dependent for law in inside)
        return Traits(
            feed_through,
            extrapolable_states=True,
            linear_in_parameters=not inside,
            contains_offset=offset,
            temperature_dependent=temperature,
        )

    @abstractmethod
    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m] and velocity v [m/s]."""

    def initial_state(self) -> State:
        """No states."""
        return jnp.zeros(0)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N] at stroke x [m] and velocity v [m/s]."""
        own_states(self, state, 0)
        return self.force_stroke_velocity(x, v)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """No states."""
        del x, v
        own_states(self, state, 0)
        return state

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """No states."""
        del x0, v0, x1, v1, dt
        own_states(self, state, 0)
        return state


class AbstractMemoryless(AbstractStateless):
    """A law whose force depends on the velocity alone: it has one method, `force_velocity`."""

    def traits(self) -> Traits:
        """Those of a law without states, independent of the stroke."""
        return super().traits()._replace(stroke_dependent=False, stroke_dependent_at_rest=False)

    @abstractmethod
    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        del x
        return self.force_velocity(v)


class AbstractStateful(AbstractDamper):
    """A law with states that change slowly over a step; it uses Heun's method, second order and explicit."""

    def traits(self) -> Traits:
        """Those of any law with states, and an explicit step."""
        return super().traits()._replace(has_explicit_step=True)

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Heun's second-order step."""
        rate = self.state_rate(x0, v0, state)
        return state + 0.5 * dt * (rate + self.state_rate(x1, v1, state + dt * rate))


def refuse_states(argument: str, law: AbstractDamper, remedy: str) -> None:
    """Refuse a law with states where only a law without states can be used."""
    if law.initial_state().size:
        _checks.refuse(argument, "be without states", f"a {type(law).__name__}", remedy)
