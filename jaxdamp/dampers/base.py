"""The damper contract: what every law offers, and the sum and the scaling of laws.

Stroke x [m] and velocity v [m/s] are positive in extension (rebound), the force [N] is positive when it resists
extension: a passive law takes in energy, ∮ F v dt ≥ 0. One instance is one damper; batches are made with `jax.vmap`.
"""

import dataclasses
from abc import abstractmethod
from typing import Any, ClassVar, NamedTuple, TypeVar, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers.fitted_range import UNITS, FittedRange, Limits
from jaxdamp.dampers.motion import Motion
from jaxdamp.parameters import check_parameters, nonnegative, parameter, readable, real


L = TypeVar("L")


class Condition(NamedTuple):
    """A lower limit of one parameter of a law that depends on its other parameters."""

    parameter: str
    least: Any  # in the unit of the parameter
    formula: str  # the limit in words
    reason: str  # what goes wrong below it, a sentence


class Reach(NamedTuple):
    """How far records go."""

    stroke: float  # half the range [m]
    velocity: float  # largest magnitude [m/s]


class AbstractDamper(eqx.Module):
    """A force law between two points, with a flat array of states (empty for memoryless laws).

    A law whose states are fast compared with a step of about a millisecond derives from this class and brings its own
    `advance`, exact or implicit. Other laws derive from `AbstractStateful`, `AbstractStateless` or
    `AbstractMemoryless`, which bring it.

    Every law can say in `fitted_to` which range its records covered (`with_fitted_range`).
    """

    answers_at_once: ClassVar[bool] = True  # the force depends on the velocity directly, not only through states
    smooth_state: ClassVar[bool] = False  # own states have no kink where the velocity has one: may be extrapolated

    fitted_to: FittedRange | None = eqx.field(kw_only=True, default=None, repr=False)

    def __check_init__(self) -> None:
        if "fitted_to" not in vars(self):  # as after an `__init__` written by hand; trees need the field to be there
            object.__setattr__(self, "fitted_to", None)
        check_parameters(self)
        _check_conditions(self)

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

    def laws_with_states(self) -> list["AbstractDamper"]:
        """The laws inside whose states are part of this law's states: all laws in its fields, unless it says others."""
        return parts(self)

    def motion_inside(self, motion: Motion) -> list[tuple["AbstractDamper", Motion]]:
        """What each law directly inside goes through while this law goes through a motion, as far as it is known.

        By default stroke and velocity are those of the whole, and the force is not known. A wrapper whose inner law
        moves otherwise says how.
        """
        return [(part, motion.with_force(None)) for part in parts(self)]

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
        spans = {"m/s": reach.velocity, "m": reach.stroke}
        starts = []
        for field in dataclasses.fields(self):
            declared = field.metadata.get("parameter")
            if declared is None or declared["unit"] not in ("m/s", "m", "s") or declared["linear"]:
                continue
            value = np.asarray(getattr(self, field.name))
            if value.ndim or not value > 0:
                continue
            span = spans.get(declared["unit"], np.inf)
            least = 0.0 if np.isinf(span) else 0.01 * span
            starts += [{field.name: float(np.clip(factor * value, least, span))} for factor in (0.25, 4.0)]
        return starts

    def __add__(self, other: "AbstractDamper") -> "AbstractDamper":
        """Two laws side by side: forces add."""
        if not isinstance(other, AbstractDamper):
            return NotImplemented
        return Sum(_terms(self) + _terms(other))

    def __mul__(self, factor: Any) -> "AbstractDamper":
        """The force times a factor."""
        if isinstance(factor, AbstractDamper):
            return NotImplemented
        return Scaled(self, factor)

    __rmul__ = __mul__


def _check_conditions(law: AbstractDamper) -> None:
    """Refuse parameters that break a condition between them (traced values pass)."""
    if not law.has_conditions() or any(_checks.concrete(leaf) is None for leaf in jax.tree.leaves(law)):
        return
    for condition in jax.tree.map(np.asarray, law).conditions():
        value = np.asarray(getattr(law, condition.parameter))
        if not np.all(value > condition.least):
            must = f"be above {condition.formula}, {np.array2string(np.asarray(condition.least), precision=4)}"
            _checks.refuse(f"{type(law).__name__}.{condition.parameter}", must, value, condition.reason)


class AbstractStateless(AbstractDamper):
    """A law whose force depends on stroke and velocity at this instant: it has one method, `force_stroke_velocity`."""

    @abstractmethod
    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m] and velocity v [m/s]."""

    def initial_state(self) -> State:
        """No states."""
        return jnp.zeros(0)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N] at stroke x [m] and velocity v [m/s]."""
        _check_stateless(self, state)
        return self.force_stroke_velocity(x, v)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """No states."""
        del x, v
        _check_stateless(self, state)
        return state

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """No states."""
        del x0, v0, x1, v1, dt
        _check_stateless(self, state)
        return state


class AbstractMemoryless(AbstractStateless):
    """A law whose force depends on the velocity alone: it has one method, `force_velocity`."""

    @abstractmethod
    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        del x
        return self.force_velocity(v)


class AbstractStateful(AbstractDamper):
    """A law with states that change slowly over a step: the step is Heun's, second order and explicit."""

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Heun's second-order step."""
        rate = self.state_rate(x0, v0, state)
        return state + 0.5 * dt * (rate + self.state_rate(x1, v1, state + dt * rate))


_START = "Start from `law.initial_state()`."


def _check_stateless(law: AbstractDamper, state: State) -> None:
    if state.size:
        _checks.refuse("state", f"be empty for {type(law).__name__}", f"of shape {state.shape}", _START)


def parts(law: AbstractDamper) -> list[AbstractDamper]:
    """The laws directly inside a law, in the order of its fields."""
    values = [getattr(law, field.name) for field in dataclasses.fields(law)]
    inside = [part for value in values for part in (value if isinstance(value, tuple) else (value,))]
    return [part for part in inside if isinstance(part, AbstractDamper)]


def with_fitted_range(law: L, fitted_to: FittedRange | None = None, **limits: Limits) -> L:
    """The same law with the range of the records that it was fitted to, in place of any range it had.

    `identify.fit` and `train` do this; state it yourself for a law whose numbers come from elsewhere. Laws inside keep
    ranges of their own. Everything that uses the law then says by how much it leaves the range.

    Arguments:
        law: any law.
        fitted_to: the range; or give the limits by name.
        limits: as `FittedRange` takes them, such as `velocity=(-0.5, 0.5)`.

    Raises:
        ValueError: something that is not a law; neither a range nor limits, or both; a quantity that no range has;
            limits out of order.

    >>> from jaxdamp.dampers import Linear
    >>> with_fitted_range(Linear(1500.0), velocity=(-0.5, 0.9)).fitted_to.words()
    'velocity −0.5 to 0.9 m/s'
    """
    if not isinstance(law, AbstractDamper):
        _checks.refuse("law", "be a damper law", f"a {type(law).__name__}", "Of a vehicle, give it to its dampers.")
    for name in limits:
        _checks.one_of("limits", name, UNITS)
    if (fitted_to is None) == (not limits):
        remedy = "Write for example `with_fitted_range(law, velocity=(-0.5, 0.5))`."
        _checks.refuse("fitted_to", "be given, or limits by name, and not both", repr(fitted_to), remedy)
    changed = object.__new__(type(law))
    for name, value in (vars(law) | {"fitted_to": fitted_to or FittedRange(**limits)}).items():
        object.__setattr__(changed, name, value)
    return changed


def laws_inside(tree: Any, prefix: str = "") -> list[tuple[str, AbstractDamper]]:
    """All laws in a law, a vehicle or another module, each with the prefix of the paths of its parameters."""
    if isinstance(tree, tuple | list):
        return [found for i, item in enumerate(tree) for found in laws_inside(item, f"{prefix}{i}.")]
    if not isinstance(tree, eqx.Module):
        return []
    own = [(prefix, tree)] if isinstance(tree, AbstractDamper) else []
    inner = [laws_inside(getattr(tree, field.name), f"{prefix}{field.name}.") for field in dataclasses.fields(tree)]
    return own + [found for part in inner for found in part]


def refuse_states(argument: str, law: AbstractDamper, remedy: str) -> None:
    """Refuse a law with states where only the force of this instant has a meaning."""
    if law.initial_state().size:
        _checks.refuse(argument, "be without states", f"a {type(law).__name__}", remedy)


def own_and_inner(law: AbstractDamper, state: State) -> tuple[Scalar, Float[Array, " inner"]]:
    """The first state, that of a wrapper, and the rest, those of the law inside."""
    if not state.size:
        _checks.refuse("state", f"hold the state of {type(law).__name__} first", "empty", _START)
    return state[0], state[1:]


def _terms(law: AbstractDamper) -> tuple[AbstractDamper, ...]:
    """The terms of a sum, or the law itself. What a sum was fitted to holds for its terms, but for the force."""
    if not isinstance(law, Sum):
        return (law,)
    if law.fitted_to is None:
        return law.terms
    covered = law.fitted_to.without("force")
    return tuple(with_fitted_range(term, covered) if term.fitted_to is None else term for term in law.terms)


def _states_of(terms: tuple[AbstractDamper, ...], state: State) -> list[Array]:
    """Cut the concatenated states of several laws into theirs."""
    sizes = [term.initial_state().size for term in terms]
    ends = [sum(sizes[: i + 1]) for i in range(len(sizes))]
    if state.size != ends[-1]:
        _checks.refuse("state", f"hold {ends[-1]} numbers for the terms of the sum", f"of shape {state.shape}", _START)
    return [state[end - size : end] for size, end in zip(sizes, ends, strict=True)]


@final
class Sum(AbstractDamper):
    """Laws side by side, F = Σ Fᵢ; made by `law + law`. States are concatenated in order."""

    terms: tuple[AbstractDamper, ...]

    preserves_linearity: ClassVar[bool] = True

    def __check_init__(self) -> None:
        if not self.terms:
            _checks.refuse("terms", "hold at least one law", self.terms)

    def initial_state(self) -> State:
        """The states of all terms."""
        return jnp.concatenate([term.initial_state() for term in self.terms])

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Sum of the forces [N]."""
        pairs = zip(self.terms, _states_of(self.terms, state), strict=True)
        return jnp.sum(jnp.stack([term.force(x, v, s) for term, s in pairs]), axis=0)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of all terms."""
        pairs = zip(self.terms, _states_of(self.terms, state), strict=True)
        return jnp.concatenate([term.state_rate(x, v, s) for term, s in pairs])

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Every term takes its own step."""
        pairs = zip(self.terms, _states_of(self.terms, state), strict=True)
        return jnp.concatenate([term.advance(x0, v0, x1, v1, s, dt) for term, s in pairs])

    def predict(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """What every term predicts."""
        pairs = zip(self.terms, _states_of(self.terms, state), strict=True)
        return jnp.concatenate([term.predict(x0, v0, x1, v1, s, dt) for term, s in pairs])


@final
class Scaled(AbstractDamper):
    """A law whose force is multiplied by a factor, F = factor · F_law; made by `2.0 * law`.

    Arguments:
        law: the law.
        factor: not negative: it would turn a damper into a drive, F v ≤ 0.
        allow_active: accept a negative factor, as in studies of stability: `Scaled(law, -2.0, allow_active=True)`.
    """

    law: AbstractDamper
    factor: Number = parameter("", "factor on the force", lambda law: real if law.allow_active else nonnegative)
    allow_active: bool = eqx.field(static=True, default=False)

    def __check_init__(self) -> None:
        factor = _checks.concrete(self.factor)
        if factor is not None and np.any(factor < 0) and not self.allow_active:
            remedy = "It makes the law drive the motion. If that is meant: `Scaled(law, factor, allow_active=True)`."
            _checks.refuse("factor", "not be negative", factor, remedy)

    preserves_linearity: ClassVar[bool] = True

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same motion at a force that is smaller by the factor."""
        return [(self.law, motion.divided(self.factor))]

    def initial_state(self) -> State:
        """The states of the law."""
        return self.law.initial_state()

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        return self.factor * self.law.force(x, v, state)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of the law."""
        return self.law.state_rate(x, v, state)

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """The step of the law."""
        return self.law.advance(x0, v0, x1, v1, state, dt)

    def predict(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """What the law predicts."""
        return self.law.predict(x0, v0, x1, v1, state, dt)
