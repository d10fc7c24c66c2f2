"""The fixed-step engine: linear part exact, element forces predicted and corrected.

Over a step the road and the element forces are taken as linear in time (first-order hold); then masses and springs are
carried on exactly by the matrix exponential, however stiff the tyre. The forces at the end of the step are first
predicted from the motion under held forces, then corrected: second order in the step.

XLA compiles a loop on a CPU into one function, ten times as fast, if its body touches few bytes: 1 kB unless told
otherwise. A quarter car with most memoryless laws stays below that because the step is written in small arrays and
saves no more than it must.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, State
from jaxdamp.simulation.propagator import Propagator
from jaxdamp.vehicles import AbstractVehicle


def _times(matrix: Float[Array, "m n"], vector: Float[Array, " n"]) -> Float[Array, " m"]:
    """Matrix @ vector as products and sums, which XLA fuses with what is around them; a `dot` stands alone."""
    return jnp.sum(matrix * vector[None, :], axis=1)


@eqx.filter_jit
def exponential_steps(
    vehicle: AbstractVehicle, heights: Float[Array, "time wheels"], dt: Scalar
) -> tuple[Float[Array, "time n"], Float[Array, "time ports"], list[State]]:
    """Motion (q, q̇) and element forces at every instant of the road, and the laws' states at the end."""
    form, laws = vehicle.port_form(), vehicle.elements()
    start, p = form.at_rest_on(heights[0]), Propagator.over(form, dt)

    def at_ports(x: Array) -> list[tuple[Scalar, Scalar]]:
        deflection, rate = jnp.split(x, 2)
        return list(zip(_times(form.ports, deflection), _times(form.ports, rate), strict=True))

    def respond(x0: Array, x1: Array, states: list[State]) -> tuple[list[State], Array]:
        """States and forces of the elements after a step over which the motion goes from x0 to x1."""
        moves = list(zip(at_ports(x0), at_ports(x1), laws, states, strict=True))
        after = [law.advance(*old, *new, state, dt) for old, new, law, state in moves]
        forces = [law.force(*new, state) for (_, new, law, _), state in zip(moves, after, strict=True)]
        return after, jnp.stack(forces)

    def step(now: tuple[Array, list[State], Array], road: tuple[Array, Array]) -> tuple:
        x, states, force = now
        height, rise = road
        held = _times(p.road_held, height) + _times(p.road_ramp, rise) + _times(p.phi, x)
        held = held + _times(p.force_held, force)  # last, as the force is known last
        _, predicted = respond(x, held, states)
        after = held + _times(p.force_ramp, predicted - force)
        states, force = respond(x, after, states)
        return (after, states, force), (after, states)

    first = start, [law.initial_state() for law in laws]
    at_rest = [law.force(*place, state) for law, place, state in zip(laws, at_ports(start), first[1], strict=True)]
    now, saved = jax.lax.scan(step, (*first, jnp.stack(at_rest)), (heights[:-1], jnp.diff(heights, axis=0)))
    motion, states = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, saved)
    # Saving the states and taking the forces from them here keeps the loop's body small: see the module's docstring.
    deflections, rates = (part @ form.ports.T for part in jnp.split(motion, 2, axis=1))
    saved_forces = [jax.vmap(law.force)(deflections[:, i], rates[:, i], states[i]) for i, law in enumerate(laws)]
    return motion, jnp.stack(saved_forces, axis=1), now[1]
