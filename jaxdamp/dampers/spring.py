"""A linear spring with a preload, for the elastic part of the force in bench records."""

from typing import final

import numpy as np

from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers.base import AbstractStateless
from jaxdamp.dampers.contract import Traits
from jaxdamp.parameters import nonnegative, parameter


@final
class Spring(AbstractStateless):
    """F = k x + f₀: a stiffness parallel to the damper and the force at stroke zero.

    For a gas volume over small strokes, an accumulator, elastic seals, or the offset of a load cell. It dissipates no
    energy. f₀ < 0 pushes the rod out. For the gas pressure over the whole stroke use `GasSpring`. A tuning leaves both
    numbers alone unless they are named.

    >>> law = Spring(stiffness=2000.0, preload=-150.0)
    >>> float(law.force(0.01, 0.0, law.initial_state()))
    -130.0
    """

    stiffness: Number = parameter(
        "N/m", "k, stiffness parallel to the damper", nonnegative, linear=True, adjustable=False
    )
    preload: Number = parameter("N", "f₀, force at rest at stroke zero", linear=True, adjustable=False, default=0.0)

    def traits(self) -> Traits:
        """Independent of the velocity."""
        return super().traits()._replace(has_feed_through=False)

    def constant_forces(self) -> tuple[str, ...]:
        """The preload."""
        return ("preload",)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m]."""
        del v
        return self.stiffness * x + self.preload

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray, stroke: np.ndarray) -> "Spring":
        """Start values from measured data: the part of the force proportional to the stroke, by least squares."""
        velocity, force, stroke = np.asarray(velocity), np.asarray(force), np.asarray(stroke)
        columns = np.stack([stroke, np.ones_like(stroke), velocity, np.sign(velocity)], axis=1)
        stiffness, preload = np.linalg.lstsq(columns, force, rcond=None)[0][:2]
        least = 1e-3 * float(np.max(np.abs(force))) / max(float(np.ptp(stroke)), 1e-9)
        return cls(max(float(stiffness), least), float(preload))
