"""The fixed-step engine, every instant saved.

XLA compiles a loop on a CPU into one function, ten times as fast, if its body touches few bytes: 1 kB unless told
otherwise (`jaxdamp.configure`). A quarter car with most memoryless laws stays below that because the step is written in
small arrays and saves no more than it must.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar
from jaxdamp.simulation.stepper import Ground, Now, Stepper
from jaxdamp.vehicles import AbstractVehicle, rest_position


@eqx.filter_jit
def exponential_steps(
    vehicle: AbstractVehicle,
    heights: Float[Array, "time wheels"],
    dt: Scalar,
    start: Float[Array, " n"] | None = None,
    substeps: int = 1,
) -> tuple[Float[Array, "time n"], Float[Array, "time ports"], list[Float[Array, " _state"]]]:
    """Motion (q, q̇) and element forces at every instant of the road, and the laws' states at the end.

    From `start`, or settled and at rest on the road's first height. Elements that stand on the road take its rate as
    the mean of the slopes before and after an instant.
    """
    form = vehicle.port_form()
    stepper = Stepper(vehicle, dt / substeps, apart=False)
    if start is None:
        start = settled(vehicle, heights[0])
    slopes = None if form.port_road is None else road_rate(heights, dt)

    def step(now: Now, road: tuple) -> tuple:
        after = stepper.over(now, Ground(road[0], road[1]), Ground(road[2], road[3]), substeps)
        return after, (after.motion, after.states)

    ground = Ground(heights, slopes)
    first = stepper.at_rest(start, jax.tree.map(lambda a: a[0], ground))
    ends = *jax.tree.map(lambda a: a[:-1], ground), *jax.tree.map(lambda a: a[1:], ground)
    last, saved = jax.lax.scan(step, first, ends)
    motion, states = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), (first.motion, first.states), saved)
    # Saving the states and taking the forces from them here keeps the loop's body small: see the module's docstring.
    position, rate = jnp.split(motion, 2, axis=1)
    still = jnp.zeros_like(heights) if slopes is None else slopes
    forces = jax.vmap(stepper.ports.force)(form.at_ports(position, heights), form.at_ports(rate, still), states)
    return motion, forces, stepper.ports.by_port(last.states)


def settled(vehicle: AbstractVehicle, road: Float[Array, " wheels"]) -> Float[Array, " n"]:
    """The motion of a vehicle at rest on these heights."""
    position = rest_position(vehicle.port_form(), vehicle.elements(), road)
    return jnp.concatenate([position, jnp.zeros_like(position)])


def road_rate(heights: Float[Array, "time wheels"], dt: Scalar) -> Float[Array, "time wheels"]:
    """Rate of the heights at the instants [m/s]: the mean of the slopes before and after."""
    steps = jnp.diff(heights, axis=0) / dt
    return jnp.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
