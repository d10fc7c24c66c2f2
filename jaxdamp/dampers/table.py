"""Force-velocity points, as vehicle simulators exchange them."""

from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._guesses import Elsewhere
from jaxdamp._types import Scalar, ScalarLike, Vector, VectorLike
from jaxdamp.dampers._guesses import velocity_grid
from jaxdamp.dampers._hinges import hinges
from jaxdamp.dampers._points import check_points, refuse_active
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.dampers.traits import Traits
from jaxdamp.parameters import as_float, increasing, parameter, setting


@final
class Table(AbstractMemoryless):
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

    velocity: Vector = setting("m/s", "velocities of the points", increasing)
    force_points: Vector = parameter("N", "forces at the points", linear=True)

    from_csv = Elsewhere("`Table(*numpy.loadtxt(path, delimiter=',', skiprows=1, usecols=(0, 1)).T)`, in m/s and N")

    def __init__(self, velocity: VectorLike, force: VectorLike, *, allow_active: bool = False) -> None:
        self.velocity = as_float(velocity, "velocity")
        self.force_points = as_float(force, "force")
        check_points(self.velocity, self.force_points)
        if not allow_active:
            refuse_active(self.velocity, self.force_points)

    def __check_init__(self) -> None:
        check_points(self.velocity, self.force_points)

    def traits(self) -> Traits:
        """The points may all move by one force."""
        return super().traits()._replace(contains_offset=True)

    def constant_forces(self) -> tuple[str, ...]:
        """The points may all move by one force."""
        return ("force_points",)

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
