"""A slope that decreases with velocity, as vehicle simulators describe truck dampers."""

from collections.abc import Sequence
from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers._guesses import knee_scan
from jaxdamp.dampers._plainer import curve_samples
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.dampers.bilinear import Bilinear
from jaxdamp.dampers.linear import Linear
from jaxdamp.parameters import nonnegative, parameter, positive


def degressive(v: ScalarLike, rate: ScalarLike, degressivity: ScalarLike) -> Scalar:
    """F = c v/(1 + d|v|) [N]: slope c at v = 0, c/(1 + d|v|)² elsewhere; the force tends to c/d."""
    return rate * v / (1.0 + degressivity * jnp.abs(v))


@final
class Degressive(AbstractMemoryless):
    """F = c v/(1 + d|v|), with a slope c and a degressivity d for each direction.

    It is the degressive damper of Chrono (`DegressiveDamperForce`), used there for trucks, buses and cars; d = 0 is the
    linear law. At |v| = 1/d the force is half of its limit c/d. F increases with v everywhere, so the law is passive.
    F(0) = 0 and the slope is finite everywhere; it is continuous at v = 0 (C¹) only if both slopes c are equal.

    Data below 1/d determine c but not the limit c/d.

    >>> law = Degressive(98727.9, 4.77954, 52526.6, 3.0)
    >>> [round(float(law.force_velocity(v)), 2) for v in (1.0, -1.0)]
    [17082.31, -13131.65]
    """

    rebound_rate: Number = parameter("N s/m", "slope at v = 0 in rebound", positive, linear=True)
    rebound_degressivity: Number = parameter(
        "s/m", "d in rebound, inverse of the velocity of half the limit", nonnegative
    )
    compression_rate: Number = parameter("N s/m", "slope at v = 0 in compression", positive, linear=True)
    compression_degressivity: Number = parameter(
        "s/m", "d in compression, inverse of the velocity of half the limit", nonnegative
    )

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        extends = jnp.asarray(v) >= 0
        rate = jnp.where(extends, self.rebound_rate, self.compression_rate)
        return degressive(v, rate, jnp.where(extends, self.rebound_degressivity, self.compression_degressivity))

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "Degressive":
        """Start values from measured data: the slope by least squares for several degressivities, the best of them."""
        values = []
        for side in (1, -1):
            knee, (rate,) = knee_scan(
                velocity, force, side, lambda v, knee: [v / (1.0 + v / knee)], np.geomspace(0.02, 50.0, 40)
            )
            values += [max(float(rate), 1.0), 1.0 / knee]
        return cls(*values)

    def plainer(self, undetermined: Sequence[str], fastest: float) -> AbstractMemoryless:
        """Straight lines, one for each side or for both."""
        return plainer_curve(self, 4 - len(undetermined), fastest)


def plainer_curve(law: AbstractMemoryless, most: int, fastest: float) -> AbstractMemoryless:
    """A curve of at most so many numbers, or of one, with about the forces of a law.

    Arguments:
        law: any law of the velocity.
        most: numbers.
        fastest: largest velocity [m/s].
    """
    kind = Degressive if most >= 4 else Bilinear if most >= 2 else Linear
    return kind.guess(*curve_samples(law, fastest))
