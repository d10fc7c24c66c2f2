"""Force-velocity points, as vehicle simulators exchange them."""

from typing import final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._guesses import Elsewhere
from jaxdamp._types import Scalar, ScalarLike, Vector, VectorLike
from jaxdamp.dampers._guesses import velocity_grid
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.dampers.piecewise_linear import hinges
from jaxdamp.parameters import as_float, increasing, parameter, setting


TOLERANCE = 0.05  # of the largest force; measured points near zero velocity scatter by the friction


def check_points(velocity: Array, force: Array) -> None:
    """Refuse fewer than two points, or different numbers of forces and velocities."""
    if velocity.ndim != 1 or velocity.size < 2 or force.shape != velocity.shape:
        must = "hold two or more points, one force for each velocity"
        _checks.refuse("force", must, f"of shape {force.shape} for velocities of shape {velocity.shape}")


def drives_motion(velocity: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Whether the force adds energy to the motion, for each point of a curve F(v), shape (points,).

    A law F(v) dissipates energy over every cycle if and only if (F(v) − F(0)) v ≥ 0 for all v, where F(0) is a constant
    force such as that of the gas. Violations below 5 % of the largest force are ignored, and so are curves that do not
    include zero velocity.

    Arguments:
        velocity: increasing velocities [m/s], shape (points,).
        force: forces [N], shape (points,).
    """
    if not (np.all(np.isfinite(force)) and velocity[0] <= 0.0 <= velocity[-1]):
        return np.zeros(velocity.shape, dtype=bool)
    rise = force - np.interp(0.0, velocity, force)
    return rise * np.sign(velocity) < -TOLERANCE * np.max(np.abs(rise))


def refuse_active(velocity: Array, force: Array) -> None:
    """Refuse points whose force adds energy to the motion (`drives_motion`); traced values are not checked.

    Raises:
        ValueError: the first of these points.
    """
    v, f = _checks.concrete(velocity), _checks.concrete(force)
    if v is None or f is None:
        return
    driven = drives_motion(v, f)
    if np.any(driven):
        first = int(np.argmax(driven))
        value = f"{f[first]:g} N at {v[first]:g} m/s, {np.count_nonzero(driven)} of {v.size} points"
        must = "resist the motion, so that it is larger than at zero velocity in rebound and smaller in compression"
        remedy = (
            "Force is positive when it resists extension: in compression a damper's force is negative. "
            "For an active element, pass `allow_active=True`."
        )
        _checks.refuse("force", must, value, remedy)


def checked_points(velocity: VectorLike, force: VectorLike, *, allow_active: bool) -> tuple[Array, Array]:
    """The points of a curve as arrays; active ones are refused unless they are allowed."""
    v, f = as_float(velocity, "velocity"), as_float(force, "force")
    check_points(v, f)
    if not allow_active:
        refuse_active(v, f)
    return v, f


class AbstractPoints(AbstractMemoryless):
    """A curve through points (vₖ, Fₖ)."""

    velocity: Vector = setting("m/s", "velocities of the points", increasing)
    force_points: Vector = parameter("N", "forces at the points")

    def __check_init__(self) -> None:
        check_points(self.velocity, self.force_points)

    def constant_forces(self) -> tuple[str, ...]:
        """The points may all move by one force."""
        return ("force_points",)


@final
class Table(AbstractPoints):
    """Straight lines between the points (vₖ, Fₖ); outside, the end slopes continue.

    Arguments:
        velocity: strictly increasing velocities [m/s], shape (k,), k ≥ 2; a fit does not change them.
        force: forces [N] at these velocities, shape (k,).
        allow_active: accept points whose force adds energy to the motion.

    Raises:
        ValueError: fewer than two points, shapes that differ, velocities that do not increase; points that add
            energy, unless `allow_active`. A fit may produce such points; its result then has a warning.

    >>> law = Table(velocity=[-1.0, 0.0, 0.2, 1.0], force=[-900.0, 0.0, 700.0, 1900.0])
    >>> [round(float(law.force_velocity(v)), 6) for v in (0.1, 0.6, 1.2)]
    [350.0, 1300.0, 2200.0]
    """

    force_points: Vector = parameter("N", "forces at the points", linear=True)

    from_csv = Elsewhere("`jaxdamp.bench.read_table(path).law()`")

    def __init__(self, velocity: VectorLike, force: VectorLike, *, allow_active: bool = False) -> None:
        self.velocity, self.force_points = checked_points(velocity, force, allow_active=allow_active)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        slopes = jnp.diff(self.force_points) / jnp.diff(self.velocity)
        knots = self.velocity[1:-1]
        shift = self.velocity[0]
        return self.force_points[0] + hinges(v - shift, knots - shift, slopes, 0.0)

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray, points_a_side: int = 6) -> "Table":
        """Points from measured data by least squares, closer together towards zero velocity."""
        grid = velocity_grid(np.asarray(velocity), points_a_side)
        hats = np.stack([np.interp(velocity, grid, unit) for unit in np.eye(grid.size)], axis=1)
        points, shown = np.linalg.lstsq(hats, np.asarray(force), rcond=None)[0], hats.any(axis=0)
        # A point without a sample beside it lies between its neighbours.
        return cls(grid, np.interp(grid, grid[shown], points[shown]), allow_active=True)
