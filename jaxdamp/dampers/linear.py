"""Viscous damper."""

from typing import final

import numpy as np

from jaxdamp import _checks
from jaxdamp._traced import behind
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.parameters import parameter, positive


@final
class Linear(AbstractMemoryless):
    """F = c v, the viscous damper (paper 000, eq. 3).

    Valid for laminar flow through the valves; real dampers have a steeper slope at low velocity and are softer in
    compression.

    >>> round(float(Linear(2500.0).force_velocity(0.2)), 6)
    500.0
    """

    rate: Number = parameter("N s/m", "damping coefficient", positive, linear=True)

    def __check_init__(self) -> None:
        rate = behind(self.rate)
        if rate is not None and np.any(rate == 0.0):
            remedy = "For a vehicle without damping write `Linear(1e-6)`, whose force is negligible."
            _checks.refuse("Linear.rate", "be positive [N s/m]", rate, remedy)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        return self.rate * v

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "Linear":
        """Start value from measured data: least squares through the origin."""
        velocity, force = np.asarray(velocity), np.asarray(force)
        return cls(max(float(np.vdot(velocity, force) / max(np.vdot(velocity, velocity), 1e-12)), 1.0))
