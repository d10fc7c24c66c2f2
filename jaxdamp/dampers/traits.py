"""Properties of a law that solvers, fits and other laws need to know."""

from collections.abc import Iterable
from typing import NamedTuple


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
        stroke_dependent_at_rest: the force at zero velocity and initial states depends on the stroke, so that the law
            affects the static equilibrium of a vehicle.
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


def combined_traits(traits: Iterable[Traits]) -> Traits:
    """The traits of a sum of laws."""
    feed_through, extrapolable, linear, *others, angles = zip(*traits, strict=True)
    return Traits(any(feed_through), all(extrapolable), all(linear), *map(any, others), step_angle=min(angles))
