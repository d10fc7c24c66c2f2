"""A kerb: a step of the ground."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.roads._fade import quintic_step, raised_cosine
from jaxdamp.roads.base import AbstractRoad


@final
class Step(AbstractRoad):
    """A rounded step in time; created by `step`."""

    rise: Scalar
    start: Scalar
    ramp: Scalar
    smooth: bool = eqx.field(static=True)

    @eqx.filter_jit
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
