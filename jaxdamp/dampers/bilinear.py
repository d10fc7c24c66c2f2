"""Two slopes: one for rebound, one for compression."""

from collections.abc import Sequence
from typing import final

import numpy as np

from jaxdamp._limits import smooth_abs
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers._guesses import secant_rate
from jaxdamp.dampers._plainer import curve_samples
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.dampers.linear import Linear
from jaxdamp.parameters import nonnegative, parameter, positive, setting


@final
class Bilinear(AbstractMemoryless):
    """F = c_r max(v, 0) + c_c min(v, 0).

    With a knee width ε the kink at v = 0 is rounded, F = (c_r+c_c)/2 v + (c_r−c_c)/2 (√(v²+ε²) − ε): F(0) stays zero
    and the largest difference from the kinked law is |c_r − c_c| ε/2.

    >>> law = Bilinear(rebound_rate=2600.0, compression_rate=1200.0)
    >>> [round(float(law.force_velocity(v)), 6) for v in (0.1, -0.1)]
    [260.0, -120.0]
    """

    rebound_rate: Number = parameter("N s/m", "slope for v > 0", positive, linear=True)
    compression_rate: Number = parameter("N s/m", "slope for v < 0", positive, linear=True)
    knee_width: Number = setting("m/s", "width over which the kink is rounded", nonnegative, default=0.0)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        mean = 0.5 * (self.rebound_rate + self.compression_rate)
        half = 0.5 * (self.rebound_rate - self.compression_rate)
        return mean * v + half * smooth_abs(v, self.knee_width)

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "Bilinear":
        """Start values from measured data: the secant slopes of the two sides."""
        return cls(secant_rate(velocity, force, 1), secant_rate(velocity, force, -1))

    def plainer(self, undetermined: Sequence[str], fastest: float) -> Linear:
        """The same slope on both sides."""
        del undetermined
        return Linear.guess(*curve_samples(self, fastest))
