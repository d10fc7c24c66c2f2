"""The base class of all roads, and what events on them share."""

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.tree_util import Partial
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._forked import refuse_fork
from jaxdamp._limits import within
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike


def raised_cosine(fraction: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """S(s) = (1 - cos(pi s))/2 for 0 <= s <= 1, 0 before and 1 after; continuous with its slope."""
    return 0.5 * (1.0 - jnp.cos(jnp.pi * within(fraction, 0.0, 1.0)))


def quintic_step(fraction: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """S(s) = s^3 (10 - 15 s + 6 s^2) for 0 <= s <= 1, 0 before and 1 after; continuous with slope and curvature.

    Its steepest slope is 15/8 and its largest curvature 10/sqrt(3), against pi/2 and pi^2/2 of the raised cosine.
    """
    s = within(fraction, 0.0, 1.0)
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def fade_in(time: Signal, ramp: float) -> Signal | Scalar:
    """The factor that lets a road begin at height and slope zero: S(t/ramp), or 1 throughout if `ramp` [s] is zero."""
    return raised_cosine(time / ramp) if ramp else jnp.ones((), time.dtype)


def given_in_time(
    name: str,
    value: ScalarLike | int | None,
    unit: str,
    distance_name: str,
    distance: ScalarLike | int | None,
    speed: ScalarLike | int | None,
) -> bool:
    """Whether `value`, a time or a frequency, was given (and not the distance with the speed); refuses anything else.

    Raises:
        ValueError: If not exactly one of `value` and `distance` is given, if `speed` is missing with the distance or
            given with the value, or if one of the three is not positive.
    """
    if (value is None) == (distance is None):
        both = "neither was given" if value is None else f"{value} {unit}, and {distance_name} {distance} m as well"
        _checks.refuse(
            name, f"be given, or `{distance_name}` with `speed`, but not both", both, "Give exactly one of them."
        )
    if value is not None:
        if speed is not None:
            _checks.refuse(
                "speed", f"be left out when `{name}` is given", speed, f"Give `{distance_name}` and `speed` instead."
            )
        _checks.positive(name, value)
        return True
    if speed is None:
        _checks.refuse("speed", f"be given with `{distance_name}`", speed, "Give the speed of the vehicle in m/s.")
    _checks.positive(distance_name, distance)
    check_speed(speed)
    return False


def check_speed(speed: ScalarLike | int, remedy: str = "Roads are driven forwards.") -> None:
    """Refuse a speed that is not one positive number."""
    if np.shape(speed):
        _checks.refuse("speed", "be one number", f"of shape {np.shape(speed)}", "Use `jax.vmap` for many.")
    _checks.positive("speed", speed, remedy)


class Columns(NamedTuple):
    """The meaning of the columns of `AbstractRoad.height`: axle by axle, and for each axle the left track first.

    Attributes:
        kind: "road": parallel tracks, which the axles of a vehicle meet one after the other; "in phase": the same, but
            under all axles at the same time; "delayed": a set of tracks for each axle; "by wheel": a column for each
            wheel of the vehicle, as for the platforms of a test rig.
        tracks: number of tracks under an axle; for "by wheel" the number of columns.
        delays: delay of each axle behind the front of the vehicle [s], for "delayed".
    """

    kind: Literal["road", "in phase", "delayed", "by wheel"]
    tracks: int
    delays: Float[Array, " axles"] | None = None

    def __str__(self) -> str:
        if self.kind == "by wheel":
            return f"{self.tracks} columns over time without a speed, one for each wheel"
        tracks = {1: "one track", 2: "two tracks side by side (left, right)"}
        side_by_side = tracks.get(self.tracks, f"{self.tracks} tracks side by side")
        return side_by_side if self.delays is None else f"{side_by_side} for each of {self.delays.size} axles"


if TYPE_CHECKING:
    from typing import TypeVar

    _Method = TypeVar("_Method", bound=Callable[..., object])

    def _for_jit(method: _Method) -> _Method: ...
else:

    class _for_jit:
        """A method that can be passed on as a function: to `jax.jit`, which refuses the methods of equinox."""

        def __init__(self, method: Callable[..., object]) -> None:
            self.method = method

        def __get__(self, road: object, owner: type | None = None) -> Callable[..., object]:
            return self.method if road is None else Partial(self.method, road)


class AbstractRoad(eqx.Module):
    """The height of the ground under each wheel as a function of time.

    Roads are created by the functions of `jaxdamp.roads`. They are pytrees: their array leaves (heights, speed,
    roughness) can be traced, batched and differentiated. A road of your own defines `heights_at`; call `height`.

    The default properties are those of a formula of time: one track, no speed, no samples, no start and no end; of a
    road that is made of others, what these have in common. Other roads override them.
    """

    @_for_jit
    def height(self, time: Float[ArrayLike, "*times"]) -> Float[Array, "*times wheels"]:
        """The height [m], up positive, under each wheel at each `time` [s]; one column for a single track.

        Of a single time it is one height for each wheel, for a vector field of your own. `jax.jit(road.height)` and
        the like work.
        """
        refuse_fork()
        times = jnp.asarray(time, float)
        if times.ndim == 1:
            return self.heights_at(times)
        return self.heights_at(times.reshape(-1)).reshape(*times.shape, self.wheels)

    @abstractmethod
    def heights_at(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The same for times in a row: what the kinds of roads define."""

    @property
    def _parts(self) -> tuple["AbstractRoad", ...]:
        """The roads that it is made of."""
        return ()

    @property
    def wheels(self) -> int:
        """The number of columns of `height`."""
        return self._parts[0].wheels if self._parts else 1

    @property
    def speed(self) -> Scalar | None:
        """The speed of the vehicle [m/s] that the road was created for; `None` for a road given over time only.

        `None` also of a road that is made of roads for different speeds.
        """
        speeds = [road.speed for road in self._parts if road.speed is not None]
        numbers = [value for value in map(_checks.concrete, speeds) if value is not None]
        if not speeds or any(not np.allclose(value, numbers[0], rtol=1e-6, atol=0.0) for value in numbers):
            return None
        return speeds[0]

    @property
    def columns(self) -> Columns:
        """The meaning of the columns of `height`."""
        return self._parts[0].columns if self._parts else Columns("road", self.wheels)

    @property
    def grid(self) -> float | None:
        """The spacing [s] of the samples the road is made of; `None` if it is a formula, or if its speed is traced."""
        return _least(road.grid for road in self._parts)

    @property
    def duration(self) -> float | None:
        """The time [s] after which the road ends or repeats; `None` if it does neither, or if its speed is traced.

        A road that is made of others lasts until the first of them ends, however often a periodic one repeats before.
        """
        ending = [road for road in self._parts if np.any(_checks.concrete(road.span[1]) != math.inf)]
        longest = [self.longest_run] if ending else []
        return _least([*(road.duration for road in ending or self._parts), *longest])

    @property
    def span(self) -> tuple[Scalar | float, Scalar | float]:
        """The first and the last time [s] at which the road has a height; infinite where it has no such end."""
        spans = [road.span for road in self._parts]
        if len(spans) < 2:
            return spans[0] if spans else (-math.inf, math.inf)
        first, last = (jnp.stack([jnp.asarray(time, float) for time in ends]) for ends in zip(*spans, strict=True))
        return jnp.max(first), jnp.min(last)

    @property
    def longest_run(self) -> float | None:
        """The longest run [s] in which a random road does not repeat; `None` if there is no such limit."""
        return _least(road.longest_run for road in self._parts)

    @property
    def shortest_event(self) -> float | None:
        """The time [s] that a wheel takes over the shortest bump or hole, which steps must not skip; `None` if none."""
        return _least(road.shortest_event for road in self._parts)

    def reseeded(self, seed: int) -> "AbstractRoad | None":
        """The same kind of road with other random numbers; `None` if nothing in it is random or can be drawn again.

        Tracks of one surface stay as coherent as they are.
        """
        others = [road.reseeded(seed) for road in self._parts]
        if all(other is None for other in others):
            return None
        chosen = tuple(road if other is None else other for road, other in zip(self._parts, others, strict=True))
        return eqx.tree_at(lambda own: own._parts, self, chosen)


def _least(times: Iterable[float | None]) -> float | None:
    """The least of the times that are known [s]."""
    return min((time for time in times if time is not None), default=None)
