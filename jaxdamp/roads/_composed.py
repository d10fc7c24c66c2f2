"""What roads made of other roads inherit from them."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.roads.base import AbstractRoad, Columns


class AbstractOnOneRoad(AbstractRoad):
    """A road that shows another one differently: as many wheels, the same samples, beginning and end."""

    road: eqx.AbstractVar[AbstractRoad]

    @property
    def wheels(self) -> int:
        """That of the road."""
        return self.road.wheels

    @property
    def columns(self) -> Columns:
        """That of the road."""
        return self.road.columns

    @property
    def grid(self) -> float | None:
        """That of the road [s]."""
        return self.road.grid

    @property
    def duration(self) -> float | None:
        """That of the road [s]."""
        return self.road.duration

    @property
    def longest_run(self) -> float | None:
        """That of the road [s]."""
        return self.road.longest_run

    @property
    def shortest_event(self) -> float | None:
        """That of the road [s]."""
        return self.road.shortest_event

    @property
    def span(self) -> tuple[Scalar | float, Scalar | float]:
        """That of the road [s]."""
        return self.road.span

    def reseeded(self, seed: int) -> AbstractRoad | None:
        """The same view of the reseeded road."""
        other = self.road.reseeded(seed)
        return None if other is None else eqx.tree_at(lambda own: own.road, self, other)


class AbstractOnSeveralRoads(AbstractRoad):
    """A road that uses several others at the same time."""

    roads: eqx.AbstractVar[tuple[AbstractRoad, ...]]

    @property
    def speed(self) -> Scalar | None:
        """The speed [m/s] that the roads have in common."""
        return common_speed(self.roads)

    @property
    def grid(self) -> float | None:
        """The finest of the grids [s]."""
        return least([road.grid for road in self.roads])

    @property
    def duration(self) -> float | None:
        """The shortest of the durations [s]."""
        return least([road.duration for road in self.roads])

    @property
    def longest_run(self) -> float | None:
        """The shortest of those of the roads [s]."""
        return least([road.longest_run for road in self.roads])

    @property
    def shortest_event(self) -> float | None:
        """The shortest of those of the roads [s]."""
        return least([road.shortest_event for road in self.roads])

    @property
    def span(self) -> tuple[Scalar, Scalar]:
        """The times [s] between which all the roads have a height."""
        first, last = zip(*(road.span for road in self.roads), strict=True)
        begin = jnp.max(jnp.stack([jnp.asarray(time, float) for time in first]))
        return begin, jnp.min(jnp.stack([jnp.asarray(time, float) for time in last]))

    def reseeded(self, seed: int) -> AbstractRoad | None:
        """The same combination of the reseeded roads; tracks of one surface stay as coherent as they are."""
        others = [road.reseeded(seed) for road in self.roads]
        if all(other is None for other in others):
            return None
        chosen = tuple(road if other is None else other for road, other in zip(self.roads, others, strict=True))
        return eqx.tree_at(lambda own: own.roads, self, chosen)


def least(times: Sequence[float | None]) -> float | None:
    """The least of the times that are known [s]."""
    known = [time for time in times if time is not None]
    return min(known) if known else None


def common_speed(roads: Sequence[AbstractRoad]) -> Scalar | None:
    """The speed [m/s] of those roads that have one; `None` if none has, or if they were made for different speeds."""
    speeds = [road.speed for road in roads if road.speed is not None]
    known = [value for value in map(_checks.concrete, speeds) if value is not None]
    if not speeds or any(not np.allclose(value, known[0], rtol=1e-6, atol=0.0) for value in known):
        return None
    return speeds[0]


def agreed_speed(road: AbstractRoad, speed: ScalarLike | int | None, wanted_with: str) -> Scalar:
    """The speed given [m/s], or that of the road; they must agree where both are known."""
    own = road.speed
    if speed is None and own is None:
        _checks.refuse("speed", f"be given with `{wanted_with}`", speed, "Give the speed of the vehicle in m/s.")
    if speed is None:
        return jnp.asarray(own, float)
    _checks.positive("speed", speed, "Roads are driven forwards.")
    mine, its = _checks.concrete(speed), None if own is None else _checks.concrete(own)
    if mine is not None and its is not None and not np.allclose(mine, its, rtol=1e-6, atol=0.0):
        _checks.refuse("speed", f"be that of the road, {its} m/s", f"{mine} m/s", "Leave it out, or remake the road.")
    return jnp.asarray(speed, float)


def same_columns(argument: str, roads: Sequence[AbstractRoad]) -> None:
    """Refuse roads whose columns do not stand for the same wheels."""
    first, *others = (road.columns for road in roads)
    for other in others:
        if (other.kind, other.tracks, _axles(other)) != (first.kind, first.tracks, _axles(first)):
            remedy = "Put single tracks together first, and use `two_track`, `delayed` or `in_phase` on the result."
            _checks.refuse(argument, f"have columns alike: {_said(first)}", _said(other), remedy)


def _axles(columns: Columns) -> int:
    return 1 if columns.delays is None else columns.delays.size


def _said(columns: Columns) -> str:
    return f"{columns}, in phase" if columns.kind == "in phase" else str(columns)
