"""The fixed-step engine, instants saved.

XLA compiles a loop on a CPU into one function, ten times as fast, if its body touches few bytes: 1 kB unless told
otherwise (`jaxdamp.configure`). A quarter car with most memoryless laws stays below that because the step is written in
small arrays and saves no more than it must.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar
from jaxdamp.simulation.stepper import RoadInput, Stepper, StepState
from jaxdamp.vehicles import System, rest_position


class Saved(NamedTuple):
    """What an engine saves of a run, at the instants that are saved; the states of the laws at the end."""

    motion: Float[Array, "time n"]
    port_force: Float[Array, "time ports"]
    road: Float[Array, "time wheels"]
    road_rate: Float[Array, "time wheels"]
    final_state: list[Float[Array, " _state"]]


@eqx.filter_jit
def exponential_steps(
    system: System,
    heights: Float[Array, "time wheels"],
    dt: Scalar,
    start: Float[Array, " n"] | None = None,
    substeps: int = 1,
    every: int = 1,
) -> Saved:
    """Motion (q, q̇) and element forces at every instant of the road, or every so many-th.

    From `start`, or settled and at rest on the road's first height. Elements that stand on the road take its rate as
    the mean of the slopes before and after an instant.
    """
    form, stepper = system.form, Stepper(system, dt / substeps, apart=False)
    if start is None:
        start = settled(system, heights[0])
    slopes = road_rate(heights, dt)
    ground = RoadInput(heights, None if form.port_road is None else slopes)

    def step(now: StepState, ends: tuple[RoadInput, RoadInput]) -> tuple[StepState, None]:
        return stepper.over(now, *ends, substeps), None

    def saving(now: StepState, ends: tuple[RoadInput, RoadInput]) -> tuple:
        after, _ = step(now, ends) if every == 1 else jax.lax.scan(step, now, ends)
        return after, (after.motion, after.states)

    first = stepper.at_rest(start, jax.tree.map(lambda a: a[0], ground))
    ends = jax.tree.map(lambda a: a[:-1], ground), jax.tree.map(lambda a: a[1:], ground)
    if every > 1:
        ends = jax.tree.map(lambda a: a.reshape(-1, every, *a.shape[1:]), ends)
    last, saved = jax.lax.scan(saving, first, ends)
    motion, states = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), (first.motion, first.states), saved)
    # Saving the states and taking the forces from them here keeps the loop's body small: see the module's docstring.
    heights, slopes = heights[::every], slopes[::every]
    position, rate = jnp.split(motion, 2, axis=1)
    forces = jax.vmap(stepper.ports.force)(form.at_ports(position, heights), form.at_ports(rate, slopes), states)
    return Saved(motion, forces, heights, slopes, stepper.ports.by_port(last.states))


def settled(system: System, road: Float[Array, " wheels"]) -> Float[Array, " n"]:
    """The motion of a vehicle at rest on these heights."""
    position = rest_position(system, road)
    return jnp.concatenate([position, jnp.zeros_like(position)])


def road_rate(heights: Float[Array, "time wheels"], dt: Scalar) -> Float[Array, "time wheels"]:
    """Rate of the heights at the instants [m/s]: the mean of the slopes before and after."""
    steps = jnp.diff(heights, axis=0) / dt
    return jnp.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
