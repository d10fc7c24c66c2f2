"""Roads made of other roads: what all inherit, several at once, one after the other."""

from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import at_least, at_most
from jaxdamp._traced import behind
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.roads.base import AbstractRoad, Columns, check_speed


class AbstractOnOneRoad(AbstractRoad):
    """A road that shows another one differently: as many wheels, the same samples, beginning and end."""

    road: eqx.AbstractVar[AbstractRoad]

    @property
    def _parts(self) -> tuple[AbstractRoad, ...]:
        return (self.road,)


class AbstractOnSeveralRoads(AbstractRoad):
    """A road that uses several others at the same time."""

    roads: eqx.AbstractVar[tuple[AbstractRoad, ...]]

    @property
    def _parts(self) -> tuple[AbstractRoad, ...]:
        return self.roads


def agreed_speed(road: AbstractRoad, speed: ScalarLike | int | None, wanted_with: str) -> Scalar:
    """The speed given [m/s], or that of the road; they must agree where both are known."""
    own = road.speed
    if speed is None and own is None:
        _checks.refuse("speed", f"be given with `{wanted_with}`", speed, "Give the speed of the vehicle in m/s.")
    if speed is None:
        return jnp.asarray(own, float)
    check_speed(speed)
    mine, its = _checks.concrete(speed), None if own is None else _checks.concrete(own)
    if mine is not None and its is not None and not np.allclose(mine, its, rtol=1e-6, atol=0.0):
        _checks.refuse("speed", f"be that of the road, {its} m/s", f"{mine} m/s", "Leave it out, or remake the road.")
    return jnp.asarray(speed, float)


def same_columns(argument: str, roads: Sequence[AbstractRoad]) -> None:
    """Refuse roads whose columns do not stand for the same wheels."""
    first, *others = (road.columns for road in roads)
    for other in others:
        if not _alike(first, other):
            remedy = "Put single tracks together first, and use `two_track`, `delayed` or `in_phase` on the result."
            _checks.refuse(argument, f"have columns alike: {_said(first)}", _said(other), remedy)


def _alike(one: Columns, other: Columns) -> bool:
    """Whether columns stand for the same wheels, their axles equally far apart as far as these are known."""
    if one[:2] != other[:2] or one.delays is None or other.delays is None:
        return one[:2] == other[:2]
    apart = [
        np.diff(concrete) for delays in (one.delays, other.delays) if (concrete := _checks.concrete(delays)) is not None
    ]
    return one.delays.size == other.delays.size and all(np.allclose(a, apart[0], atol=1e-5) for a in apart)


def _said(columns: Columns) -> str:
    if columns.kind == "in phase":
        return f"{columns}, in phase"
    delays = None if columns.delays is None else _checks.concrete(columns.delays)
    return str(columns) if delays is None else f"{columns}, {', '.join(f'{delay:.4g}' for delay in delays)} s late"


@final
class Superposed(AbstractOnSeveralRoads):
    """The sum of several roads; created by `superposed`."""

    roads: tuple[AbstractRoad, ...]

    def heights_at(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The sum of the heights [m] at each `time` [s]."""
        total = self.roads[0].height(time)
        for road in self.roads[1:]:
            total = total + road.height(time)
        return total


def superposed(*roads: AbstractRoad) -> Superposed:
    """The sum of roads: a bump on a rough surface, a measured profile on a long swell.

    Arguments:
        roads: at least one road, all with the same number of tracks.

    Raises:
        ValueError: if there is no road, or if their tracks differ in number, stand for different wheels, or reach the
            axles after other delays.

    >>> import jax.numpy as jnp
    >>> from jaxdamp.roads import cosine_bump, sine
    >>> road = superposed(sine(0.01, frequency=1.0), cosine_bump(0.1, start=1.0, duration=0.5))
    >>> road.height(jnp.array([0.25, 1.25]))[:, 0].round(6)
    Array([0.01, 0.11], dtype=float64)
    """
    if not roads:
        _checks.refuse("roads", "hold at least one road", "empty")
    counts = [road.wheels for road in roads]
    if len(set(counts)) > 1:
        _checks.refuse("roads", "have equal numbers of tracks", counts, "Use `two_track` on the ones with one track.")
    same_columns("roads", roads)
    return Superposed(roads)


@final
class Joined(AbstractRoad):
    """A road followed by another one; created by `joined`."""

    first: AbstractRoad
    second: AbstractRoad
    at: Scalar

    def heights_at(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The height [m] at each `time` [s]; see `joined`."""
        time = jnp.asarray(time, self.at.dtype)
        before = self.first.height(at_most(time, self.at))
        after = self.second.height(at_least(time - self.at, 0.0))
        return before + after - self.second.height(jnp.zeros(1, time.dtype))

    @property
    def _parts(self) -> tuple[AbstractRoad, ...]:
        return self.first, self.second

    @property
    def duration(self) -> float | None:
        """The time [s] at which the second road ends or repeats."""
        at, second = _checks.concrete(self.at), self.second.duration
        return None if at is None or second is None else float(at) + second

    @property
    def longest_run(self) -> float | None:
        """Until the second road repeats, or the first one before it does [s]."""
        at, first, second = behind(self.at), self.first.longest_run, self.second.longest_run
        if at is None:
            return None
        if first is not None and first < np.max(at) * (1.0 - 1e-9):
            return first
        return None if second is None else float(np.min(at)) + second

    @property
    def span(self) -> tuple[Scalar | float, Scalar | float]:
        """From the beginning of the first road to the end of the second [s]."""
        return self.first.span[0], self.at + self.second.span[1]


def joined(first: AbstractRoad, second: AbstractRoad, *, at: ScalarLike | int | None = None) -> Joined:
    """The road `first` up to the time t1, then `second` from its own time 0, without a step between them.

    z(t) = z1(t) up to t1, then z1(t1) + z2(t - t1) - z2(0): the second road is raised to where the first one stopped.
    Its `ramp`, if it has one, fades it in there. Several roads join in turn: joined(joined(a, b), c). Differentiable
    in `at` and in whatever the two roads are differentiable in.

    Arguments:
        first: a road.
        second: a road with as many tracks.
        at: t1 [s]; by default the time at which the first road ends or repeats.

    Raises:
        ValueError: if the roads are delayed, have different numbers of tracks or tracks of different wheels, if `at` is
            negative or beyond the end of the first road, or if it is left out where the first road has no end.

    >>> import jax.numpy as jnp
    >>> from jaxdamp.roads import from_profile, step
    >>> kerb, field = step(0.1, start=0.5), from_profile(jnp.arange(3.0), jnp.array([1.0, 1.2, 1.0]))
    >>> road = joined(kerb, field, at=2.0)
    >>> road.height(jnp.array([0.0, 1.0, 2.0, 3.0, 4.0]))[:, 0].round(6)
    Array([0. , 0.1, 0.1, 0.3, 0.1], dtype=float64)
    >>> road.duration
    4.0
    """
    if first.wheels != second.wheels:
        remedy = "Join single tracks first and use `two_track` and `delayed` on the result."
        _checks.refuse("second", f"have {first.wheels} tracks, as `first` has", second.wheels, remedy)
    same_columns("second", (first, second))
    if first.columns.kind == "delayed":
        remedy = "Put single tracks together first, and use `delayed` on the result."
        _checks.refuse("first", "not be delayed: its axles would reach `second` at one instant", first.columns, remedy)
    if at is None:
        at = first.duration
    if at is None:
        _checks.refuse("at", "be given where `first` has no end of its own", at, "Give the time in s.")
    _checks.nonnegative("at", at)
    time, end = _checks.concrete(at), _checks.concrete(first.span[1])
    if time is not None and end is not None and np.any(time > end * (1.0 + 1e-9)):
        _checks.refuse("at", f"lie within `first`, which ends at {float(end):.6g} s", f"{time} s", "Leave it out.")
    return Joined(first, second, jnp.asarray(at, float))
