"""Sums of roads."""

from typing import final

from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import SignalLike
from jaxdamp.roads._composed import AbstractOnSeveralRoads, same_columns
from jaxdamp.roads.base import AbstractRoad, Columns


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

    @property
    def wheels(self) -> int:
        """That of all the roads."""
        return self.roads[0].wheels

    @property
    def columns(self) -> Columns:
        """That of all the roads."""
        return self.roads[0].columns


def superposed(*roads: AbstractRoad) -> Superposed:
    """The sum of roads: a bump on a rough surface, a measured profile on a long swell.

    Arguments:
        roads: at least one road, all with the same number of tracks.

    Raises:
        ValueError: if there is no road, or if their numbers of tracks differ or stand for different wheels.

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
