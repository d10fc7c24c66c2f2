"""A piecewise-linear force-velocity curve."""

import dataclasses
from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import ramp
from jaxdamp._types import Number, Scalar, ScalarLike, Vector
from jaxdamp.dampers._guesses import velocity_grid
from jaxdamp.dampers._plainer import curve_samples
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.dampers.degressive import plainer_curve
from jaxdamp.parameters import increasing, nonnegative, parameter, positive, real, setting


def hinges(v: ScalarLike, knots: Float[Array, " knots"], slopes: Float[Array, " knots+1"], width: ScalarLike) -> Scalar:
    """s₀ v + Σ (sₖ − sₖ₋₁) max(v − vₖ, 0), shifted so that it is zero at v = 0; knees rounded over `width`."""
    if jnp.ndim(v):
        remedy = "For several use `jax.vmap(law.force_velocity)(velocities)`."
        _checks.refuse("v", "be one velocity", f"of shape {jnp.shape(v)}", remedy)

    def curve(v: ScalarLike) -> Scalar:
        return slopes[0] * v + jnp.sum(jnp.diff(slopes) * ramp(v - knots, width))

    return curve(v) - curve(jnp.zeros((), slopes.dtype))


@final
class PiecewiseLinear(AbstractMemoryless):
    """F(v) continuous with slope sₖ between the knots vₖ, and F(0) = 0.

    F = s₀ v + Σ (sₖ − sₖ₋₁) max(v − vₖ, 0) − const. With `monotone` (the default) all slopes are positive, so the law
    is passive and can be inverted. A knee width w rounds the knots: max(u, 0) becomes w ln(1 + exp(u/w)). By default a
    tuning moves the slopes between the knots, and the knots only where they are named.

    Arguments:
        knots: velocities [m/s] where the slope changes, strictly increasing, shape (k,).
        slopes: slopes [N s/m], shape (k+1,): below the first knot, between the knots, above the last.
        knee_width: width [m/s] of the rounding, 0 for sharp knees.
        monotone: allow positive slopes only.

    >>> law = PiecewiseLinear(knots=[-0.1, 0.1], slopes=[500.0, 2000.0, 800.0])
    >>> [round(float(law.force_velocity(v)), 6) for v in (0.0, 0.1, 0.2, -0.2)]
    [0.0, 200.0, 280.0, -250.0]
    """

    knots: Vector = parameter("m/s", "velocities where the slope changes", increasing, adjustable=False)
    slopes: Vector = parameter(
        "N s/m", "slopes between the knots", lambda law: positive if law.monotone else real, linear=True
    )
    knee_width: Number = setting("m/s", "width over which the knees are rounded", nonnegative, default=0.0)
    monotone: bool = eqx.field(static=True, default=True)

    def __check_init__(self) -> None:
        if self.knots.ndim != 1 or self.slopes.shape != (self.knots.size + 1,):
            must = "have one entry more than `knots`"
            _checks.refuse("slopes", must, f"of shape {self.slopes.shape} for knots of shape {self.knots.shape}")

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        return hinges(v, self.knots, self.slopes, self.knee_width)

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray, knots_a_side: int = 3) -> "PiecewiseLinear":
        """Start values from measured data: knots closer together towards zero, slopes by least squares."""
        velocity, force = np.asarray(velocity), np.asarray(force)
        knots = velocity_grid(velocity, knots_a_side + 1)[1:-1]
        knots = np.delete(knots, knots_a_side)  # no knot at zero: the two innermost knots describe the kink there
        columns = [velocity] + [np.maximum(velocity - k, 0.0) - max(-k, 0.0) for k in knots]
        jumps = np.linalg.lstsq(np.stack(columns, axis=1), force, rcond=None)[0]
        slopes = np.cumsum(jumps)
        return cls(knots, np.maximum(slopes, 0.02 * max(slopes.max(), 1.0)))

    def plainer(self, undetermined: Sequence[str], fastest: float) -> AbstractMemoryless | None:
        """Without the knots at which the curve bends least; or a curve without any.

        Half of those that are not known are left out: of two in one bend, neither is known until one is left.
        First those beyond the largest velocity, where nothing was measured, and all but one of several at one place.
        """
        knots = np.unique(self.knots)
        left = self.knots.size - max((undetermined.count("knots") + 1) // 2, 1)
        if not self.knots.size:
            return None
        knots = knots[np.abs(knots) < fastest]
        if left < 1 or not knots.size:
            most = min(self.knots.size + self.slopes.size - len(undetermined), 2 * knots.size + 1)
            return plainer_curve(self, most, fastest)
        velocity = np.array([-fastest, *knots, fastest])
        force = np.interp(velocity, *curve_samples(self, fastest))
        while len(velocity) > left + 2:
            chords = force[:-2] + (force[2:] - force[:-2]) * np.diff(velocity[:-1]) / (velocity[2:] - velocity[:-2])
            least = 1 + int(np.argmin(np.abs(force[1:-1] - chords)))
            velocity, force = np.delete(velocity, least), np.delete(force, least)
        return dataclasses.replace(self, knots=velocity[1:-1], slopes=np.diff(force) / np.diff(velocity))
