"""A hole with steep, smooth edges."""

import jax.numpy as jnp
from jax.tree_util import Partial

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, Signal
from jaxdamp.roads.bump import Bump, place


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
