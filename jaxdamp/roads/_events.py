"""What events on a road share: smooth rises, and a width given in time or as a distance with a speed."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import within
from jaxdamp._types import Scalar, ScalarLike, Signal


def raised_cosine(fraction: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """S(s) = (1 - cos(pi s))/2 for 0 <= s <= 1, 0 before and 1 after; continuous with its slope."""
    return 0.5 * (1.0 - jnp.cos(jnp.pi * within(fraction, 0.0, 1.0)))


def quintic_step(fraction: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """S(s) = s^3 (10 - 15 s + 6 s^2) for 0 <= s <= 1, 0 before and 1 after; continuous with slope and curvature.

    Its steepest slope is 15/8 and its largest curvature 10/sqrt(3), against pi/2 and pi^2/2 of the raised cosine.
    """
    s = within(fraction, 0.0, 1.0)
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def fade_in(time: Signal, ramp: float) -> Signal | Scalar:
    """The factor that lets a road begin at height and slope zero: S(t/ramp), or 1 throughout if `ramp` [s] is zero."""
    return raised_cosine(time / ramp) if ramp else jnp.ones((), time.dtype)


def given_in_time(
    name: str,
    value: ScalarLike | int | None,
    unit: str,
    distance_name: str,
    distance: ScalarLike | int | None,
    speed: ScalarLike | int | None,
) -> bool:
    """Whether `value`, a time or a frequency, was given (and not the distance with the speed); refuses anything else.

    Raises:
        ValueError: If not exactly one of `value` and `distance` is given, if `speed` is missing with the distance or
            given with the value, or if one of the three is not positive.
    """
    if (value is None) == (distance is None):
        both = "neither was given" if value is None else f"{value} {unit}, and {distance_name} {distance} m as well"
        _checks.refuse(
            name, f"be given, or `{distance_name}` with `speed`, but not both", both, "Give exactly one of them."
        )
    if value is not None:
        if speed is not None:
            _checks.refuse(
                "speed", f"be left out when `{name}` is given", speed, f"Give `{distance_name}` and `speed` instead."
            )
        _checks.positive(name, value)
        return True
    if speed is None:
        _checks.refuse("speed", f"be given with `{distance_name}`", speed, "Give the speed of the vehicle in m/s.")
    _checks.positive(distance_name, distance)
    _checks.positive("speed", speed, "Roads are driven forwards.")
    return False
