"""The common form of all vehicles: linear masses and springs, and nonlinear laws at ports.

    M q̈ = −K q − C q̇ + K_r z_r + C_r ż_r − Pᵀ f,    fᵢ = element i (deflection eᵢ = Pᵢ q − Sᵢ z_r, rate ėᵢ, its
    states)

The coordinates q [m, rad] are measured from the static equilibrium of the linear springs, z up. Every spring and every
port is a row R of the geometry; its force acts through the same row, −Rᵀ F, so no sign is written by hand.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeAlias, TypeVar, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp._matrices import solve
from jaxdamp._types import Scalar, State
from jaxdamp._vectors import Matrix, MemoryLayout, SmallVector, plus, rows, times
from jaxdamp.dampers import AbstractDamper, without_fitted_ranges


# One array, or a tuple of scalars, as `MemoryLayout` says.
if TYPE_CHECKING:
    AtPorts: TypeAlias = PyTree
else:
    AtPorts = Float[Array, " ports"] | tuple[Scalar, ...]
Kind = TypeVar("Kind", Array, np.ndarray)
States = list[Array]  # by group: (states,) of a law alone, (laws, states) of a batch
Earlier = tuple[list[Array | None], list[Array | None]]  # one and two steps before, of groups that are extrapolated


def _alike(one: AbstractDamper, other: AbstractDamper) -> bool:
    """Whether two laws differ only in the values of their arrays."""
    if jax.tree.structure(one) != jax.tree.structure(other):
        return False
    pairs = list(zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True))
    arrays = [eqx.is_array(a) and eqx.is_array(b) for a, b in pairs]
    same_shape = [
        jnp.shape(a) == jnp.shape(b) if array else a == b for (a, b), array in zip(pairs, arrays, strict=True)
    ]
    return any(arrays) and all(same_shape)


@final
class Ports(eqx.Module):
    """Forces, states and steps of all elements of a vehicle, in the order of its ports.

    Laws of the same kind are stacked and computed as one batch: four dampers of a car cost little more than one, and
    are compiled once. A single law is called directly.

    Deflections, rates and forces are one array or a tuple of scalars, as the layout says.

    Arguments:
        laws: the law at each port.
        layout: one array; with scalars or lanes every law is called by itself.
    """

    laws: tuple[AbstractDamper, ...]  # one of each kind, its arrays stacked where there are several
    members: tuple[tuple[int, ...], ...] = eqx.field(static=True)  # the ports of each kind
    smooth: tuple[bool, ...] = eqx.field(static=True)  # whether the states of each kind may be extrapolated

    def __init__(self, laws: Sequence[AbstractDamper], layout: MemoryLayout = MemoryLayout.ARRAY) -> None:
        laws = [without_fitted_ranges(law) for law in laws]
        kinds: list[list[int]] = []
        for i, law in enumerate(laws):
            alike = (kind for kind in kinds if layout is MemoryLayout.ARRAY and _alike(laws[kind[0]], law))
            same = next(alike, None)
            if same is None:
                kinds.append([i])
            else:
                same.append(i)
        self.members = tuple(tuple(kind) for kind in kinds)
        self.smooth = tuple(laws[kind[0]].traits().extrapolable_states for kind in kinds)
        self.laws = tuple(
            laws[kind[0]] if len(kind) == 1 else jax.tree.map(_stacked, *[laws[i] for i in kind]) for kind in kinds
        )

    def initial(self) -> States:
        """The states of elements that nothing has moved."""
        return self._each(lambda law: law.initial_state(), [])

    def at_rest(self, x: AtPorts) -> States:
        """The states of elements that are held at these deflections [m]."""
        return self._each(lambda law, x: law.state_at_rest(x), [x])

    def force(self, x: AtPorts, v: AtPorts, states: States) -> AtPorts:
        """Forces [N] at deflections [m] and rates [m/s]."""
        forces = self._each(lambda law, x, v, state: law.force(x, v, state), [x, v], states)
        if isinstance(x, tuple):
            return tuple(forces)
        flat = [force if len(kind) > 1 else force[None] for force, kind in zip(forces, self.members, strict=True)]
        if not flat:
            return jnp.zeros_like(x)
        order = np.argsort([port for kind in self.members for port in kind])
        joined = flat[0] if len(flat) == 1 else jnp.concatenate(flat)
        return joined if np.all(order == np.arange(order.size)) else joined[order]

    def state_rate(self, x: AtPorts, v: AtPorts, states: States) -> States:
        """Time derivatives of the states [1/s]."""
        return self._each(lambda law, x, v, state: law.state_rate(x, v, state), [x, v], states)

    def advance(self, x0: AtPorts, v0: AtPorts, x1: AtPorts, v1: AtPorts, states: States, dt: Scalar) -> States:
        """States after a step dt [s] over which deflections and rates go from (x0, v0) to (x1, v1)."""

        def step(law: AbstractDamper, x0: Scalar, v0: Scalar, x1: Scalar, v1: Scalar, state: State) -> State:
            return law.advance(x0, v0, x1, v1, state, dt)

        return self._each(step, [x0, v0, x1, v1], states)

    def first_earlier(self, states: States) -> Earlier:
        """The earlier states at the start of a run: equal to the initial ones."""
        extrapolated = [state if smooth else None for smooth, state in zip(self.smooth, states, strict=True)]
        return extrapolated, extrapolated

    def next_earlier(self, states: States, earlier: Earlier) -> Earlier:
        """The earlier states for the next step."""
        return [None if old is None else state for old, state in zip(earlier[0], states, strict=True)], earlier[0]

    def predict(
        self, x0: AtPorts, v0: AtPorts, x1: AtPorts, v1: AtPorts, states: States, earlier: Earlier, dt: Scalar
    ) -> States:
        """An approximation of `advance`, third order: smooth states are extrapolated, which costs almost nothing."""

        def step(law: AbstractDamper, *arguments: PyTree) -> State:
            x0, v0, x1, v1, state, before, two_before = arguments
            return law.predict(x0, v0, x1, v1, state, dt) if before is None else 3.0 * (state - before) + two_before

        return self._each(step, [x0, v0, x1, v1], states, *earlier)

    def by_port(self, states: States) -> list[Float[Array, " _state"]]:
        """The states of each element, in the order of the ports."""
        of_port = {}
        for kind, state in zip(self.members, states, strict=True):
            of_port |= {port: state if len(kind) == 1 else state[i] for i, port in enumerate(kind)}
        return [of_port[port] for port in sorted(of_port)]

    def stiffness_and_damping(self, x: Float[Array, " ports"]) -> tuple[Array, Array]:
        """Slopes dF/dx [N/m] of the forces at rest at the deflections x, and ∂F/∂v [N s/m] with the states there."""
        states, still, one = self.at_rest(x), jnp.zeros_like(x), jnp.ones_like(x)
        _, stiffness = jax.jvp(lambda x: self.force(x, still, self.at_rest(x)), (x,), (one,))
        _, damping = jax.jvp(lambda v: self.force(x, v, states), (still,), (one,))
        return stiffness, damping

    def _each(
        self, call: Callable[..., Array], vectors: Sequence[AtPorts], *states: Sequence[Array | None]
    ) -> list[Array]:
        """The call for every law, as one batch for each kind."""
        results = []
        for i, (law, kind) in enumerate(zip(self.laws, self.members, strict=True)):
            state = [some[i] for some in states]
            if len(kind) == 1:
                results.append(call(law, *[vector[kind[0]] for vector in vectors], *state))
                continue
            arrays, static = eqx.partition(law, eqx.is_array)
            picked = [_pick(vector, kind) for vector in vectors]
            results.append(
                jax.vmap(lambda a, *more, static=static: call(eqx.combine(a, static), *more))(arrays, *picked, *state)
            )
        return results


def _stacked(*leaves: PyTree) -> PyTree:
    return jnp.stack(leaves) if eqx.is_array(leaves[0]) else leaves[0]


def _pick(vector: AtPorts, kind: tuple[int, ...]) -> Float[Array, " laws"]:
    """The entries of some ports, as a slice if they are consecutive: a gather would cost more in a loop."""
    first, last = kind[0], kind[-1]
    return vector[first : last + 1] if len(kind) == last - first + 1 else vector[np.array(kind)]


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

    def at_ports(self, coordinates: Kind, road: Kind) -> Kind:
        """Deflections of the elements from coordinates and road heights; their rates from the rates of both.

        Arguments:
            coordinates: shape (*time, q).
            road: shape (*time, wheels).

        Returns:
            Shape (*time, ports).
        """
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

    def __call__(
        self, motion: SmallVector, force: SmallVector, road: SmallVector, road_rate: SmallVector | None
    ) -> SmallVector:
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
