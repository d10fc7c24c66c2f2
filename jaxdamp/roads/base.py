"""What every road is."""

import math
from abc import abstractmethod

import equinox as eqx
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, SignalLike


class AbstractRoad(eqx.Module):
    """The height of the ground under each wheel as a function of time.

    Concrete roads are made by the functions of `jaxdamp.roads`. They are pytrees: their array leaves (heights, speed,
    roughness) can be traced, batched and differentiated.

    The properties are those of a formula: one track, no samples, no beginning and no end. Roads made of samples or of
    other roads say otherwise.
    """

    @abstractmethod
    def height(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The height [m], up positive, under each wheel at each `time` [s]; one column for a single track."""

    @property
    def wheels(self) -> int:
        """The number of columns of `height`."""
        return 1

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
