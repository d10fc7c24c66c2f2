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
from jaxdamp.vehicles import AbstractVehicle, Ports, rest_position
from jaxdamp.vehicles.ports import States


def _times(matrix: Float[Array, "m n"], vector: Float[Array, " n"]) -> Float[Array, " m"]:
    """Matrix @ vector as products and sums, which XLA fuses with what is around them; a `dot` stands alone."""
    return jnp.sum(matrix * vector[None, :], axis=1)


@eqx.filter_jit
def exponential_steps(
    vehicle: AbstractVehicle,
    heights: Float[Array, "time wheels"],
    dt: Scalar,
    start: Float[Array, " n"] | None = None,
) -> tuple[Float[Array, "time n"], Float[Array, "time ports"], list[State]]:
    """Motion (q, q̇) and element forces at every instant of the road, and the laws' states at the end.

    From `start`, or settled and at rest on the road's first height. Elements that stand on the road take its rate as
    the mean of the slopes before and after an instant.
    """
    form, laws = vehicle.port_form(), vehicle.elements()
    ports, p = Ports(laws), Propagator.over(form, dt)
    if start is None:
        position = rest_position(form, laws, heights[0])
        start = jnp.concatenate([position, jnp.zeros_like(position)])
    slopes = None if form.port_road is None else road_rate(heights, dt)

    def at_ports(x: Array, height: Array, slope: Array | None) -> tuple[Array, Array]:
        deflection, rate = (_times(form.ports, part) for part in jnp.split(x, 2))
        if form.port_road is None or slope is None:
            return deflection, rate
        return deflection - _times(form.port_road, height), rate - _times(form.port_road, slope)

    def respond(old: tuple[Array, Array], new: tuple[Array, Array], states: States) -> tuple[States, Array]:
        """States and forces of the elements after a step over which their motion goes from old to new."""
        after = ports.advance(*old, *new, states, dt)
        return after, ports.force(*new, after)

    def step(now: tuple[Array, States, Array], road: tuple) -> tuple:
        x, states, force = now
        height, rise, slope, next_slope = road
        held = _times(p.road_held, height) + _times(p.road_ramp, rise) + _times(p.phi, x)
        held = held + _times(p.force_held, force)  # last, as the force is known last
        old = at_ports(x, height, slope)
        _, predicted = respond(old, at_ports(held, height + rise, next_slope), states)
        after = held + _times(p.force_ramp, predicted - force)
        states, force = respond(old, at_ports(after, height + rise, next_slope), states)
        return (after, states, force), (after, states)

    first = start, ports.initial()
    at_rest = ports.force(*at_ports(start, heights[0], None if slopes is None else slopes[0]), first[1])
    ends = (None, None) if slopes is None else (slopes[:-1], slopes[1:])
    now, saved = jax.lax.scan(step, (*first, at_rest), (heights[:-1], jnp.diff(heights, axis=0), *ends))
    motion, states = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, saved)
    # Saving the states and taking the forces from them here keeps the loop's body small: see the module's docstring.
    position, rate = jnp.split(motion, 2, axis=1)
    still = jnp.zeros_like(heights) if slopes is None else slopes
    forces = jax.vmap(ports.force)(form.at_ports(position, heights), form.at_ports(rate, still), states)
    return motion, forces, ports.by_port(now[1])


def road_rate(heights: Float[Array, "time wheels"], dt: Scalar) -> Float[Array, "time wheels"]:
    """Rate of the heights at the instants [m/s]: the mean of the slopes before and after."""
    steps = jnp.diff(heights, axis=0) / dt
    return jnp.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
