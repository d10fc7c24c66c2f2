"""Tyre contact: the average over a contact patch, and the path of a rolling disc."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import at_least, at_most, largest, within
from jaxdamp._traced import behind
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.roads._composed import AbstractOnOneRoad, agreed_speed
from jaxdamp.roads.base import AbstractRoad


def heights_around(
    road: AbstractRoad, time: SignalLike, offset: Float[Array, " points"]
) -> Float[Array, "points time wheels"]:
    """The heights [m] at each `time` plus each `offset` [s]; a record is level before its first and after its last."""
    time = jnp.asarray(time, offset.dtype)
    first, last = road.span
    around = time[None, :] + offset[:, None]
    around = within(around, at_most(time, first)[None, :], at_least(time, last)[None, :])
    return road.height(around.reshape(-1)).reshape(offset.size, time.size, road.wheels)


@final
class ContactPatch(AbstractOnOneRoad):
    """A road averaged over the contact patch; created by `contact_patch`."""

    road: AbstractRoad
    passing_time: Scalar  # contact length over speed [s]
    driven_at: Scalar
    points: int = eqx.field(static=True)

    @property
    def shortest_event(self) -> float | None:
        """That of the road [s], longer by the time in which the patch passes."""
        shortest, passing = self.road.shortest_event, behind(self.passing_time)
        return None if shortest is None or passing is None else shortest + float(np.min(passing))

    @property
    def speed(self) -> Scalar:
        """The speed [m/s] that the road was created for."""
        return self.driven_at

    def heights_at(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The mean height [m] under each wheel at each `time` [s]; see `contact_patch`."""
        nodes, weights = (jnp.asarray(array, float) for array in np.polynomial.legendre.leggauss(self.points))
        around = heights_around(self.road, time, 0.5 * self.passing_time * nodes)
        return 0.5 * jnp.tensordot(weights, around, axes=1)


@final
class RollingDisc(AbstractOnOneRoad):
    """The path of the lowest point of a rigid disc; created by `rolling_disc`."""

    road: AbstractRoad
    radius: Scalar
    driven_at: Scalar
    points: int = eqx.field(static=True)

    @property
    def speed(self) -> Scalar:
        """The speed [m/s] that the road was created for."""
        return self.driven_at

    def heights_at(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The height [m] of each disc at each `time` [s]; see `rolling_disc`."""
        angle = jnp.linspace(-0.5 * jnp.pi, 0.5 * jnp.pi, self.points)
        around = heights_around(self.road, time, self.radius * jnp.sin(angle) / self.speed)
        rise = self.radius * (1.0 - jnp.cos(angle))
        return largest(around - rise[:, None, None])


def contact_patch(
    road: AbstractRoad, *, length: ScalarLike | int, speed: ScalarLike | int, points: int = 9
) -> ContactPatch:
    """A road averaged over the length L of the contact patch, z_p(x) = (1/L) int_{x-L/2}^{x+L/2} z dx.

    A wave of spatial frequency n is reduced by sinc(n L) = sin(pi n L)/(pi n L): by 4 % at 1 cycle/m and by 27 % at
    2.83 cycle/m for a patch of 0.15 m. Use it for short waves of random roads; for isolated obstacles, which a tyre
    touches with more than its patch, use `rolling_disc`. Differentiable in `length`, `speed` and the road.

    The mean is taken by Gauss-Legendre quadrature: with 9 points exact to 1e-6 while n L is below 2, and within
    0.3 % of the rise over the patch where a corner between two long straights lies under it. A flank much shorter than
    the patch, as of a kerb, passes the points one by one: the error is then up to pi/(4 `points`) of its rise, 8 % with
    9 points. The road is evaluated at `points` times as many positions.

    Arguments:
        road: any road, with one or several tracks.
        length: L [m], 0.1 to 0.2 m for cars; the tyre of a track or a tractor is longer.
        speed: V, the speed of the vehicle [m/s].
        points: the number of points of the quadrature.

    Raises:
        ValueError: if `length`, `speed` or `points` is not positive, or if the road was made for another speed.

    >>> import jax.numpy as jnp
    >>> from jaxdamp.roads import sine
    >>> waves = sine(0.01, wavelength=0.3, speed=3.0)
    >>> z = contact_patch(waves, length=0.15, speed=3.0).height(jnp.array([0.025]))
    >>> round(float(z[0, 0]), 6)  # 0.01 sinc(1/2) = 0.02/pi
    0.006366
    """
    _checks.positive("length", length)
    speed = agreed_speed(road, speed, "length")
    _checks.positive("points", points)
    return ContactPatch(road, jnp.asarray(length, float) / speed, speed, int(points))


def rolling_disc(
    road: AbstractRoad, *, radius: ScalarLike | int, speed: ScalarLike | int, points: int = 181
) -> RollingDisc:
    """The path of a rigid disc of radius R that rolls over the road without penetrating it.

    z_d(x) = max over |a| <= R of z(x + a) - (R - sqrt(R^2 - a^2)): the height of the lowest point of the disc. It
    climbs a kerb of height h along an arc that begins sqrt(2 R h - h^2) before it, and does not reach the floor of a
    hole shorter than its chord. This is the geometric envelope; a tyre under load is softer than that, so average
    over its patch as well: contact_patch(rolling_disc(road, ...), ...). Differentiable almost everywhere in the
    radius, the speed and the road (the point that touches changes by jumps).

    The disc is represented by `points` points at equal angles: the contact with a sharp edge begins and ends within
    R pi/(points - 1) of the exact position (5 mm for 0.3 m and the default). The road is evaluated at `points` times as
    many positions: convert long random roads to a record first, `from_profile(time, road.height(time))`.

    Arguments:
        road: any road, with one or several tracks.
        radius: R, the unloaded radius of the tyre [m].
        speed: V, the speed of the vehicle [m/s].
        points: the number of points on the lower half of the disc, odd so that its lowest one is among them.

    Raises:
        ValueError: if `radius` or `speed` is not positive, if the road was made for another speed, or if `points` is
            not odd or below 3.

    >>> import jax.numpy as jnp
    >>> from jaxdamp.roads import step
    >>> disc = rolling_disc(step(0.05, start=1.0, ramp=1e-4), radius=0.3, speed=10.0)
    >>> before = (2 * 0.3 * 0.05 - 0.05**2) ** 0.5  # the disc touches the kerb this far [m] before it
    >>> z = disc.height(1.0 + jnp.array([-before - 0.01, -0.5 * before, 0.0]) / 10.0)
    >>> z[:, 0].round(2)  # exactly 0, 0.0383, 0.05
    Array([0.  , 0.04, 0.05], dtype=float64)
    """
    _checks.positive("radius", radius)
    speed = agreed_speed(road, speed, "radius")
    if points < 3 or points % 2 == 0:
        _checks.refuse("points", "be odd and at least 3", points, "Its middle point is the lowest one of the disc.")
    return RollingDisc(road, jnp.asarray(radius, float), speed, points)
