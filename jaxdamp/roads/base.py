"""What every road is."""

from abc import abstractmethod

import equinox as eqx
from jaxtyping import Array, Float

from jaxdamp._types import SignalLike


class AbstractRoad(eqx.Module):
    """The height of the ground under each wheel as a function of time.

    Concrete roads are made by the functions of `jaxdamp.roads`. They are pytrees: their array leaves (heights, speed,
    roughness) can be traced, batched and differentiated.
    """

    @abstractmethod
    def height(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The height [m], up positive, under each wheel at each `time` [s]; one column for a single track."""

    @property
    @abstractmethod
    def grid(self) -> float | None:
        """The spacing [s] of the samples the road is made of; `None` if it is a formula, or if its speed is traced."""

    @property
    @abstractmethod
    def duration(self) -> float | None:
        """The time [s] after which the road ends or repeats; `None` if it does neither, or if its speed is traced."""
