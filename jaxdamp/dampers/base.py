"""The damper contract: what every law offers.

Stroke x [m] and velocity v [m/s] are positive in extension (rebound), the force [N] is positive when it resists
extension: a passive law takes in energy, ∮ F v dt ≥ 0. One instance is one damper; batches are made with `jax.vmap`.
"""

import dataclasses
from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, State
from jaxdamp.dampers._conditions import Condition, check_conditions
from jaxdamp.dampers._starts import Reach, starts_of_bends
from jaxdamp.dampers.fitted_range import FittedRange
from jaxdamp.dampers.motion import Motion
from jaxdamp.dampers.traits import Traits, combined_traits
from jaxdamp.parameters import Module, check_parameters, readable


START = "Start from `law.initial_state()`."


class AbstractDamper(Module):
    """A force law between two points, with a flat array of states (empty for memoryless laws).

    A law whose states are fast compared with a step of about a millisecond derives from this class and brings its own
    `advance`, exact or implicit. Other laws derive from `AbstractStateful`, `AbstractStateless` or
    `AbstractMemoryless`, which bring it.

    What engines, fits and other laws must know of a law beside its forces are its `traits()`. Every law can say in
    `fitted_to` which range its records covered (`with_fitted_range`).
    """

    fitted_to: FittedRange | None = eqx.field(kw_only=True, default=None, repr=False)

    def __check_init__(self) -> None:
        if "fitted_to" not in vars(self):  # as after an `__init__` written by hand; trees need the field to be there
            object.__setattr__(self, "fitted_to", None)
        check_parameters(self)
        check_conditions(self)

    def __repr__(self) -> str:
        return readable(self)

    @abstractmethod
    def initial_state(self) -> State:
        """The states of a damper at rest that carries no dynamic force."""

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
        """What `advance` will give, or something near it that costs less, from which an engine predicts the force."""
        return self.advance(x0, v0, x1, v1, state, dt)

    def inner_laws(self) -> list["AbstractDamper"]:
        """The laws directly inside, in the order of the fields."""
        values = [getattr(self, field.name) for field in dataclasses.fields(self)]
        inside = [item for value in values for item in (value if isinstance(value, tuple) else (value,))]
        return [item for item in inside if isinstance(item, AbstractDamper)]

    def traits(self) -> Traits:
        """What engines, fits and other laws must know beside the forces; to be asked of one law, never a stacked one.

        By default those of the laws inside together, but for what the law around them decides: neither linearity in the
        parameters nor states that may be extrapolated.
        """
        inside = [law.traits() for law in self.inner_laws()]
        if not inside:
            return Traits()
        return combined_traits(inside)._replace(extrapolable_states=False, linear_in_parameters=False)

    def side_by_side(self) -> tuple["AbstractDamper", ...]:
        """Laws whose forces add to that of this law, as fine as they can be told apart; the law itself if it is one."""
        return (self,)

    @property
    def stroke_limits(self) -> tuple[ScalarLike, ScalarLike]:
        """Lowest and highest stroke [m] at which the law holds; infinite without limits."""
        return -jnp.inf, jnp.inf

    def validity(self) -> str:
        """Where the law itself has a force, in words, if it is made from data and has none elsewhere; or empty."""
        return ""

    def motion_inside(self, motion: Motion) -> list[tuple["AbstractDamper", Motion]]:
        """What each law directly inside goes through while this law goes through a motion, as far as it is known.

        By default stroke and velocity are those of the whole, and the force is not known. A wrapper whose inner law
        moves otherwise says how.
        """
        return [(law, motion.with_force(None)) for law in self.inner_laws()]

    def conditions(self) -> tuple[Condition, ...]:
        """What must hold between several parameters of this law, beside the domain of each; of laws inside not.

        The constructor refuses a law that breaks one, and a fit keeps inside. Written with operators only, so that
        NumPy's numbers stay NumPy's.
        """
        return ()

    @classmethod
    def has_conditions(cls) -> bool:
        """Whether there are any, known without computing them."""
        return cls.conditions is not AbstractDamper.conditions

    def other_starts(self, reach: Reach) -> list[dict[str, float]]:
        """Values of own parameters from which a fit may end in another minimum than from this law's own values.

        A sum of squares has several minima where a parameter says at which velocity, stroke or time the force curve
        bends. So each positive number in m/s, m or s in which the force is not linear is tried at a quarter and at four
        times its value, kept between a hundredth of the reach of the records and all of it. A law for which that is
        not enough brings its own list; one whose sum of squares has one minimum gives an empty one.

        Arguments:
            reach: how far the records to be fitted go.

        Returns:
            One mapping of names of fields to values for each start; fields left out keep their values. Laws inside
            give their own, and the starts of a composition change one law at a time.
        """
        return starts_of_bends(self, reach)

    def __add__(self, other: "AbstractDamper") -> "AbstractDamper":
        """Two laws side by side: forces add."""
        if not isinstance(other, AbstractDamper):
            return NotImplemented
        from jaxdamp.dampers.sum import Sum, terms_of

        return Sum(terms_of(self) + terms_of(other))

    def __mul__(self, factor: Any) -> "AbstractDamper":
        """The force times a factor."""
        if isinstance(factor, AbstractDamper):
            return NotImplemented
        from jaxdamp.dampers.scaled import Scaled

        return Scaled(self, factor)

    __rmul__ = __mul__


class AbstractStateless(AbstractDamper):
    """A law whose force depends on stroke and velocity at this instant: it has one method, `force_stroke_velocity`."""

    def traits(self) -> Traits:
        """No states; linear in the parameters declared so, unless there are laws inside."""
        inside = self.inner_laws()
        feed_through = not inside or any(law.traits().has_feed_through for law in inside)
        return Traits(feed_through, extrapolable_states=True, linear_in_parameters=not inside)

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
        """Those of a law without states, and no stroke."""
        return super().traits()._replace(stroke_dependent=False, stroke_dependent_at_rest=False)

    @abstractmethod
    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        del x
        return self.force_velocity(v)


class AbstractStateful(AbstractDamper):
    """A law with states that change slowly over a step: the step is Heun's, second order and explicit."""

    def traits(self) -> Traits:
        """Those of any law with states, and an explicit step."""
        return super().traits()._replace(has_explicit_step=True)

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Heun's second-order step."""
        rate = self.state_rate(x0, v0, state)
        return state + 0.5 * dt * (rate + self.state_rate(x1, v1, state + dt * rate))


def own_states(law: AbstractDamper, state: State, count: int) -> list[Scalar]:
    """The states as numbers; another count than that of the law is refused."""
    if state.size != count:
        must = f"hold {count} number{'s' * (count != 1)} for {type(law).__name__}"
        _checks.refuse("state", must, f"of shape {state.shape}", START)
    return list(state)


def laws_inside(tree: Any, prefix: str = "") -> list[tuple[str, AbstractDamper]]:
    """All laws in a law, a vehicle or another module, each with the prefix of the paths of its parameters."""
    if isinstance(tree, tuple | list):
        return [entry for i, item in enumerate(tree) for entry in laws_inside(item, f"{prefix}{i}.")]
    if not isinstance(tree, eqx.Module):
        return []
    own = [(prefix, tree)] if isinstance(tree, AbstractDamper) else []
    inner = [laws_inside(getattr(tree, field.name), f"{prefix}{field.name}.") for field in dataclasses.fields(tree)]
    return own + [entry for part in inner for entry in part]


def refuse_states(argument: str, law: AbstractDamper, remedy: str) -> None:
    """Refuse a law with states where only the force of this instant has a meaning."""
    if law.initial_state().size:
        _checks.refuse(argument, "be without states", f"a {type(law).__name__}", remedy)
