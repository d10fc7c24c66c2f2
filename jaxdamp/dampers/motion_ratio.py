"""A damper that moves less, or more, than the point it is referred to."""

from typing import ClassVar, final

from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.motion import Motion
from jaxdamp.parameters import parameter, positive


@final
class MotionRatio(AbstractDamper):
    """F_wheel = i F_law(i x, i v), with i = damper travel / wheel travel: force and motion both change.

    A linear damper c acts at the wheel as i² c.

    >>> from jaxdamp.dampers import Linear
    >>> law = MotionRatio(Linear(2000.0), ratio=0.8)
    >>> round(float(law.force(0.0, 0.1, law.initial_state())), 6)
    128.0
    """

    law: AbstractDamper
    ratio: Number = parameter("", "damper travel divided by wheel travel", positive)

    preserves_linearity: ClassVar[bool] = True

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The damper's own stroke and velocity, i times those at the wheel, and its own force."""
        return [(self.law, motion.moved(self.ratio).divided(self.ratio))]

    def initial_state(self) -> State:
        """The states of the law."""
        return self.law.initial_state()

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force at the wheel [N]."""
        return self.ratio * self.law.force(self.ratio * x, self.ratio * v, state)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of the law."""
        return self.law.state_rate(self.ratio * x, self.ratio * v, state)

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """The step of the law."""
        i = self.ratio
        return self.law.advance(i * x0, i * v0, i * x1, i * v1, state, dt)

    def predict(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """What the law predicts."""
        i = self.ratio
        return self.law.predict(i * x0, i * v0, i * x1, i * v1, state, dt)
