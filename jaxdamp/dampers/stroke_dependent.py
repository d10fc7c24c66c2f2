"""A damper that depends on its stroke: hydraulic stops, grooves in the tube, tables over stroke and velocity."""

from collections.abc import Sequence
from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_field_types
from jaxdamp._limits import within
from jaxdamp._types import Scalar, ScalarLike, Vector, VectorLike
from jaxdamp.dampers.base import AbstractDamper, AbstractStateless, refuse_states
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.table import Table
from jaxdamp.parameters import as_float, increasing, setting


Grid = Float[Array, "strokes velocities"] | Float[np.ndarray, "strokes velocities"] | Sequence[Sequence[float]]


def _forces(laws: tuple[AbstractDamper, ...], x: ScalarLike, v: ScalarLike) -> Float[Array, " laws"]:
    """Forces [N] of the laws; laws that differ only in their parameters are computed as one batch."""
    kinds = {(jax.tree.structure(law), tuple(jnp.shape(a) for a in jax.tree.leaves(law))) for law in laws}
    if len(kinds) > 1:
        return jnp.stack([law.force(x, v, law.initial_state()) for law in laws])
    batch = jax.tree.map(lambda *leaves: jnp.stack(leaves), *laws)
    return jax.vmap(lambda law: law.force(x, v, law.initial_state()))(batch)


@final
class StrokeDependent(AbstractStateless):
    """F(x, v): linear interpolation over the stroke x between laws Fₖ(v) given at strokes xₖ.

    Below the first stroke and above the last, the law there is used unchanged. The force is continuous in x, its slope
    changes at each xₖ. If all laws have F v ≥ 0, so has the interpolated one.

    - A factor along the stroke, such as a hydraulic stop: `StrokeDependent((3.0 * law, law), [-0.06, -0.04])`.
    - A table over stroke and velocity: `StrokeDependent.from_grid(stroke, velocity, force)`.
    - Another law in each zone: give the two laws at strokes close together, on both sides of the border.

    Arguments:
        laws: k ≥ 1 laws without states.
        stroke: strictly increasing strokes xₖ [m], shape (k,); a fit does not change them.

    >>> from jaxdamp.dampers import Linear
    >>> law = StrokeDependent((3.0 * Linear(1000.0), Linear(1000.0)), stroke=[-0.06, -0.04])
    >>> [round(float(law.force(x, 0.5, law.initial_state())), 6) for x in (-0.1, -0.05, 0.0)]
    [1500.0, 1000.0, 500.0]
    """

    laws: tuple[AbstractDamper, ...]
    stroke: Vector = setting("m", "strokes of the laws", increasing)

    def traits(self) -> Traits:
        """Linear if the laws are, and stroke-dependent."""
        linear = all(law.traits().linear_in_parameters for law in self.laws)
        return super().traits()._replace(linear_in_parameters=linear)

    def __check_init__(self) -> None:
        check_field_types(self)
        if self.stroke.ndim != 1 or self.stroke.size != len(self.laws) or not self.laws:
            must = "contain one stroke for each law"
            _checks.refuse("stroke", must, f"of shape {self.stroke.shape} for {len(self.laws)} laws")
        for k, law in enumerate(self.laws):
            refuse_states(f"laws[{k}]", law, f"Put it outside: `{type(law).__name__}(StrokeDependent(...), ...)`.")

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m] and velocity v [m/s]."""
        forces = _forces(self.laws, x, v)
        shares = within((x - self.stroke[:-1]) / jnp.diff(self.stroke), 0.0, 1.0)
        return forces[0] + jnp.sum(shares * jnp.diff(forces))

    @classmethod
    def from_grid(
        cls, stroke: VectorLike, velocity: VectorLike, force: Grid, *, allow_active: bool = False
    ) -> "StrokeDependent":
        """Bilinear interpolation of forces [N], shape (strokes, velocities), on a grid, uniform or not.

        Outside the velocities the end slopes continue, outside the strokes the end values are used. Rows whose force
        adds energy to the motion are refused, unless `allow_active` (see `Table`).

        >>> force = [[-400.0, 0.0, 900.0], [-600.0, 0.0, 1300.0]]
        >>> law = StrokeDependent.from_grid([0.0, 0.1], [-1.0, 0.0, 1.0], force)
        >>> [round(float(law.force(x, v, law.initial_state())), 6) for x, v in ((0.05, 0.5), (0.2, -2.0))]
        [550.0, -1200.0]
        """
        rows = as_float(force)
        if rows.shape != (np.size(stroke), np.size(velocity)):
            must = "have one row for each stroke and one column for each velocity"
            expected = f"of shape {rows.shape} for {np.size(stroke)} strokes and {np.size(velocity)} velocities"
            _checks.refuse("force", must, expected)
        return cls(tuple(Table(velocity, row, allow_active=allow_active) for row in rows), stroke)
