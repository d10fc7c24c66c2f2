"""The motion of a law in use: channels that are compared with its fitted range."""

import dataclasses
from typing import Any, final

import numpy as np
from jaxtyping import Float


Samples = Float[np.ndarray, " samples"]


@final
@dataclasses.dataclass(frozen=True)
class Motion:
    """Stroke, velocity and force of a law at uniformly spaced times; `None` for unknown channels.

    Arguments:
        stroke: [m], positive in extension, shape (samples,).
        velocity: [m/s], shape (samples,).
        force: [N], positive when it resists extension, shape (samples,).
        temperature: of the oil [K].
    """

    stroke: Samples | None = None
    velocity: Samples | None = None
    force: Samples | None = None
    temperature: float | None = None

    def moved(self, ratio: Any) -> "Motion":
        """Stroke and velocity times a ratio."""
        stroke, velocity = (None if a is None else float(ratio) * a for a in (self.stroke, self.velocity))
        return dataclasses.replace(self, stroke=stroke, velocity=velocity)

    def divided(self, factor: Any) -> "Motion":
        """The force divided by a factor (unknown if the factor is zero)."""
        return self.with_force(None if self.force is None or float(factor) == 0.0 else self.force / float(factor))

    def with_force(self, force: Samples | None) -> "Motion":
        """The same motion at another force [N]."""
        return dataclasses.replace(self, force=force)

    def at_temperature(self, temperature: Any) -> "Motion":
        """The same motion at another oil temperature [K]."""
        return dataclasses.replace(self, temperature=float(temperature))
