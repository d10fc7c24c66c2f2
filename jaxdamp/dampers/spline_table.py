"""A smooth curve through force-velocity points."""

from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import at_least, at_most, within
from jaxdamp._types import Scalar, ScalarLike, VectorLike
from jaxdamp.dampers.table import AbstractPoints, Table, checked_points


def monotone_slopes(gaps: Float[Array, " gaps"], secants: Float[Array, " gaps"]) -> Float[Array, " gaps+1"]:
    """Slopes at k points for monotone cubic interpolation (Fritsch and Butland 1984; SciPy's PCHIP).

    At inner points the weighted harmonic mean of the secants on both sides, zero if these differ in sign. At the ends
    the slope of a parabola through three points, limited to between zero and three times the secant.
    """
    if secants.size == 1:
        return jnp.concatenate([secants, secants])
    left, right = secants[:-1], secants[1:]
    on_left, on_right = 2.0 * gaps[1:] + gaps[:-1], gaps[1:] + 2.0 * gaps[:-1]
    # The quotient would be 0/0 where both secants are zero: ones are used there, so that derivatives are not NaN.
    same_sign = left * right > 0.0
    left, right = jnp.where(same_sign, left, 1.0), jnp.where(same_sign, right, 1.0)
    mean = (on_left + on_right) * left * right / (on_left * right + on_right * left)

    def end(gap: Scalar, next_gap: Scalar, secant: Scalar, next_secant: Scalar) -> Scalar:
        parabola = ((2.0 * gap + next_gap) * secant - gap * next_secant) / (gap + next_gap)
        return within(parabola, at_most(3.0 * secant, 0.0), at_least(3.0 * secant, 0.0))

    first = end(gaps[0], gaps[1], secants[0], secants[1])
    last = end(gaps[-1], gaps[-2], secants[-1], secants[-2])
    return jnp.concatenate([first[None], jnp.where(same_sign, mean, 0.0), last[None]])


@final
class SplineTable(AbstractPoints):
    """Monotone cubics between the points (vₖ, Fₖ), as PCHIP; outside, the end slopes continue.

    The slope is continuous, so the force has no kinks; the curve is monotone between points and never overshoots them.
    A strong bend near an end gives zero slope at this end and beyond. Unlike `Table`, the law is not linear in the
    forces. Where two neighbouring secants are zero or change sign, the slope has a kink as a function of the forces,
    with finite derivatives.

    Arguments:
        velocity: strictly increasing velocities [m/s], shape (k,), k ≥ 2; a fit does not change them.
        force: forces [N] at these velocities, shape (k,).
        allow_active: accept points whose force adds energy to the motion.

    Raises:
        ValueError: fewer than two points, shapes that differ, velocities that do not increase; points that add
            energy, unless `allow_active`. A fit may produce such points; its result then has a warning.

    >>> law = SplineTable(velocity=[-1.0, 0.0, 0.2, 1.0], force=[-900.0, 0.0, 500.0, 1900.0])
    >>> [round(float(law.force_velocity(v)), 3) for v in (0.0, 0.1, 0.2, 1.2)]
    [0.0, 233.599, 500.0, 2130.0]
    """

    def __init__(self, velocity: VectorLike, force: VectorLike, *, allow_active: bool = False) -> None:
        self.velocity, self.force_points = checked_points(velocity, force, allow_active=allow_active)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        if jnp.ndim(v):
            remedy = "For several use `jax.vmap(law.force_velocity)(velocities)`."
            _checks.refuse("v", "be one velocity", f"of shape {jnp.shape(v)}", remedy)
        gaps, rises = jnp.diff(self.velocity), jnp.diff(self.force_points)
        slopes = monotone_slopes(gaps, rises / gaps)
        left, right = gaps * slopes[:-1], gaps * slopes[1:]
        # The contribution of each segment up to v: a sum without a search, which is fast inside loops.
        u = within((v - self.velocity[:-1]) / gaps, 0.0, 1.0)
        added = u * (left + u * (3.0 * rises - 2.0 * left - right + u * (left + right - 2.0 * rises)))
        below = slopes[0] * at_most(v - self.velocity[0], 0.0)
        above = slopes[-1] * at_least(v - self.velocity[-1], 0.0)
        return self.force_points[0] + below + jnp.sum(added) + above

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray, points_a_side: int = 6) -> "SplineTable":
        """Points from measured data, closer together towards zero velocity, approximately by least squares.

        It starts from the least squares points of straight lines (`Table.guess`) and three times adds those of the
        remaining error.
        """
        velocity, force = np.asarray(velocity, dtype=float), np.asarray(force, dtype=float)
        start = Table.guess(velocity, force, points_a_side)
        law = cls(start.velocity, start.force_points, allow_active=True)
        for _ in range(3):
            error = force - np.asarray(jax.vmap(law.force_velocity)(jnp.asarray(velocity)))
            forces = law.force_points + Table.guess(velocity, error, points_a_side).force_points
            law = cls(law.velocity, forces, allow_active=True)
        return law
