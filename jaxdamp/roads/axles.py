"""Axles behind each other on the same road."""

from collections.abc import Sequence
from typing import final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._limits import at_least, at_most
from jaxdamp._types import Scalar, ScalarLike, SignalLike, VectorLike
from jaxdamp.roads._composed import AbstractOnOneRoad
from jaxdamp.roads.base import AbstractRoad


@final
class Delayed(AbstractOnOneRoad):
    """The same road under several axles, later under each; made by `delayed`."""

    road: AbstractRoad
    delay: Float[Array, " axles"]

    def height(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The height [m] under each wheel at each `time` [s]: all wheels of the first axle, then of the second, ..."""
        time = jnp.asarray(time, self.delay.dtype)
        # a record is level before its first sample; times before it that were asked for are left for it to refuse
        begin = at_most(time, self.road.span[0])
        passed = at_least(time[None, :] - self.delay[:, None], begin[None, :])
        heights = self.road.height(passed.reshape(-1)).reshape(self.delay.size, time.size, self.road.wheels)
        return jnp.moveaxis(heights, 0, 1).reshape(time.size, self.wheels)

    @property
    def wheels(self) -> int:
        """The number of axles times the number of tracks."""
        return self.delay.size * self.road.wheels


def delayed(
    road: AbstractRoad,
    *,
    delays: VectorLike | Sequence[ScalarLike] | None = None,
    positions: VectorLike | Sequence[ScalarLike] | None = None,
    speed: ScalarLike | int | None = None,
) -> Delayed:
    """The road under several axles, z_i(t) = z(t - tau_i) with tau_i = l_i/V.

    The wheels come axle by axle, and within an axle in the order of the road's own tracks: on a road of `two_track`
    the order of a car is front-left, front-right, rear-left, rear-right.

    At time 0 an axle l behind the front one stands on the piece of road l before the start: simulations settle the
    vehicle there before they begin. What that piece is depends on the road. Formulas go on (a bump is level ground
    before it begins; random roads and sines run on without a jump); a road that fades in (`ramp`) is level at height
    zero; a periodic road repeats; a record that does not repeat is level at the height of its first sample.

    Differentiable in `delays`, `positions` and `speed`.

    >>> import jax.numpy as jnp
    >>> from jaxdamp.roads import cosine_bump
    >>> bump = cosine_bump(0.06, start=1.0, length=2.0, speed=10.0)
    >>> road = delayed(bump, positions=[0.0, 2.5], speed=10.0)
    >>> road.height(jnp.array([1.0, 1.1, 1.35])).round(6)
    Array([[0.  , 0.  ],
           [0.06, 0.  ],
           [0.  , 0.06]], dtype=float64)

    Args:
        road: Any road, with one or several tracks.
        delays: The time [s] by which each axle passes later than the front of the vehicle; 0 for the front axle.
        positions: The distance [m] of each axle behind the front axle, instead of `delays`: 0 for the front axle.
        speed: V, the speed of the vehicle [m/s], with `positions`; that of the road if it has one and this is left out.

    Raises:
        ValueError: If not exactly one of `delays` and `positions` is given, if one is negative or there is none, if
            `speed` is missing, not positive, given with `delays`, or not the one the road was made with.
    """
    check_module("road", road, (AbstractRoad,), "delayed(road, positions=vehicle.axle_positions, speed=20.0)")
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
        return Delayed(road, values)
    return Delayed(road, values / _speed(road, speed))


def _speed(road: AbstractRoad, speed: ScalarLike | int | None) -> Scalar:
    """The speed given, or that of the road; they must agree where both are known."""
    own = getattr(road, "speed", None)
    if speed is None and own is None:
        _checks.refuse("speed", "be given with `positions`", speed, "Give the speed of the vehicle in m/s.")
    if speed is None:
        return jnp.asarray(own, float)
    _checks.positive("speed", speed, "Roads are driven forwards.")
    mine, its = _checks.concrete(speed), None if own is None else _checks.concrete(own)
    if mine is not None and its is not None and not np.allclose(mine, its, rtol=1e-6, atol=0.0):
        _checks.refuse("speed", f"be that of the road, {its} m/s", f"{mine} m/s", "Leave it out, or remake the road.")
    return jnp.asarray(speed, float)
