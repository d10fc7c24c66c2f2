"""A damper with a motion ratio to the wheel."""

from typing import final

from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import parameter, positive


@final
class MotionRatio(AbstractWrapper):
    """F_wheel = i F_law(i x, i v), with i = damper travel / wheel travel: force and motion both change.

    A linear damper c acts at the wheel as i² c.

    >>> from jaxdamp.dampers import Linear
    >>> law = MotionRatio(Linear(2000.0), ratio=0.8)
    >>> round(float(law.force(0.0, 0.1, law.initial_state())), 6)
    128.0
    """

    law: AbstractDamper
    ratio: Number = parameter("", "damper travel divided by wheel travel", positive, adjustable=False)

    def is_linear_in_law(self) -> bool:
        """A factor on the force is linear, whatever the motion."""
        return True

    @property
    def stroke_limits(self) -> tuple[ScalarLike, ScalarLike]:
        """Strokes [m] at the wheel within which the damper law is valid."""
        low, high = self.law.stroke_limits
        return low / self.ratio, high / self.ratio

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The damper's own stroke and velocity, i times those at the wheel, and its own force."""
        return [(self.law, motion.moved(self.ratio).divided(self.ratio))]

    def inner_motion(self, x: ScalarLike, v: ScalarLike) -> tuple[ScalarLike, ScalarLike]:
        """Stroke [m] and velocity [m/s] of the damper."""
        return self.ratio * x, self.ratio * v

    def outer_force(self, force: Scalar) -> Scalar:
        """Force at the wheel [N]."""
        return self.ratio * force
