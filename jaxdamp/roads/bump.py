"""A single smooth bump."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.roads.base import AbstractRoad


def haversine(fraction: Signal, height: Scalar) -> Signal:
    """h(s) = H/2 (1 - cos(2 pi s)) [m] for 0 <= s <= 1, else zero; the slope is continuous, the curvature is not."""
    return 0.5 * height * (1.0 - jnp.cos(2.0 * jnp.pi * jnp.clip(fraction, 0.0, 1.0)))


@final
class CosineBump(AbstractRoad):
    """A haversine in time; made by `cosine_bump`."""

    peak: Scalar
    start: Scalar
    width: Scalar

    @eqx.filter_jit
    def height(self, time: SignalLike) -> Float[Array, "time 1"]:
        """The height [m] at each `time` [s]; see `cosine_bump`."""
        time = jnp.asarray(time, self.peak.dtype)
        return haversine((time - self.start) / self.width, self.peak)[:, None]

    @property
    def grid(self) -> None:
        """A formula has no samples."""
        return None

    @property
    def duration(self) -> None:
        """The ground behind the bump is level for ever."""
        return None


def cosine_bump(
    height: ScalarLike | int,
    *,
    start: ScalarLike | int = 1.0,
    duration: ScalarLike | int | None = None,
    length: ScalarLike | int | None = None,
    speed: ScalarLike | int | None = None,
) -> CosineBump:
    """A bump in the shape of one cosine period, z(t) = H/2 (1 - cos(2 pi (t - t0)/T)) for t0 <= t <= t0 + T, else zero.

    Give its width either as `duration`, or as `length` and `speed` (T = length/speed). Slope and height are zero at
    both ends; the vertical acceleration jumps there by 2 pi^2 H/T^2. Differentiable in every argument.

    >>> import jax.numpy as jnp
    >>> bump = cosine_bump(0.06, start=1.0, duration=0.25)
    >>> bump.height(jnp.array([0.5, 1.0625, 1.125, 2.0]))[:, 0].round(6)
    Array([0.  , 0.03, 0.06, 0.  ], dtype=float64)

    Args:
        height: H, the height of the crest [m]; negative for a dip.
        start: t0, the time [s] at which the wheel reaches the bump.
        duration: T, the time [s] to cross the bump.
        length: The length of the bump along the road [m], instead of `duration`.
        speed: The speed of the vehicle [m/s], with `length`.

    Raises:
        ValueError: If not exactly one of `duration` and `length` is given, if `speed` is missing with `length` or
            given with `duration`, if one of the three is not positive, or if `height` or `start` is not finite.

    Source: Barethiye, Pohit and Mitra (half car with a hybrid damper), equation 5: H = 0.06 m, 1 s <= t <= 1.25 s.
    """
    _checks.finite("height", height)
    _checks.finite("start", start)
    if (duration is None) == (length is None):
        both = "neither was given" if duration is None else f"{duration} s, and length {length} m was given as well"
        _checks.refuse(
            "duration", "be given, or `length` with `speed`, but not both", both, "Give exactly one of them."
        )
    if duration is not None:
        if speed is not None:
            _checks.refuse("speed", "be left out when `duration` is given", speed, "Give `length` and `speed` instead.")
        _checks.positive("duration", duration)
        width = jnp.asarray(duration, float)
    else:
        if speed is None:
            _checks.refuse("speed", "be given with `length`", speed, "Give the speed of the vehicle in m/s.")
        _checks.positive("length", length)
        _checks.positive("speed", speed, "Roads are driven forwards.")
        width = jnp.asarray(length, float) / jnp.asarray(speed, float)
    return CosineBump(peak=jnp.asarray(height, float), start=jnp.asarray(start, float), width=width)
