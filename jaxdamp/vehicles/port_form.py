"""The one form of all vehicles: linear masses and springs, and nonlinear elements at ports.

    M q̈ = −K q − C q̇ + K_r z_r + C_r ż_r − Pᵀ f,    fᵢ = element i (deflection eᵢ = Pᵢ q − Sᵢ z_r, rate ėᵢ, its states)

The coordinates q [m, rad] are measured from the static equilibrium on the linear springs, z up. Every spring and every
port is a row R of geometry, so that forces return through the same row, −Rᵀ F, and no sign is written by hand.
"""

from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

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
    port_road: Float[Array, "ports wheels"] | None = None  # S; None where no element stands on the road

    def first_order(self) -> "FirstOrder":
        """The matrices of ẋ = A x + B_f f + B_r z_r + B_d ż_r, x = (q, q̇), from one system with the mass matrix."""
        n, ports, wheels = self.mass.shape[0], self.ports.shape[0], self.road_stiffness.shape[1]
        forces = [-self.stiffness, -self.damping, -self.ports.T, self.road_stiffness, self.road_damping]
        rates = jnp.linalg.solve(self.mass, jnp.concatenate(forces, axis=1))
        eye = jnp.eye(n, 2 * n + ports + 2 * wheels, n, dtype=rates.dtype)  # the upper half: q̇ is q̇
        whole = jnp.concatenate([eye, rates])
        ends = [2 * n, 2 * n + ports, 2 * n + ports + wheels]
        return FirstOrder(*jnp.split(whole, ends, axis=1))

    def at_ports(
        self, coordinates: Float[Array, "*time q"], road: Float[Array, "*time wheels"]
    ) -> Float[Array, "*time ports"]:
        """Deflections of the elements from coordinates and road heights; their rates from the rates of both."""
        deflections = coordinates @ self.ports.T
        return deflections if self.port_road is None else deflections - road @ self.port_road.T


@final
class FirstOrder(eqx.Module):
    """ẋ = A x + B_f f + B_r z_r + B_d ż_r of the motion x = (q, q̇)."""

    state_matrix: Float[Array, "n n"]
    port_input: Float[Array, "n ports"]
    road_input: Float[Array, "n wheels"]
    road_rate_input: Float[Array, "n wheels"]


def assemble(
    mass: Float[Array, "q q"],
    connections: Sequence[Connection],
    ports: Float[Array, "ports q"],
    port_road: Float[Array, "ports wheels"] | None = None,
) -> PortForm:
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
        port_road,
    )
