"""The international roughness index of a road profile."""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.metrics._linear_system import StateSpace, respond_exactly
from jaxdamp.metrics._signals import as_signal


# The golden car, per unit of sprung mass: damper [1/s], spring and tyre [1/s^2], unsprung mass [-].
_DAMPER, _SPRING, _TYRE, _UNSPRUNG = 6.0, 63.3, 653.0, 0.15
_SPEED = 80.0 / 3.6  # m/s
_STEP = 0.025  # m, the longest step along the road
_RUN_UP = 11.0  # m, half a second


def _golden_car() -> StateSpace:
    """From slope to slope: states z_s' [-] and its rate [1/s], z_u' [-] and its rate [1/s], with ' = d/dx."""
    a = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-_SPRING, -_DAMPER, _SPRING, _DAMPER],
            [0.0, 0.0, 0.0, 1.0],
            [_SPRING / _UNSPRUNG, _DAMPER / _UNSPRUNG, -(_SPRING + _TYRE) / _UNSPRUNG, -_DAMPER / _UNSPRUNG],
        ]
    )
    return StateSpace(a, np.array([0.0, 0.0, 0.0, _TYRE / _UNSPRUNG]), np.array([1.0, 0.0, -1.0, 0.0]), 0.0)


def international_roughness_index(
    profile: SignalLike, spacing: ScalarLike | int, *, moving_average: float | int = 0.25
) -> Scalar:
    """International roughness index, IRI = (1/L) int |z_s' - z_u'| dx [m/m]; times 1000 in the usual m/km.

    The golden car (damper 6 1/s, spring 63.3 1/s^2, tyre 653 1/s^2, unsprung mass 0.15, all per sprung mass) drives
    at 80 km/h over the profile joined by straight lines and averaged over 250 mm; at the start it rides at the mean
    slope of the first 11 m. Its equations are solved exactly by the matrix exponential, in steps of at most 25 mm, so
    the result does not depend on the spacing of samples that show the same line (within 0.1 %). A sine of wavelength
    1, 2.4, 5, 16 or 50 m gives 2/pi times 0.2731, 1.6640, 1.1697, 1.5367 or 0.1366 times its slope amplitude, without
    the average, whose factor is sin(pi b/w)/(pi b/w) with b = 0.25 m.

    Differentiable in the profile wherever the car moves, and independent of the profile's offset and mean slope. The
    last 250 mm serve the average only.

    >>> x = jnp.arange(0.0, 200.0, 0.1)
    >>> profile = 0.001 * 2.4 / (2.0 * jnp.pi) * jnp.sin(2.0 * jnp.pi * x / 2.4)  # slope 1 mm/m
    >>> round(1000.0 * float(international_roughness_index(profile, 0.1)), 2)  # m/km
    1.03

    Args:
        profile: Height of one wheel track [m], shape [samples], longer than 11.25 m.
        spacing: The distance between samples [m], at most 0.3 m and known when compiled.
        moving_average: The length of the moving average [m]; 0 for a profile that is averaged already, by a
            profilometer that reports means over 250 mm or by a spacing as long. It is never shorter than a step of
            the solution, at most 25 mm.

    Raises:
        ValueError: If the profile is too short, `spacing` is not positive, above 0.3 m or traced, or `moving_average`
            is negative.

    Source: Sayers, Gillespie and Queiroz, World Bank Technical Papers 45 and 46 (1986); ASTM E1926. Parameters as
    in a public implementation, gains computed independently; the test profile of the standard was not at hand, and the
    largest spacing is quoted from memory and not verified.
    """
    heights = as_signal("profile", profile, least=2)
    known = _checks.concrete(spacing)
    if known is None:
        _checks.refuse("spacing", "be known when the code is compiled", "traced", "Close over a plain number.")
    _checks.positive("spacing", spacing, "It is the distance between samples in m.")
    _checks.nonnegative("moving_average", moving_average, "Use 0 for no moving average.")
    distance = float(known)
    if distance > 0.3:
        _checks.refuse("spacing", "not exceed 0.3 m", distance, "Sample the road more closely; it is in m.")
    length = (heights.size - 1) * distance
    if length <= _RUN_UP + moving_average:
        must = f"be longer than {_RUN_UP + moving_average:g} m"
        _checks.refuse("profile", must, f"{length:g} m long", "Measure further, or check `spacing`.")
    cuts = math.ceil(distance / _STEP - 1e-9)
    step = distance / cuts
    road = _refined(heights, cuts)
    base = max(1.0, round(moving_average / step, 9))
    slope = _rise(road, base) / (base * step)
    run_up = round(_RUN_UP / step)
    start = (road[run_up] - road[0]) / (run_up * step)
    # relative to the mean slope of the run-up the car starts at rest
    rate = respond_exactly(_golden_car(), slope - start, step / _SPEED)
    size = jnp.abs(rate)
    return (jnp.sum(size) - 0.5 * (size[0] + size[-1])) / (size.size - 1)


def _refined(heights: Signal, cuts: int) -> Float[Array, " finer"]:
    """The profile with every interval cut into equal parts."""
    parts = jnp.arange(cuts, dtype=heights.dtype) / cuts
    inner = heights[:-1, None] + parts[None, :] * jnp.diff(heights)[:, None]
    return jnp.concatenate([jnp.ravel(inner), heights[-1:]])


def _rise(road: Signal, base: float) -> Float[Array, " shorter"]:
    """The rise over the next `base` steps, at every step for which the road is long enough."""
    whole, part = int(base), base - int(base)
    ahead = road[whole:]
    if part > 0.0:
        ahead = ahead[:-1] + part * jnp.diff(ahead)
    return ahead - road[: ahead.size]
