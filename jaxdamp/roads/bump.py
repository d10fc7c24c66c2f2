"""Single events on a level road: a shape, scaled and placed in time."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.tree_util import Partial
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import within
from jaxdamp._traced import behind
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.roads._crossing import given_in_time
from jaxdamp.roads._fade import quintic_step
from jaxdamp.roads.base import AbstractRoad


@final
class Bump(AbstractRoad):
    """z(t) = H f((t - t0)/T); created by `cosine_bump`, `half_sine_bump`, `trapezoid_bump`, `pothole` and others.

    Attributes:
        shape: f, a function of the fraction of the event that the wheel has passed.
        peak: H [m], negative for a hole.
        start: t0 [s].
        width: T [s].
        driven_at: V [m/s], if the width was given as a length.
    """

    shape: Partial
    peak: Scalar
    start: Scalar
    width: Scalar
    driven_at: Scalar | None

    @property
    def speed(self) -> Scalar | None:
        """The speed [m/s] that the road was created for."""
        return self.driven_at

    @property
    def shortest_event(self) -> float | None:
        """Its own width T [s]; `None` where it is not known yet, or of height zero."""
        width, peak = behind(self.width), behind(self.peak)
        return None if width is None or peak is None or not np.any(peak) else float(np.min(width))

    @eqx.filter_jit
    def heights_at(self, time: SignalLike) -> Float[Array, "time 1"]:
        """The height [m] at each `time` [s]; see the function that made the road."""
        time = jnp.asarray(time, self.peak.dtype)
        return (self.peak * self.shape((time - self.start) / self.width))[:, None]


def place(
    shape: Partial,
    height: ScalarLike | int,
    start: ScalarLike | int,
    duration: ScalarLike | int | None,
    length: ScalarLike | int | None,
    speed: ScalarLike | int | None,
) -> Bump:
    """The event with its arguments checked; its width T is `duration` or length/speed."""
    _checks.finite("height", height)
    _checks.finite("start", start)
    in_time = given_in_time("duration", duration, "s", "length", length, speed)
    driven = None if in_time else jnp.asarray(speed, float)
    width = jnp.asarray(duration, float) if driven is None else jnp.asarray(length, float) / driven
    return Bump(shape, jnp.asarray(height, float), jnp.asarray(start, float), width, driven)


def haversine(fraction: Signal) -> Signal:
    """f(s) = (1 - cos(2 pi s))/2 for 0 <= s <= 1, else zero; the slope is continuous, the curvature is not."""
    return 0.5 * (1.0 - jnp.cos(2.0 * jnp.pi * within(fraction, 0.0, 1.0)))


def quintic_bump(fraction: Signal) -> Signal:
    """f(s) = S(1 - |2 s - 1|) with the quintic step S: up and down, continuous with slope and curvature."""
    return quintic_step(1.0 - jnp.abs(2.0 * fraction - 1.0))


def cosine_bump(
    height: ScalarLike | int,
    *,
    start: ScalarLike | int = 1.0,
    duration: ScalarLike | int | None = None,
    length: ScalarLike | int | None = None,
    speed: ScalarLike | int | None = None,
    smooth: bool = False,
) -> Bump:
    """A bump in the shape of one cosine period, z(t) = H/2 (1 - cos(2 pi (t - t0)/T)) for t0 <= t <= t0 + T, else zero.

    Give its width either as `duration`, or as `length` and `speed` (T = length/speed). Slope and height are zero at
    both ends; the vertical acceleration jumps there by 2 pi^2 H/T^2. With `smooth` the flanks are quintic polynomials
    instead, s^3 (10 - 15 s + 6 s^2), whose acceleration is continuous everywhere; its largest value, 40 H/(sqrt(3)
    T^2), is 17 % greater. Differentiable in every argument.

    Arguments:
        height: H, the height of the crest [m]; negative for a dip.
        start: t0, the time [s] at which the wheel reaches the bump.
        duration: T, the time [s] to cross the bump.
        length: the length of the bump along the road [m], instead of `duration`.
        speed: the speed of the vehicle [m/s], with `length`.
        smooth: continuous acceleration.

    Raises:
        ValueError: if not exactly one of `duration` and `length` is given, if `speed` is missing with `length` or
            given with `duration`, if one of the three is not positive, or if `height` or `start` is not finite.

    Source: Barethiye, Pohit and Mitra (half car with a hybrid damper), equation 5: H = 0.06 m, 1 s <= t <= 1.25 s.

    >>> import jax.numpy as jnp
    >>> bump = cosine_bump(0.06, start=1.0, duration=0.25)
    >>> bump.height(jnp.array([0.5, 1.0625, 1.125, 2.0]))[:, 0].round(6)
    Array([0.  , 0.03, 0.06, 0.  ], dtype=float64)
    """
    return place(Partial(quintic_bump if smooth else haversine), height, start, duration, length, speed)
