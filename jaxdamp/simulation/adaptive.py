"""The adaptive engine: the same equations handed to diffrax, as reference and for stiff laws."""

from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, Signal, State
from jaxdamp.vehicles import AbstractVehicle


STEPS_PER_INSTANT = 100  # on average: more are a law too fast for the solver, and would take for ever


@eqx.filter_jit
def adaptive_steps(
    vehicle: AbstractVehicle,
    time: Signal,
    heights: Float[Array, "time wheels"],
    solver: diffrax.AbstractSolver,
    rtol: float,
    atol: float,
) -> tuple[Float[Array, "time n"], Float[Array, "time ports"], list[State], Any]:
    """Motion and forces at the instants of the road, linear between them; steps end where its slope changes."""
    form, laws = vehicle.port_form(), vehicle.elements()
    q = form.mass.shape[0]
    a, b_f = form.state_matrix(), form.port_input()
    b_r, b_d = form.road_input(), form.road_rate_input()
    dt = (time[-1] - time[0]) / (time.size - 1)

    def road(t: Scalar) -> tuple[Array, Array]:
        index = jnp.clip(jnp.floor((t - time[0]) / dt).astype(int), 0, time.size - 2)
        slope = (heights[index + 1] - heights[index]) / dt
        return heights[index] + slope * (t - time[index]), slope

    def forces(x: Array, states: list[State]) -> Array:
        deflection, rate = form.ports @ x[:q], form.ports @ x[q:]
        return jnp.stack([law.force(deflection[i], rate[i], states[i]) for i, law in enumerate(laws)])

    def field(t: Any, y: Any, args: None) -> tuple[Array, list[State]]:
        del args
        x, states = y
        height, slope = road(t)
        deflection, rate = form.ports @ x[:q], form.ports @ x[q:]
        inner = [law.state_rate(deflection[i], rate[i], states[i]) for i, law in enumerate(laws)]
        return a @ x + b_f @ forces(x, states) + b_r @ height + b_d @ slope, inner

    start = form.at_rest_on(heights[0])
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        solver,
        time[0],
        time[-1],
        0.1 * dt,
        (start, [law.initial_state() for law in laws]),
        saveat=diffrax.SaveAt(ts=time),
        stepsize_controller=diffrax.ClipStepSizeController(
            diffrax.PIDController(rtol=rtol, atol=atol), jump_ts=time[1:-1]
        ),
        max_steps=STEPS_PER_INSTANT * time.size,
        adjoint=diffrax.ForwardMode(),
        throw=False,
    )
    assert solution.ys is not None
    motion, states = solution.ys
    return motion, jax.vmap(forces)(motion, states), [s[-1] for s in states], solution.result
