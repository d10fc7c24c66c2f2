"""A law times a factor."""

from typing import final

import equinox as eqx
import numpy as np

from jaxdamp import _checks
from jaxdamp._traced import behind
from jaxdamp._types import Number, Scalar
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.motion import Motion
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import nonnegative, parameter, real


@final
class Scaled(AbstractWrapper):
    """A law whose force is multiplied by a factor, F = factor · F_law; made by `2.0 * law`.

    Arguments:
        law: the law.
        factor: factor on the force, not negative: a negative one would add energy to the motion, F v ≤ 0.
        allow_active: accept a negative factor, for example for stability studies.
    """

    law: AbstractDamper
    factor: Number = parameter("", "factor on the force", lambda law: real if law.allow_active else nonnegative)
    allow_active: bool = eqx.field(static=True, default=False)

    def __check_init__(self) -> None:
        factor = behind(self.factor)
        if factor is not None and np.any(factor < 0) and not self.allow_active:
            remedy = "The law would add energy. If this is intended: `Scaled(law, factor, allow_active=True)`."
            _checks.refuse("factor", "not be negative", factor, remedy)

    def is_linear_in_law(self) -> bool:
        """A factor is linear."""
        return True

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The same motion with the force divided by the factor."""
        return [(self.law, motion.divided(self.factor))]

    def outer_force(self, force: Scalar) -> Scalar:
        """Force [N]."""
        return self.factor * force
