"""What roads made of other roads inherit from them."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp

from jaxdamp._types import Scalar
from jaxdamp.roads.base import AbstractRoad


class AbstractOnOneRoad(AbstractRoad):
    """A road that shows another one differently: as many wheels, the same samples, beginning and end."""

    road: eqx.AbstractVar[AbstractRoad]

    @property
    def wheels(self) -> int:
        """That of the road."""
        return self.road.wheels

    @property
    def grid(self) -> float | None:
        """That of the road [s]."""
        return self.road.grid

    @property
    def duration(self) -> float | None:
        """That of the road [s]."""
        return self.road.duration

    @property
    def span(self) -> tuple[Scalar | float, Scalar | float]:
        """That of the road [s]."""
        return self.road.span


class AbstractOnSeveralRoads(AbstractRoad):
    """A road that uses several others at the same time."""

    roads: eqx.AbstractVar[tuple[AbstractRoad, ...]]

    @property
    def grid(self) -> float | None:
        """The finest of the grids [s]."""
        return least([road.grid for road in self.roads])

    @property
    def duration(self) -> float | None:
        """The shortest of the durations [s]."""
        return least([road.duration for road in self.roads])

    @property
    def span(self) -> tuple[Scalar, Scalar]:
        """The times [s] between which all the roads have a height."""
        first, last = zip(*(road.span for road in self.roads), strict=True)
        begin = jnp.max(jnp.stack([jnp.asarray(time, float) for time in first]))
        return begin, jnp.min(jnp.stack([jnp.asarray(time, float) for time in last]))


def least(times: Sequence[float | None]) -> float | None:
    """The least of the times that are known [s]."""
    known = [time for time in times if time is not None]
    return min(known) if known else None
