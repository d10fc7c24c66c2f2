"""Several axles on the same road."""

from collections.abc import Sequence
from typing import final

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._limits import at_least, at_most
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike, VectorLike
from jaxdamp.roads._composed import AbstractOnOneRoad, agreed_speed
from jaxdamp.roads.base import AbstractRoad, Columns


@final
class Delayed(AbstractOnOneRoad):
    """The same road under several axles with delays; created by `delayed`."""

    road: AbstractRoad
    delay: Float[Array, " axles"]
    driven_at: Scalar | None

    @property
    def speed(self) -> Scalar | None:
        """The speed [m/s] that the road was created for."""
        return self.driven_at

    def heights_at(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The height [m] under each wheel at each `time` [s]: all wheels of the first axle, then of the second, ..."""
        heights = self.road.height(self._passed(jnp.asarray(time, self.delay.dtype)))
        return _by_axle(heights, self.delay.size)

    @compiled_for_loops
    def _passed(self, time: Signal) -> Float[Array, " times"]:
        """The times at which the road reaches each axle, one axle after the other."""
        # a record is level before its first sample; the road itself refuses given times before it
        begin = at_most(time, self.road.span[0])
        return at_least(time[None, :] - self.delay[:, None], begin[None, :]).reshape(-1)

    @property
    def wheels(self) -> int:
        """The number of axles times the number of tracks."""
        return self.delay.size * self.road.wheels

    @property
    def columns(self) -> Columns:
        """The tracks of the road for each axle."""
        within = self.road.columns
        delays = self.delay if within.delays is None else (self.delay[:, None] + within.delays[None, :]).reshape(-1)
        return Columns("delayed", within.tracks, delays)


@jax.jit(static_argnames="axles")
def _by_axle(heights: Float[Array, "times tracks"], axles: int) -> Float[Array, "time wheels"]:
    """A row for each time with the tracks of all axles, from rows for the times of one axle after the other."""
    parts = heights.reshape(axles, -1, heights.shape[1])
    return jnp.moveaxis(parts, 0, 1).reshape(parts.shape[1], -1)


@final
class InPhase(AbstractOnOneRoad):
    """A road that reaches all axles at the same time; created by `in_phase`."""

    road: AbstractRoad

    def heights_at(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The height [m] of each track at each `time` [s]."""
        return self.road.height(time)

    @property
    def columns(self) -> Columns:
        """The tracks of the road, under all axles at once."""
        return Columns("in phase", self.road.wheels)


def in_phase(road: AbstractRoad) -> InPhase:
    """The road under all axles at the same time, as platforms move a vehicle on a test rig.

    The axles of a vehicle meet a road one after the other. For excitation in phase, and for roads over time without a
    speed, which cannot be delayed, use this function:

    >>> import jax.numpy as jnp
    >>> from jaxdamp.roads import sine
    >>> platforms = in_phase(sine(0.01, frequency=2.0))
    >>> platforms.height(jnp.array([0.0, 0.125]))[:, 0].round(6)
    Array([0.  , 0.01], dtype=float64)

    Arguments:
        road: any road with one track or several side by side.

    Raises:
        ValueError: the road is delayed from axle to axle.
    """
    check_module("road", road, (AbstractRoad,), "in_phase(road)")
    if road.columns.kind == "delayed":
        _checks.refuse("road", "not be delayed from axle to axle", road.columns, "Leave out `delayed`.")
    return InPhase(road)


def delayed(
    road: AbstractRoad,
    *,
    delays: VectorLike | Sequence[ScalarLike] | None = None,
    positions: VectorLike | Sequence[ScalarLike] | None = None,
    speed: ScalarLike | int | None = None,
) -> Delayed:
    """The road under several axles, z_i(t) = z(t - tau_i) with tau_i = l_i/V.

    The columns are axle by axle, and for each axle in the order of the tracks of the road: for a car on a road of
    `two_track` front-left, front-right, rear-left, rear-right.

    At time 0 an axle at l behind the front axle is on the road at l before the start point, where the vehicle is in
    static equilibrium. There, roads given by a formula continue (the ground before a bump is level; random roads and
    sines continue without a jump); a road that fades in (`ramp`) is level at height zero; a periodic road repeats; a
    record that is not periodic is level at the height of its first sample.

    Differentiable in `delays`, `positions` and `speed`.

    Arguments:
        road: any road, with one or several tracks.
        delays: the time [s] by which each axle passes later than the front of the vehicle; 0 for the front axle.
        positions: the distance [m] of each axle behind the front axle, instead of `delays`: 0 for the front axle.
        speed: V, the speed of the vehicle [m/s], with `positions`; that of the road if it has one and this is left out.

    Raises:
        ValueError: if not exactly one of `delays` and `positions` is given, if one is negative or there is none, if
            `speed` is missing, not positive, given with `delays`, or not the one the road was made with, or if the
            road is one of `in_phase`.

    >>> import jax.numpy as jnp
    >>> from jaxdamp.roads import cosine_bump
    >>> bump = cosine_bump(0.06, start=1.0, length=2.0, speed=10.0)
    >>> road = delayed(bump, positions=[0.0, 2.5], speed=10.0)
    >>> road.height(jnp.array([1.0, 1.1, 1.35])).round(6)
    Array([[0.  , 0.  ],
           [0.06, 0.  ],
           [0.  , 0.06]], dtype=float64)
    """
    check_module("road", road, (AbstractRoad,), "delayed(road, positions=vehicle.axle_positions, speed=20.0)")
    if road.columns.kind == "in phase":
        _checks.refuse("road", "not be in phase under all axles", "made by `in_phase`", "Use one of the two.")
    if (delays is None) == (positions is None):
        both = "neither was given" if delays is None else f"{delays} s, and positions {positions} m as well"
        _checks.refuse("delays", "be given, or `positions` with `speed`, but not both", both, "Give exactly one.")
    name = "delays" if positions is None else "positions"
    given = delays if positions is None else positions
    values = jnp.asarray(given, float)
    if values.ndim != 1 or values.size == 0:
        _checks.refuse(name, "hold one number for each axle", f"of shape {values.shape}", "For example [0.0, 2.7].")
    _checks.nonnegative(name, values, "They count backwards from the foremost axle: start with 0.")
    if positions is None:
        if speed is not None:
            _checks.refuse("speed", "be left out when `delays` is given", speed, "Give `positions` and `speed`.")
        return Delayed(road, values, road.speed)
    driven = agreed_speed(road, speed, "positions")
    return Delayed(road, values / driven, driven)
