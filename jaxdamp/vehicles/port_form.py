"""The one form of all vehicles: linear masses and springs, and nonlinear elements at ports.

    M q̈ = −K q − C q̇ + K_r z_r + C_r ż_r − Pᵀ f,    fᵢ = element i (deflection Pᵢ q, rate Pᵢ q̇, its states)

The coordinates q [m, rad] are measured from static equilibrium, z up. Every spring and every port is a row R of
geometry, so that forces return through the same row, −Rᵀ F, and no sign is written by hand.
"""

from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar


@final
class Connection(eqx.Module):
    """A linear spring, with a linear dashpot beside it, between points of the vehicle or to the road.

    Its extension is `row` · q − `road` · z_r [m].
    """

    row: Float[Array, " q"]
    road: Float[Array, " wheels"]
    stiffness: Scalar
    damping: Scalar


@final
class PortForm(eqx.Module):
    """The matrices of a vehicle, in SI units; q coordinates, `wheels` road inputs, `ports` nonlinear elements.

    The ground matrices close the energy: the springs hold ½ qᵀK q − qᵀK_r z_r + ½ z_rᵀK_g z_r.
    """

    mass: Float[Array, "q q"]
    stiffness: Float[Array, "q q"]
    damping: Float[Array, "q q"]
    road_stiffness: Float[Array, "q wheels"]
    road_damping: Float[Array, "q wheels"]
    ground_stiffness: Float[Array, "wheels wheels"]
    ground_damping: Float[Array, "wheels wheels"]
    ports: Float[Array, "ports q"]

    def state_matrix(self) -> Float[Array, "n n"]:
        """A of ẋ = A x + …, x = (q, q̇)."""
        n = self.mass.shape[0]
        lower = -jnp.linalg.solve(self.mass, jnp.concatenate([self.stiffness, self.damping], axis=1))
        upper = jnp.concatenate([jnp.zeros((n, n), lower.dtype), jnp.eye(n, dtype=lower.dtype)], axis=1)
        return jnp.concatenate([upper, lower])

    def _driven(self, forces: Float[Array, "q inputs"]) -> Float[Array, "n inputs"]:
        rates = jnp.linalg.solve(self.mass, forces)
        return jnp.concatenate([jnp.zeros_like(rates), rates])

    def port_input(self) -> Float[Array, "n ports"]:
        """B_f: how the element forces act on ẋ."""
        return self._driven(-self.ports.T)

    def road_input(self) -> Float[Array, "n wheels"]:
        """B_r: how the road heights act on ẋ."""
        return self._driven(self.road_stiffness)

    def road_rate_input(self) -> Float[Array, "n wheels"]:
        """How the rates of the road heights act on ẋ."""
        return self._driven(self.road_damping)

    def settled(self) -> Float[Array, "q wheels"]:
        """Coordinates of the vehicle at rest on unit road heights, K⁻¹ K_r."""
        return jnp.linalg.solve(self.stiffness, self.road_stiffness)

    def at_rest_on(self, heights: Float[Array, " tracks"]) -> Float[Array, " n"]:
        """The motion (q, q̇) of the vehicle settled and at rest on the road; refuses a road of other tracks."""
        wheels = self.road_stiffness.shape[1]
        if heights.shape[0] != wheels:
            must = f"have a track for each of {wheels} wheels"
            _checks.refuse("road", must, f"a road of {heights.shape[0]} track(s)")
        position = self.settled() @ heights
        return jnp.concatenate([position, jnp.zeros_like(position)])


def assemble(mass: Float[Array, "q q"], connections: Sequence[Connection], ports: Float[Array, "ports q"]) -> PortForm:
    """Sum the connections into matrices: K = Σ Rᵀ k R, K_r = Σ Rᵀ k S, K_g = Σ Sᵀ k S."""
    rows = jnp.stack([c.row for c in connections])
    road = jnp.stack([c.road for c in connections])
    springs = rows.T * jnp.stack([c.stiffness for c in connections])[None, :]
    dashpots = rows.T * jnp.stack([c.damping for c in connections])[None, :]
    ground_springs = road.T * jnp.stack([c.stiffness for c in connections])[None, :]
    ground_dashpots = road.T * jnp.stack([c.damping for c in connections])[None, :]
    return PortForm(
        mass,
        springs @ rows,
        dashpots @ rows,
        springs @ road,
        dashpots @ road,
        ground_springs @ road,
        ground_dashpots @ road,
        ports,
    )
