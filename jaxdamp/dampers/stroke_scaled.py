"""Any law whose force changes along the stroke."""

from typing import final

import jax.numpy as jnp

from jaxdamp._limits import within
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import parameter


@final
class StrokeScaled(AbstractWrapper):
    """F = F_law exp(a x + b x²): a force that rises or falls along the stroke, with or without states.

    The gas pressure, which presses the seal to the rod, the clearance of a worn or tapered tube, the length of the gap
    of a magnetorheological piston change with the stroke. The factor is positive, so that a law that dissipates at
    every instant still does; one at x = 0. It grows steeply, so the law holds within the strokes of its records; its
    exponent is kept within ±60, so that the force is finite at any stroke. `StrokeDependent` has a curve of its own for
    each stroke, of laws without states.

    Arguments:
        law: the force at x = 0.
        slope: a [1/m].
        curvature: b [1/m²].

    >>> import numpy as np
    >>> from jaxdamp.dampers import Linear
    >>> law = StrokeScaled(Linear(2000.0), slope=-2.0, curvature=np.log(2.0) / 0.05**2)
    >>> [round(float(law.force(x, 0.1, law.initial_state())), 3) for x in (-0.05, 0.0, 0.05)]
    [442.068, 200.0, 361.935]
    """

    law: AbstractDamper
    slope: Number = parameter("1/m", "a, relative change of the force per metre", default=0.0, adjustable=False)
    curvature: Number = parameter("1/m^2", "b, of the logarithm of the factor", default=0.0, adjustable=False)

    def is_linear_in_law(self) -> bool:
        """A factor is linear."""
        return True

    def traits(self) -> Traits:
        """A factor of the stroke on the force."""
        return super().traits().scaled_along_stroke()

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same motion; the force inside is not known."""
        return [(self.law, motion.with_force(None))]

    def factor(self, x: ScalarLike) -> Scalar:
        """exp(a x + b x²), from e⁻⁶⁰ to e⁶⁰."""
        return jnp.exp(within((self.slope + self.curvature * x) * x, -60.0, 60.0))

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        return self.factor(x) * self.law.force(x, v, state)
