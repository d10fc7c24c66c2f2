"""States driven by a prescribed stroke, by the solvers of diffrax; imported when asked for."""

from typing import Any

import diffrax
import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, Signal, State


STEPS_PER_INSTANT = 1000  # on average: more are a law too fast for the solver, and would take for ever


def hermite(now: Scalar, time: Signal, values: Signal, slopes: Signal) -> tuple[Scalar, Scalar]:
    """Value and slope of the cubic between instants (uniform) that has these values and slopes there."""
    step = (time[-1] - time[0]) / (time.size - 1)
    i = jnp.clip(jnp.floor((now - time[0]) / step).astype(int), 0, time.size - 2)
    s = (now - time[i]) / step
    rise, bend0, bend1 = values[i + 1] - values[i], step * slopes[i], step * slopes[i + 1]
    cubic, square = bend0 + bend1 - 2.0 * rise, 3.0 * rise - 2.0 * bend0 - bend1
    value = values[i] + s * (bend0 + s * (square + s * cubic))
    return value, (bend0 + s * (2.0 * square + 3.0 * s * cubic)) / step


@eqx.filter_jit
def driven_states(
    rate: Any,
    start: State,
    time: Signal,
    stroke: Signal,
    velocity: Signal,
    solver: diffrax.AbstractSolver,
    rtol: float,
    atol: float,
) -> tuple[Float[Array, "time states"], Any]:
    """States at the instants, ẏ = rate(x, v, y), and the solver's verdict.

    The stroke is cubic between the instants and v its derivative; steps end at the instants, where v has kinks.
    """

    def field(now: Any, state: State, args: None) -> State:
        del args
        return rate(*hermite(jnp.asarray(now), time, stroke, velocity), state)

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        solver,
        time[0],
        time[-1],
        0.1 * (time[1] - time[0]),
        start,
        saveat=diffrax.SaveAt(ts=time),
        stepsize_controller=diffrax.ClipStepSizeController(
            diffrax.PIDController(rtol=rtol, atol=atol), jump_ts=time[1:-1]
        ),
        max_steps=STEPS_PER_INSTANT * time.size,
        adjoint=diffrax.ForwardMode(),
        throw=False,
    )
    assert solution.ys is not None
    return solution.ys, solution.result
