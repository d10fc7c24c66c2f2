"""The adaptive engine: the same equations handed to diffrax, as reference and for stiff laws."""

from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, Signal
from jaxdamp.simulation.exponential import Saved, road_rate
from jaxdamp.vehicles import AbstractVehicle, Ports, States, rest_position


STEPS_PER_INSTANT = 100  # on average: more are a law too fast for the solver, and would take for ever


@eqx.filter_jit
def adaptive_steps(
    vehicle: AbstractVehicle,
    time: Signal,
    heights: Float[Array, "time wheels"],
    solver: diffrax.AbstractSolver,
    rtol: float,
    atol: float,
    start: Float[Array, " n"] | None = None,
    every: int = 1,
) -> tuple[Saved, diffrax.RESULTS]:
    """The run, and how it ended, at every so many-th instant of the road, linear between them.

    Steps end where the slope of the road changes.
    """
    form, laws = vehicle.port_form(), vehicle.elements()
    ports = Ports(laws)
    q = form.mass.shape[0]
    system = form.first_order()
    dt = (time[-1] - time[0]) / (time.size - 1)
    if start is None:
        position = rest_position(form, laws, heights[0])
        start = jnp.concatenate([position, jnp.zeros_like(position)])

    def road(t: Scalar) -> tuple[Array, Array]:
        index = jnp.clip(jnp.floor((t - time[0]) / dt).astype(int), 0, time.size - 2)
        slope = (heights[index + 1] - heights[index]) / dt
        return heights[index] + slope * (t - time[index]), slope

    def at_ports(x: Array, height: Array, slope: Array) -> tuple[Array, Array]:
        return form.at_ports(x[:q], height), form.at_ports(x[q:], slope)

    def field(t: Any, y: Any, args: None) -> tuple[Array, States]:
        del args
        x, states = y
        height, slope = road(t)
        place = at_ports(x, height, slope)
        driven = system.road_input @ height + system.road_rate_input @ slope
        motion = system.state_matrix @ x + system.port_input @ ports.force(*place, states) + driven
        return motion, ports.state_rate(*place, states)

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        solver,
        time[0],
        time[-1],
        0.1 * dt,
        (start, ports.initial()),
        saveat=diffrax.SaveAt(ts=time[::every]),
        stepsize_controller=diffrax.ClipStepSizeController(
            diffrax.PIDController(rtol=rtol, atol=atol), jump_ts=time[1:-1]
        ),
        max_steps=STEPS_PER_INSTANT * time.size,
        adjoint=diffrax.ForwardMode(),
        throw=False,
    )
    assert solution.ys is not None
    motion, states = solution.ys
    slopes, heights = road_rate(heights, dt)[::every], heights[::every]
    forces = jax.vmap(ports.force)(*jax.vmap(at_ports)(motion, heights, slopes), states)
    return Saved(motion, forces, heights, slopes, ports.by_port([s[-1] for s in states])), solution.result
