"""Sequences of roads."""

from typing import final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import at_least, at_most
from jaxdamp._traced import behind
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.roads._composed import common_speed, least, same_columns
from jaxdamp.roads.base import AbstractRoad, Columns


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
    def wheels(self) -> int:
        """That of both roads."""
        return self.first.wheels

    @property
    def columns(self) -> Columns:
        """That of both roads."""
        return self.first.columns

    @property
    def speed(self) -> Scalar | None:
        """The speed [m/s] that the roads have in common."""
        return common_speed((self.first, self.second))

    @property
    def grid(self) -> float | None:
        """The finer of the two grids [s]."""
        return least([self.first.grid, self.second.grid])

    @property
    def duration(self) -> float | None:
        """The time [s] at which the second road ends or repeats."""
        at, rest = _checks.concrete(self.at), self.second.duration
        return None if at is None or rest is None else float(at) + rest

    @property
    def longest_run(self) -> float | None:
        """Until the second road repeats, or the first one before it does [s]."""
        at, own, rest = behind(self.at), self.first.longest_run, self.second.longest_run
        if at is None:
            return None
        if own is not None and own < np.max(at) * (1.0 - 1e-9):
            return own
        return None if rest is None else float(np.min(at)) + rest

    @property
    def shortest_event(self) -> float | None:
        """The shorter of those of the two roads [s]."""
        return least([self.first.shortest_event, self.second.shortest_event])

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
        ValueError: if the roads have different numbers of tracks or tracks of different wheels, if `at` is negative or
            beyond the end of the first road, or if it is left out where the first road has no end.

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
    if at is None:
        at = first.duration
    if at is None:
        _checks.refuse("at", "be given where `first` has no end of its own", at, "Give the time in s.")
    _checks.nonnegative("at", at)
    time, end = _checks.concrete(at), _checks.concrete(first.span[1])
    if time is not None and end is not None and np.any(time > end * (1.0 + 1e-9)):
        _checks.refuse("at", f"lie within `first`, which ends at {float(end):.6g} s", f"{time} s", "Leave it out.")
    return Joined(first, second, jnp.asarray(at, float))
