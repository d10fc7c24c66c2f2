"""Bumps with corners, each corner sharp or rounded."""

import jax.numpy as jnp
from jax.tree_util import Partial

from jaxdamp import _checks
from jaxdamp._limits import at_least, within
from jaxdamp._types import Scalar, ScalarLike, Signal
from jaxdamp.roads.bump import Bump, place


# Rounded corners reach this far at most, as a share of the bump: a quarter, where those of a triangle meet.
_LARGEST_ROUNDING = 0.25


def rounded_corner(s: Signal, reach: Scalar) -> Signal:
    """max(s, 0) with its corner rounded within -r <= s <= r, continuous with slope and curvature; exact for r = 0.

    Its curvature is (1 + cos(pi s/r))/(2 r), from which r [(1 + u)^2/4 - (1 + cos(pi u))/(2 pi^2)] with u = s/r. At
    the corner it is r (1/4 - 1/pi^2) = 0.149 r too high.
    """
    safe = jnp.where(reach > 0.0, reach, 1.0)
    u = within(s / safe, -1.0, 1.0)
    rounded = safe * ((1.0 + u) ** 2 / 4.0 - (1.0 + jnp.cos(jnp.pi * u)) / (2.0 * jnp.pi**2))
    sharp = at_least(s, 0.0)
    return jnp.where((reach > 0.0) & (jnp.abs(s) < reach), rounded, sharp)


def half_sine(fraction: Signal, rounding: Scalar) -> Signal:
    """f(s) = max(sin(pi s), 0) over one arch, its two corners rounded within +-`rounding` of each end."""
    arch = jnp.sin(jnp.pi * within(fraction, -0.5, 1.5))
    return rounded_corner(arch, jnp.sin(jnp.pi * rounding))


def trapezoid(fraction: Signal, platform: Scalar, rounding: Scalar) -> Signal:
    """f(s) = straight ramp, level for the share `platform` of the length, straight ramp; corners rounded."""
    ramp = 0.5 * (1.0 - platform)
    ends = rounded_corner(fraction, rounding) + rounded_corner(fraction - 1.0, rounding)
    edges = rounded_corner(fraction - ramp, rounding) + rounded_corner(fraction - 1.0 + ramp, rounding)
    return (ends - edges) / ramp


def half_sine_bump(
    height: ScalarLike | int,
    *,
    start: ScalarLike | int = 1.0,
    duration: ScalarLike | int | None = None,
    length: ScalarLike | int | None = None,
    speed: ScalarLike | int | None = None,
    rounding: float | int = 0.0,
) -> Bump:
    """Half a period of a sine, z(t) = H sin(pi (t - t0)/T) for t0 <= t <= t0 + T, else zero: a pipe or sleeper.

    Sharp (`rounding` zero) its slope jumps by pi H/T at both ends, which would require an infinite acceleration of a
    wheel with point contact. Rounded, height, slope and curvature are continuous everywhere; the bump then begins T
    `rounding` earlier and ends as much later. Differentiable in every argument but `rounding`.

    Arguments:
        height: H, the height of the crest [m]; negative for a dip.
        start: t0, the time [s] at which the wheel reaches the sharp bump.
        duration: T, the time [s] to cross it.
        length: its length along the road [m], instead of `duration`.
        speed: the speed of the vehicle [m/s], with `length`.
        rounding: how far each corner is rounded to either side, as a share of the length, 0 to 0.25.

    Raises:
        ValueError: as for `cosine_bump`, or if `rounding` is not between 0 and 0.25.

    >>> import jax.numpy as jnp
    >>> pipe = half_sine_bump(0.1, start=1.0, length=0.5, speed=5.0)
    >>> pipe.height(jnp.array([1.0, 1.025, 1.05, 1.1]))[:, 0].round(4)
    Array([0.    , 0.0707, 0.1   , 0.    ], dtype=float64)
    """
    shape = Partial(half_sine, rounding=_rounding(rounding))
    return place(shape, height, start, duration, length, speed)


def trapezoid_bump(
    height: ScalarLike | int,
    *,
    platform: ScalarLike | int = 0.5,
    start: ScalarLike | int = 1.0,
    duration: ScalarLike | int | None = None,
    length: ScalarLike | int | None = None,
    speed: ScalarLike | int | None = None,
    rounding: float | int = 0.0,
) -> Bump:
    """A speed table: a straight ramp up, a level platform, a straight ramp down.

    Sharp (`rounding` zero) its slope jumps at the four corners. Rounded, each corner is replaced within +-`rounding`
    of the length by an arc of curvature proportional to 1 + cos, so that height, slope and curvature are continuous
    everywhere; the bump then begins T `rounding` earlier and ends as much later. Differentiable in every argument but
    `rounding`.

    Arguments:
        height: H, the height of the platform [m]; negative for a trench.
        platform: the share of the length that is level, at least 0 and below 1; each ramp takes half of the rest.
        start: t0, the time [s] at which the wheel reaches the sharp bump.
        duration: T, the time [s] to cross it.
        length: its length along the road [m], ramps included, instead of `duration`.
        speed: the speed of the vehicle [m/s], with `length`.
        rounding: how far each corner is rounded to either side, as a share of the length, 0 to 0.25.

    Raises:
        ValueError: as for `cosine_bump`, or if `rounding` is not between 0 and 0.25 or `platform` not within [0, 1).

    >>> import jax.numpy as jnp
    >>> table = trapezoid_bump(0.1, platform=0.5, start=1.0, length=4.0, speed=4.0)
    >>> table.height(jnp.array([1.125, 1.25, 1.5, 1.875, 2.0]))[:, 0].round(4)
    Array([0.05, 0.1 , 0.1 , 0.05, 0.  ], dtype=float64)
    """
    _checks.nonnegative("platform", platform, "Use 0 for a triangle.")
    share = _checks.concrete(platform)
    if share is not None and share >= 1.0:
        _checks.refuse("platform", "be below 1: the ramps need a length too", share, "It is a share of the length.")
    shape = Partial(trapezoid, platform=jnp.asarray(platform, float), rounding=_rounding(rounding))
    return place(shape, height, start, duration, length, speed)


def triangular_bump(
    height: ScalarLike | int,
    *,
    start: ScalarLike | int = 1.0,
    duration: ScalarLike | int | None = None,
    length: ScalarLike | int | None = None,
    speed: ScalarLike | int | None = None,
    rounding: float | int = 0.0,
) -> Bump:
    """Two straight ramps that meet in a crest at height H: `trapezoid_bump` without a platform.

    Rounding lowers the crest by 0.595 `rounding` H (12 % at 0.2), because the corner is cut.

    Arguments:
        height: H, the height of the sharp crest [m]; negative for a dip.
        start: t0, the time [s] at which the wheel reaches the sharp bump.
        duration: T, the time [s] to cross it.
        length: its length along the road [m], instead of `duration`.
        speed: the speed of the vehicle [m/s], with `length`.
        rounding: how far each corner is rounded to either side, as a share of the length, 0 to 0.25.

    Raises:
        ValueError: as for `cosine_bump`, or if `rounding` is not between 0 and 0.25.

    >>> import jax.numpy as jnp
    >>> triangular_bump(0.1, start=1.0, length=4.0, speed=4.0).height(jnp.array([1.25, 1.5, 1.75]))[:, 0].round(4)
    Array([0.05, 0.1 , 0.05], dtype=float64)
    """
    return trapezoid_bump(
        height, platform=0.0, start=start, duration=duration, length=length, speed=speed, rounding=rounding
    )


def _rounding(rounding: float | int) -> Scalar:
    _checks.nonnegative("rounding", rounding, "Use 0 for sharp corners.")
    if rounding > _LARGEST_ROUNDING:
        _checks.refuse("rounding", "be at most 0.25, a quarter of the bump", rounding, "It is a share of the length.")
    return jnp.asarray(rounding, float)
