"""The common form of all vehicles: linear masses and springs, and nonlinear laws at ports.

    M q̈ = −K q − C q̇ + K_r z_r + C_r ż_r − Pᵀ f,    fᵢ = element i (deflection eᵢ = Pᵢ q − Sᵢ z_r, rate ėᵢ, its
    states)

The coordinates q [m, rad] are measured from the static equilibrium of the linear springs, z up. Every spring and every
port is a row R of the geometry; its force acts through the same row, −Rᵀ F, so no sign is written by hand.
"""

from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._matrices import solve
from jaxdamp._vectors import Matrix, Vector, plus, rows, times


@final
class PortForm(eqx.Module):
    """The matrices of a vehicle, in SI units; q coordinates, `wheels` road inputs, `ports` nonlinear elements.

    The ground matrices are for the energy balance: the springs store ½ qᵀK q − qᵀK_r z_r + ½ z_rᵀK_g z_r.

    Attributes:
        mass: M, shape (q, q).
        stiffness: K, shape (q, q).
        damping: C, shape (q, q).
        road_stiffness: K_r, shape (q, wheels).
        road_damping: C_r, shape (q, wheels).
        ground_stiffness: K_g, shape (wheels, wheels).
        ground_damping: C_g, shape (wheels, wheels).
        ports: P, extension of each element from the coordinates, shape (ports, q).
        port_road: S, extension of each element from the heights of the road, shape (ports, wheels); None if no element
            is at the road.
    """

    mass: Float[Array, "q q"]
    stiffness: Float[Array, "q q"]
    damping: Float[Array, "q q"]
    road_stiffness: Float[Array, "q wheels"]
    road_damping: Float[Array, "q wheels"]
    ground_stiffness: Float[Array, "wheels wheels"]
    ground_damping: Float[Array, "wheels wheels"]
    ports: Float[Array, "ports q"]
    port_road: Float[Array, "ports wheels"] | None = None  # S; None if no element is at the road

    def first_order(self) -> "LinearMap":
        """ẋ = A x + B_f f + B_r z_r + B_d ż_r of the motion x = (q, q̇), by one solution with the mass matrix."""
        n, ports, wheels = self.mass.shape[0], self.ports.shape[0], self.road_stiffness.shape[1]
        forces = [-self.stiffness, -self.damping, -self.ports.T, self.road_stiffness, self.road_damping]
        rates = solve(self.mass, jnp.concatenate(forces, axis=1))
        eye = jnp.eye(n, 2 * n + ports + 2 * wheels, n, dtype=rates.dtype)  # the upper half: q̇ is q̇
        whole = jnp.concatenate([eye, rates])
        ends = [2 * n, 2 * n + ports, 2 * n + ports + wheels]
        return LinearMap(*jnp.split(whole, ends, axis=1))

    def at_ports(
        self, coordinates: Float[Array, "*time q"], road: Float[Array, "*time wheels"]
    ) -> Float[Array, "*time ports"]:
        """Deflections of the elements from coordinates and road heights; their rates from the rates of both."""
        deflections = coordinates @ self.ports.T
        return deflections if self.port_road is None else deflections - road @ self.port_road.T


@final
class LinearMap(eqx.Module):
    """y = X x + F f + R z + S ż of the motion x = (q, q̇), the forces f and the heights z, matrices or scalars.

    Attributes:
        motion: X, from the motion.
        force: F, from the forces [N] of the elements.
        road: R, from the heights of the road.
        road_rate: S, from their rates.
    """

    motion: Matrix
    force: Matrix
    road: Matrix
    road_rate: Matrix

    def __call__(self, motion: Vector, force: Vector, road: Vector, road_rate: Vector | None) -> Vector:
        """Its value. The contribution of the road is summed first, since it is the same for all cars of a batch.

        Without a road rate, the rate is zero.
        """
        of_road = times(self.road, road)
        if road_rate is not None:
            of_road = plus(of_road, times(self.road_rate, road_rate))
        return plus(of_road, times(self.motion, motion), times(self.force, force))

    def of(self, numbers: Sequence[int]) -> "LinearMap":
        """Some of its rows."""
        chosen = np.array(numbers, dtype=int)
        return LinearMap(self.motion[chosen], self.force[chosen], self.road[chosen], self.road_rate[chosen])

    def scalars(self) -> "LinearMap":
        """The same with rows of scalars instead of matrices."""
        return LinearMap(*map(rows, (self.motion, self.force, self.road, self.road_rate)))


def sum_springs(
    mass: Float[Array, "q q"],
    links: Float[Array, "links q"],
    road: Float[Array, "links wheels"],
    stiffness: Float[Array, " links"],
    damping: Float[Array, " links"],
    ports: Float[Array, "ports q"],
    port_road: Float[Array, "ports wheels"] | None = None,
) -> PortForm:
    """The form of springs and dashpots whose extensions are R q − S z_r: K = Σ Rᵀ k R, K_r = Σ Rᵀ k S, K_g = Σ Sᵀ k S.

    Arguments:
        mass: M.
        links: R, a row for each spring and its parallel dashpot.
        road: S.
        stiffness: k [N/m].
        damping: c [N s/m].
        ports: rows of the elements.
        port_road: S of the elements; None if none is at the road.
    """
    springs, dashpots = links.T * stiffness[None, :], links.T * damping[None, :]
    ground_springs, ground_dashpots = road.T * stiffness[None, :], road.T * damping[None, :]
    return PortForm(
        mass,
        springs @ links,
        dashpots @ links,
        springs @ road,
        dashpots @ road,
        ground_springs @ road,
        ground_dashpots @ road,
        ports,
        port_road,
    )
