"""What every road is."""

import math
from abc import abstractmethod
from typing import Literal, NamedTuple

import equinox as eqx
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, SignalLike


class Columns(NamedTuple):
    """What the columns of `AbstractRoad.height` stand for: axle by axle, and within an axle track by track, left first.

    Attributes:
        kind: "road": tracks side by side, over which the axles of a vehicle go one after the other; "in phase": the
            same, but under all axles at once; "delayed": a set of tracks for each axle; "by wheel": a column for each
            wheel of the vehicle, as the platforms of a test rig have it.
        tracks: The number of tracks under an axle; of columns, where they are given by wheel.
        delays: How much later than the front of the vehicle each axle passes [s], where the kind is "delayed".
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


class AbstractRoad(eqx.Module):
    """The height of the ground under each wheel as a function of time.

    Concrete roads are made by the functions of `jaxdamp.roads`. They are pytrees: their array leaves (heights, speed,
    roughness) can be traced, batched and differentiated.

    The properties are those of a formula of time: one track, no speed, no samples, no beginning and no end. Roads made
    for a speed, of samples or of other roads say otherwise.
    """

    @abstractmethod
    def height(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The height [m], up positive, under each wheel at each `time` [s]; one column for a single track."""

    @property
    def wheels(self) -> int:
        """The number of columns of `height`."""
        return 1

    @property
    def speed(self) -> Scalar | None:
        """The speed of the vehicle [m/s] that the road was made for; `None` for a road given over time alone."""
        return None

    @property
    def columns(self) -> Columns:
        """What the columns of `height` stand for."""
        return Columns("road", self.wheels)

    @property
    def grid(self) -> float | None:
        """The spacing [s] of the samples the road is made of; `None` if it is a formula, or if its speed is traced."""
        return None

    @property
    def duration(self) -> float | None:
        """The time [s] after which the road ends or repeats; `None` if it does neither, or if its speed is traced."""
        return None

    @property
    def span(self) -> tuple[Scalar | float, Scalar | float]:
        """The first and the last time [s] at which the road has a height; infinite where it has no such end."""
        return -math.inf, math.inf
