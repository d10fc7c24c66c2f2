"""Roads made of uniformly spaced samples."""

import abc
import math
from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._types import Scalar, Signal, SignalLike
from jaxdamp.roads.base import AbstractRoad, Columns, fade_in


def _tolerance(samples: Float[Array, "samples wheels"]) -> float:
    """How far outside the record a time may lie before it is refused, in samples: rounding must not count."""
    return 1e-3 + 4.0 * float(jnp.finfo(samples.dtype).eps) * samples.shape[0]


def interpolate(
    samples: Float[Array, "samples wheels"], index: Signal, *, periodic: bool
) -> Float[Array, "time wheels"]:
    """Straight lines between uniform samples at a fractional `index`; NaN beyond the record unless `periodic`."""
    size = samples.shape[0]
    if periodic:
        index = index - size * jnp.floor(index / size)
        inside = None
        left = jnp.clip(jnp.floor(index).astype(int), 0, size - 1)
    else:
        tolerance = _tolerance(samples)
        inside = (index >= -tolerance) & (index <= size - 1 + tolerance)
        left = jnp.clip(jnp.floor(index).astype(int), 0, size - 2)
    fraction = (index - left.astype(index.dtype))[:, None]
    height = (1.0 - fraction) * samples[left] + fraction * samples[(left + 1) % size]
    return height if inside is None else jnp.where(inside[:, None], height, jnp.nan)


class AbstractProcess(eqx.Module):
    """What draws the samples of a random road again."""

    @abc.abstractmethod
    def redraw(self, samples: Float[Array, " samples"], seed: int) -> Float[Array, " samples"]:
        """Other heights [m], alike for equal `samples`, independent for independent ones."""


@final
class SampledRoad(AbstractRoad):
    """Samples at equal spacing in time, or in distance when there is a `speed`."""

    samples: Float[Array, "samples wheels"]
    driven_at: Scalar | None
    spacing: float = eqx.field(static=True)  # [s], or [m] with a speed
    periodic: bool = eqx.field(static=True)
    ramp: float = eqx.field(static=True)
    process: AbstractProcess | None = None  # of a random road that can be drawn again

    def heights_at(self, time: SignalLike) -> Float[Array, "time wheels"]:
        """The height [m] at each `time` [s], by linear interpolation between the samples.

        Times outside the record of a road that is not periodic raise a `ValueError`, or give NaN where they are
        traced.
        """
        self._refuse_outside(time)
        return self._interpolated(jnp.asarray(time, self.samples.dtype))

    @compiled_for_loops
    def _interpolated(self, time: Signal) -> Float[Array, "time wheels"]:
        rate = 1.0 / self.spacing if self.speed is None else self.speed / self.spacing
        height = interpolate(self.samples, time * rate, periodic=self.periodic)
        return height * jnp.reshape(fade_in(time, self.ramp), (-1, 1))

    @property
    def speed(self) -> Scalar | None:
        """The speed [m/s] that the road was created for."""
        return self.driven_at

    @property
    def wheels(self) -> int:
        """The number of tracks."""
        return self.samples.shape[1]

    @property
    def columns(self) -> Columns:
        """Tracks side by side; without a speed several columns are the motions of the wheels, each its own."""
        return Columns("by wheel" if self.speed is None and self.wheels > 1 else "road", self.wheels)

    @property
    def grid(self) -> float | None:
        """The spacing of the samples [s]."""
        if self.speed is None:
            return self.spacing
        speed = _checks.concrete(self.speed)
        return None if speed is None else self.spacing / float(speed)

    @property
    def duration(self) -> float | None:
        """The time [s] from the first sample to the last, or to the first repeated one if the road is periodic."""
        intervals = self.samples.shape[0] - (0 if self.periodic else 1)
        return None if self.grid is None else intervals * self.grid

    @property
    def span(self) -> tuple[Scalar | float, Scalar | float]:
        """From 0 to the time [s] of the last sample; without ends if the road is periodic."""
        if self.periodic:
            return -math.inf, math.inf
        length = (self.samples.shape[0] - 1) * self.spacing
        return 0.0, length if self.speed is None else length / self.speed

    def reseeded(self, seed: int) -> "SampledRoad | None":
        """Another realisation of a random road whose process is known.

        Equal tracks stay equal, independent ones independent.
        """
        if self.process is None:
            return None
        return eqx.tree_at(lambda road: road.samples, self, self.process.redraw(self.samples[:, 0], seed)[:, None])

    def _refuse_outside(self, time: SignalLike) -> None:
        times, grid, duration = _checks.concrete(time), self.grid, self.duration
        if self.periodic or times is None or grid is None or duration is None or times.size == 0:
            return
        tolerance = _tolerance(self.samples) * grid
        if times.min() < -tolerance or times.max() > duration + tolerance:
            _checks.refuse(
                "time",
                f"stay within this road, which lasts from 0 to {duration:.6g} s",
                f"from {times.min():.6g} to {times.max():.6g} s",
                "Ask for a shorter time, give a longer profile, or make the road with periodic=True.",
            )
