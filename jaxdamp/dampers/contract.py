"""What others need to know of a law: its traits, conditions between its parameters, where fits of it start."""

import dataclasses
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import PyTree

from jaxdamp import _checks
from jaxdamp._traced import row, rows
from jaxdamp._types import ScalarLike


T = TypeVar("T")


class Traits(NamedTuple):
    """Properties of a law that do not depend on its parameter values: they are fixed when code is compiled.

    `law.traits()` returns them for a single law, not for several laws whose arrays are stacked. The defaults here are
    safe for any law with states, but not always the fastest.

    Attributes:
        has_feed_through: the force depends directly on the velocity, not only through the states. Otherwise no velocity
            could balance the force of a spring: the law cannot be used in a `SeriesSpring` or a `Bushing`.
        extrapolable_states: no state has a kink where the velocity has one, so a solver may extrapolate the states for
            its prediction instead of computing the step of the law. True without states.
        linear_in_parameters: the force is linear in the parameters declared `linear=True`, all others fixed, so that a
            fit of these has a closed form.
        stroke_dependent: the force depends on the stroke, directly or since the last reversal.
        stroke_dependent_at_rest: the force at rest, in the states of `state_at_rest`, depends on the stroke, so that
            the law affects the static equilibrium of a vehicle.
        has_explicit_step: some states have an explicit step, which must be shorter than their time constants.
        contains_offset: a parameter adds a constant to the force, as a zero error of a load cell does, so that a fit
            cannot tell the two apart (`constant_forces` names it, if it has no other meaning).
        temperature_dependent: the force depends on the temperature of the oil, which a measured one may replace
            (`at_temperature`).
        solves_equation: the step solves an equation by iteration, so that a law around it should write out none of its
            own iterations: the compiled code would multiply.
        step_angle: largest step of a fit, as an angle of the dominant frequency of a record [rad]. A law whose force
            rises steeply after a reversal needs short steps.
    """

    has_feed_through: bool = True
    extrapolable_states: bool = False
    linear_in_parameters: bool = False
    stroke_dependent: bool = True
    stroke_dependent_at_rest: bool = True
    has_explicit_step: bool = False
    contains_offset: bool = False
    temperature_dependent: bool = False
    solves_equation: bool = False
    step_angle: float = 0.06

    def scaled_along_stroke(self) -> "Traits":
        """Those of the force times a factor of the stroke: at rest it changes with the stroke, even if constant."""
        constant = self.contains_offset or self.temperature_dependent  # heat holds one (`Heated.static_force_slope`)
        at_rest = self.stroke_dependent_at_rest or constant
        return self._replace(stroke_dependent=True, stroke_dependent_at_rest=at_rest)


def combined_traits(traits: Iterable[Traits]) -> Traits:
    """The traits of a sum of laws."""
    feed_through, extrapolable, linear, *others, angles = zip(*traits, strict=True)
    return Traits(any(feed_through), all(extrapolable), all(linear), *map(any, others), step_angle=min(angles))


class Reach(NamedTuple):
    """The extent of records.

    Attributes:
        stroke: half the range of the stroke [m].
        velocity: largest magnitude of the velocity [m/s].
    """

    stroke: float  # half the range [m]
    velocity: float  # largest magnitude [m/s]


def from_samples(make: Callable[..., T], runs: Sequence[object]) -> T:
    """The law that a function makes from the samples of all records one after the other.

    The function gets velocity and force as its first two arguments, and `stroke` and `time` if it has arguments of
    these names.

    Arguments:
        make: function of velocity [m/s] and force [N], such as the `guess` of a law.
        runs: the records.
    """
    names = inspect.signature(make).parameters
    channels = ["velocity", "force", *(name for name in ("stroke", "time") if name in names)]
    velocity, force, *others = (np.concatenate([getattr(run, name) for run in runs]) for name in channels)
    return make(velocity, force, **dict(zip(channels[2:], others, strict=True)))


def starts_of_bends(law: PyTree, reach: Reach) -> list[dict[str, float]]:
    """A quarter and four times each positive parameter that may determine where the force curve bends.

    These are the parameters in m/s, m or s in which the force is not linear; the values are limited to between 1 % and
    100 % of the extent of the records.
    """
    spans = {"m/s": reach.velocity, "m": reach.stroke}
    starts = []
    for field in dataclasses.fields(law):
        declared = field.metadata.get("parameter")
        if declared is None or declared["unit"] not in ("m/s", "m", "s") or declared["linear"]:
            continue
        value = np.asarray(getattr(law, field.name))
        if value.ndim or not value > 0:
            continue
        span = spans.get(declared["unit"], np.inf)
        least = 0.0 if np.isinf(span) else 0.01 * span
        starts += [{field.name: float(np.clip(factor * value, least, span))} for factor in (0.25, 4.0)]
    return starts


class Condition(NamedTuple):
    """A lower limit of one parameter of a law that depends on its other parameters.

    Attributes:
        parameter: its name.
        least: the limit, in the unit of the parameter.
        formula: the limit in words.
        reason: the consequence of a lower value, a sentence.
    """

    parameter: str
    least: ScalarLike
    formula: str
    reason: str


def check_conditions(law: PyTree) -> None:
    """Refuse parameters that violate a condition between them (inside `jax.jit` they are not known)."""
    values = rows(law) if law.has_conditions() else None
    if not values:
        return
    for index in range(len(values[0])):
        one = row(law, values, index)
        for condition in one.conditions():
            value = np.asarray(getattr(one, condition.parameter))
            if not np.all(value > condition.least):
                must = f"be above {condition.formula}, {np.array2string(np.asarray(condition.least), precision=4)}"
                _checks.refuse(f"{type(law).__name__}.{condition.parameter}", must, value, condition.reason)
