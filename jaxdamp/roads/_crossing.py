"""The choice between a time, and a distance with a speed, that the events on a road share."""

from jaxdamp import _checks
from jaxdamp._types import ScalarLike


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
