"""Single events on a level road: bumps and holes, a shape scaled and placed in time, and steps."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.tree_util import Partial
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import within
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._traced import behind
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.roads.base import AbstractRoad, given_in_time, quintic_step, raised_cosine


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

    @compiled_for_loops
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


def smooth_box(fraction: Signal, edge: Scalar) -> Signal:
    """f(s) = (tanh(s/e) - tanh((s - 1)/e))/2: half at s = 0 and s = 1, nearly one between, all derivatives smooth."""
    return 0.5 * (jnp.tanh(fraction / edge) - jnp.tanh((fraction - 1.0) / edge))


def pothole(
    depth: ScalarLike | int,
    *,
    start: ScalarLike | int = 1.0,
    duration: ScalarLike | int | None = None,
    length: ScalarLike | int | None = None,
    speed: ScalarLike | int | None = None,
    edge: ScalarLike | int = 0.05,
) -> Bump:
    """A hole, z(t) = -D/2 (tanh((t - t0)/(e T)) - tanh((t - t0 - T)/(e T))).

    Each edge falls from 10 % to 90 % of the depth within 2.2 e of the length (1.1 e before and after t0). The floor
    is D tanh(1/(2 e)) deep in the middle: D within 1e-8 for the default edge, 4 % less for e = 0.25. Smooth in all
    derivatives; the greatest slope is D/(2 e T). A rigid wheel does not follow a real edge: see `contact_patch` and
    `rolling_disc`. Differentiable in every argument.

    Arguments:
        depth: D [m]; negative for a block lying on the road.
        start: t0, the time [s] at which the wheel is half way down the first edge. Leave a few e T before it, as the
            edge has no sharp beginning.
        duration: T, the time [s] from edge to edge.
        length: the distance from edge to edge [m], instead of `duration`.
        speed: the speed of the vehicle [m/s], with `length`.
        edge: e, the width of the edges as a share of the length, at most 0.25.

    Raises:
        ValueError: if not exactly one of `duration` and `length` is given, if `speed` is missing with `length` or
            given with `duration`, if one of the three or `edge` is not positive, if `edge` is above 0.25, or if
            `depth` or `start` is not finite.

    >>> import jax.numpy as jnp
    >>> hole = pothole(0.08, start=1.0, length=0.6, speed=10.0)
    >>> hole.height(jnp.array([0.9, 1.0, 1.03, 1.06, 1.2]))[:, 0].round(4)
    Array([-0.  , -0.04, -0.08, -0.04, -0.  ], dtype=float64)
    """
    _checks.finite("depth", depth)
    _checks.positive("edge", edge, "A sudden edge has no derivative: give it a few hundredths of the length.")
    width = _checks.concrete(edge)
    if width is not None and width > 0.25:
        _checks.refuse("edge", "be at most 0.25", width, "It is a share of the length: a wider edge leaves no floor.")
    return place(Partial(smooth_box, edge=jnp.asarray(edge, float)), -1 * depth, start, duration, length, speed)


@final
class Step(AbstractRoad):
    """A rounded step in time; created by `step`."""

    rise: Scalar
    start: Scalar
    ramp: Scalar
    smooth: bool = eqx.field(static=True)

    @compiled_for_loops
    def heights_at(self, time: SignalLike) -> Float[Array, "time 1"]:
        """The height [m] at each `time` [s]; see `step`."""
        time = jnp.asarray(time, self.rise.dtype)
        flank = quintic_step if self.smooth else raised_cosine
        return (self.rise * flank((time - self.start) / self.ramp))[:, None]


def step(
    height: ScalarLike | int,
    *,
    start: ScalarLike | int = 1.0,
    ramp: ScalarLike | int = 0.01,
    smooth: bool = False,
) -> Step:
    """A step of the ground with a rounded flank, z(t) = H/2 (1 - cos(pi (t - t0)/T)) for t0 <= t <= t0 + T, then H.

    Differentiable in every argument, which is why the ramp cannot be zero. It should be several time steps long: a ramp
    shorter than a step of the simulation acts as a jump. The vertical acceleration jumps by pi^2 H/(2 T^2) at both
    ends; with `smooth` the flank is a quintic polynomial instead and the acceleration is continuous.

    Arguments:
        height: H, the height of the ground behind the step [m]; negative for a drop.
        start: t0, the time [s] at which the ground begins to rise.
        ramp: T, the time [s] of the rise: its length along the road divided by the speed of the vehicle.
        smooth: continuous acceleration.

    Raises:
        ValueError: if `height` or `start` is not finite, or `ramp` is not positive.

    >>> import jax.numpy as jnp
    >>> kerb = step(0.05, start=1.0, ramp=0.02)
    >>> kerb.height(jnp.array([1.0, 1.01, 1.02, 9.0]))[:, 0].round(6)
    Array([0.   , 0.025, 0.05 , 0.05 ], dtype=float64)
    """
    _checks.finite("height", height)
    _checks.finite("start", start)
    _checks.positive("ramp", ramp, "A sudden jump has no derivative: give the rise a few milliseconds.")
    return Step(
        rise=jnp.asarray(height, float),
        start=jnp.asarray(start, float),
        ramp=jnp.asarray(ramp, float),
        smooth=smooth,
    )
