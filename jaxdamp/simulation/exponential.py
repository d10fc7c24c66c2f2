"""The fixed-step engine: linear part exact, element forces predicted and corrected.

Over a step the road and the element forces are taken as linear in time (first-order hold); then masses and springs are
carried on exactly by the matrix exponential, however stiff the tyre. The forces at the end of the step are first
predicted from the motion under held forces, then corrected: second order in the step.
"""

from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, State
from jaxdamp.dampers import AbstractDamper
from jaxdamp.vehicles import AbstractVehicle, PortForm


@final
class Propagator(eqx.Module):
    """x₁ = Φ x₀ + H₀ f₀ + H₁ (f₁ − f₀) + R₀ z₀ + R₁ (z₁ − z₀), exact for f and z linear over the step."""

    phi: Float[Array, "n n"]
    force_held: Float[Array, "n ports"]
    force_ramp: Float[Array, "n ports"]
    road_held: Float[Array, "n wheels"]
    road_ramp: Float[Array, "n wheels"]


def propagator(form: PortForm, dt: Scalar) -> Propagator:
    """The step matrices, from one exponential of the matrix augmented by its inputs."""
    a = form.state_matrix()
    inputs = jnp.concatenate([form.port_input(), form.road_input(), form.road_rate_input()], axis=1)
    n, m = inputs.shape
    ports, wheels = form.ports.shape[0], form.road_stiffness.shape[1]
    big = jnp.zeros((n + 2 * m, n + 2 * m), a.dtype)
    big = big.at[:n, :n].set(a * dt).at[:n, n : n + m].set(inputs * dt).at[n : n + m, n + m :].set(jnp.eye(m))
    exponential = jax.scipy.linalg.expm(big)
    held, ramp = exponential[:n, n : n + m], exponential[:n, n + m :]
    heights, rates = slice(ports, ports + wheels), slice(ports + wheels, None)
    road_ramp = ramp[:, heights] + held[:, rates] / dt
    return Propagator(exponential[:n, :n], held[:, :ports], ramp[:, :ports], held[:, heights], road_ramp)


def _affine(matrix: Array, vector: list[Scalar]) -> list[Scalar]:
    """matrix @ vector, written out: on small systems XLA fuses the scalars of a batch into one kernel."""
    return [sum(matrix[i, j] * x for j, x in enumerate(vector)) for i in range(matrix.shape[0])]  # type: ignore[misc]


def _forces(laws: tuple[AbstractDamper, ...], moves: list[tuple], states: list[State], dt: Scalar) -> tuple:
    """States and forces at the end of a step, from (x₀, v₀, x₁, v₁) at each port."""
    after = [law.advance(*move, state, dt) for law, move, state in zip(laws, moves, states, strict=True)]
    force = [law.force(move[2], move[3], state) for law, move, state in zip(laws, moves, after, strict=True)]
    return after, force


@eqx.filter_jit
def exponential_steps(
    vehicle: AbstractVehicle, heights: Float[Array, "time wheels"], dt: Scalar
) -> tuple[Float[Array, "time n"], Float[Array, "time ports"], list[State]]:
    """Motion (q, q̇) and element forces at every instant of the road, and the laws' states at the end."""
    form, laws = vehicle.port_form(), vehicle.elements()
    p = propagator(form, dt)
    q = form.mass.shape[0]

    def at_ports(x: list[Scalar]) -> list[tuple[Scalar, Scalar]]:
        return list(zip(_affine(form.ports, x[:q]), _affine(form.ports, x[q:]), strict=True))

    def step(carry: tuple, road: tuple[Array, Array]) -> tuple[tuple, tuple]:
        x, here, states, force = carry
        z0, dz = list(road[0]), list(road[1])
        parts = zip(
            _affine(p.phi, x),
            _affine(p.force_held, force),
            _affine(p.road_held, z0),
            _affine(p.road_ramp, dz),
            strict=True,
        )
        predicted = [sum(part) for part in parts]
        moves = [(*old, *new) for old, new in zip(here, at_ports(predicted), strict=True)]
        _, guess = _forces(laws, moves, states, dt)
        change = [new - old for new, old in zip(guess, force, strict=True)]
        x = [a + b for a, b in zip(predicted, _affine(p.force_ramp, change), strict=True)]
        there = at_ports(x)
        moves = [(*old, *new) for old, new in zip(here, there, strict=True)]
        states, force = _forces(laws, moves, states, dt)
        return (x, there, states, force), (jnp.stack(x), jnp.stack(force))

    start = jnp.concatenate([form.settled() @ heights[0], jnp.zeros(q, heights.dtype)])
    x = list(start)
    here = at_ports(x)
    states = [law.initial_state() for law in laws]
    force = [law.force(*place, state) for law, place, state in zip(laws, here, states, strict=True)]
    first = (start, jnp.stack(force))
    carry, saved = jax.lax.scan(step, (x, here, states, force), (heights[:-1], jnp.diff(heights, axis=0)))
    motion, forces = (jnp.concatenate([a[None], b]) for a, b in zip(first, saved, strict=True))
    return motion, forces, carry[2]
