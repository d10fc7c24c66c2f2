"""What engines, fits and other laws must know of a law beside its forces."""

from collections.abc import Iterable
from typing import NamedTuple


class Traits(NamedTuple):
    """Properties of a law that follow from its kind, not from its numbers: they are fixed when code is compiled.

    `law.traits()` gives them. They are asked of one law, never of several whose arrays are stacked. The defaults here
    are those of a law with states that declares nothing: safe, but not always the fastest.

    Attributes:
        has_feed_through: the force answers the velocity at the same instant, not only through the states. Without it
            no velocity matches the force of a spring: the law cannot stand in a `SeriesSpring` or a `Bushing`.
        extrapolable_states: no state has a kink where the velocity has one, so an engine may extrapolate the states
            instead of taking the law's own step for its prediction. True without states.
        linear_in_parameters: the force is linear in the parameters declared `linear=True`, all others fixed, so that a
            fit of these has a closed form.
        stroke_dependent: the stroke matters, at an instant or since the last reversal.
        stroke_dependent_at_rest: the force at zero velocity, with the states of rest, depends on the stroke, so that
            the law has a say in the static equilibrium of a vehicle.
        has_explicit_step: some states take an explicit step, which must be shorter than their time constants.
    """

    has_feed_through: bool = True
    extrapolable_states: bool = False
    linear_in_parameters: bool = False
    stroke_dependent: bool = True
    stroke_dependent_at_rest: bool = True
    has_explicit_step: bool = False


def combined_traits(traits: Iterable[Traits]) -> Traits:
    """The traits of laws whose forces add: what all of them allow, and what any of them has."""
    feed_through, extrapolable, linear, stroke, at_rest, explicit = zip(*traits, strict=True)
    return Traits(any(feed_through), all(extrapolable), all(linear), any(stroke), any(at_rest), any(explicit))
