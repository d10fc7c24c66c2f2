"""A damper on a linkage whose motion ratio changes with the stroke."""

from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._limits import root, within
from jaxdamp._types import Scalar, ScalarLike, State, Vector
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.bump_stop import penetration
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.fitted_range import Motion
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import increasing, parameter, positive, setting


@final
class Linkage(AbstractWrapper):
    """F_wheel = r(x) F_law(s(x), r(x) v), with the motion ratio r = ds/dx of a damper travel s over the wheel travel x.

    Power is kept, F_wheel v = F_law ds/dt. The ratio lies on straight lines between the points (xₖ, rₖ) and is constant
    beyond the first and the last; s is its exact integral with s(0) = 0, so both strokes have one zero, in extension
    positive. For a ratio that does not change use `MotionRatio`.

    Springs and stops at the same lever go inside with the damper, `Linkage(damper + spring + stop, ...)`. The stiffness
    at the wheel is then r² k + (dr/dx) F_law: a static force inside, such as the preload of a `Spring` or the charge of
    a `GasSpring`, acts on the stiffness too.

    Arguments:
        law: the law at the damper.
        travel: strictly increasing wheel travels xₖ [m] from the zero of the stroke, shape (k,), k ≥ 2.
        ratio: damper travel divided by wheel travel there, rₖ > 0, shape (k,).

    Raises:
        ValueError: fewer than two points, shapes that differ, travels that do not increase, ratios that are not
            positive.

    >>> from jaxdamp.dampers import Linear
    >>> law = Linkage(Linear(2000.0), travel=[-0.1, 0.0, 0.1], ratio=[0.9, 0.8, 0.6])
    >>> [round(float(law.force(x, 0.1, law.initial_state())), 6) for x in (-0.2, -0.05, 0.0, 0.2)]
    [162.0, 144.5, 128.0, 72.0]
    >>> [round(float(s), 6) for s in law.inner_motion(0.1, 1.0)]
    [0.07, 0.6]
    """

    law: AbstractDamper
    travel: Vector = setting("m", "wheel travels of the ratios", increasing)
    ratio: Vector = parameter("", "damper travel divided by wheel travel", positive, adjustable=False)

    def __check_init__(self) -> None:
        if self.travel.ndim != 1 or self.travel.size < 2 or self.ratio.shape != self.travel.shape:
            must = "hold two or more ratios, one for each wheel travel"
            was = f"of shape {self.ratio.shape} for travels of shape {self.travel.shape}"
            _checks.refuse("ratio", must, was, "For one ratio use `MotionRatio(law, ratio)`.")

    def is_linear_in_law(self) -> bool:
        """A factor on the force is linear, whatever the motion."""
        return True

    def traits(self) -> Traits:
        """A factor of the stroke on the force."""
        return super().traits().scaled_along_stroke()

    def _bends(self, x: ScalarLike | Array) -> tuple[Array, Array]:
        """Travel [m] beyond each point but the last, up to the next one smoothed off, and its slope."""
        return penetration(x - self.travel[:-1], jnp.diff(self.travel))

    def lever(self, x: ScalarLike) -> tuple[Scalar, Scalar]:
        """Damper travel s [m] and motion ratio r at wheel travel x [m]."""
        (travels, shares), (begun, _) = self._bends(x), self._bends(jnp.zeros_like(self.travel[0]))
        changes = jnp.diff(self.ratio)
        return self.ratio[0] * x + jnp.sum(changes * (travels - begun)), self.ratio[0] + jnp.sum(changes * shares)

    def wheel_travel(self, s: ScalarLike) -> Scalar:
        """Wheel travel x [m] at damper travel s [m], the inverse of `lever`."""
        strokes, _ = jax.vmap(self.lever)(self.travel)
        inside = within(jnp.asarray(s, strokes.dtype), strokes[0], strokes[-1])
        k = jnp.clip(jnp.searchsorted(strokes, inside) - 1, 0, self.travel.size - 2)
        further, ratio = inside - strokes[k], self.ratio[k]
        slope = (self.ratio[k + 1] - ratio) / (self.travel[k + 1] - self.travel[k])
        on_line = 2.0 * further / (ratio + root(ratio * ratio + 2.0 * slope * further))
        beyond = (s - inside) / jnp.where(s < inside, self.ratio[0], self.ratio[-1])
        return self.travel[k] + on_line + beyond

    @property
    def stroke_limits(self) -> tuple[ScalarLike, ScalarLike]:
        """Strokes [m] at the wheel within which the damper law is valid."""
        low, high = self.law.stroke_limits
        return self.wheel_travel(low), self.wheel_travel(high)

    def motion_inside(self, motion: Motion) -> list[tuple[AbstractDamper, Motion]]:
        """The damper's own stroke, velocity and force; of an unknown stroke, with the ratio at stroke zero."""
        if motion.stroke is None:
            _, ratio = self.lever(0.0)
            return [(self.law, motion.moved(ratio).divided(ratio))]
        stroke, ratio = map(np.asarray, jax.vmap(self.lever)(jnp.asarray(motion.stroke)))
        return [(self.law, motion.levered(stroke, ratio))]

    def inner_motion(self, x: ScalarLike, v: ScalarLike) -> tuple[ScalarLike, ScalarLike]:
        """Stroke [m] and velocity [m/s] of the damper."""
        stroke, ratio = self.lever(x)
        return stroke, ratio * v

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force at the wheel [N]."""
        stroke, ratio = self.lever(x)
        return ratio * self.law.force(stroke, ratio * v, state)
