"""What a user of JAX writes first: diffrax, vmapped over cars, with the laws and vehicles of jaxdamp."""

import functools
from collections.abc import Callable
from typing import Any, cast

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from benchmarks.peers import problem
from benchmarks.peers.problem import Heights, Parameters, Results


# the deflection of a stiff series spring is too fast for one explicit step in 1 ms
SUBSTEPS = {"besinger": 1, "lag": 1, "series_spring": 3, "bouc_wen": 1, "half_car": 1}


def rms(
    case: str,
    parameters: Parameters,
    road: Heights,
    dt: float = 1e-3,
    *,
    substeps: int | None = None,
    at_instants: bool = False,
    solver: diffrax.AbstractSolver | None = None,
) -> Results:
    """RMS acceleration of the body by Tsit5, or another solver, at a constant step of dt/substeps (SUBSTEPS).

    The mean square is the integral of an extra state; `at_instants` saves the acceleration at every instant instead,
    which takes memory in proportion to the length of the run.
    """
    count = SUBSTEPS[case] if substeps is None else substeps
    solve = _compiled(case, count, at_instants, diffrax.Tsit5() if solver is None else solver)
    return np.asarray(solve(jnp.asarray(parameters), jnp.asarray(road), jnp.asarray(dt, dtype=float)))


@functools.cache
def _compiled(
    case: str, substeps: int, at_instants: bool, solver: diffrax.AbstractSolver
) -> Callable[[Array, Array, Array], Array]:
    def one(row: Array, road: Array, dt: Array) -> Array:
        car = problem.vehicle(problem.law(case, row), case)
        system = car.system()
        form, laws, q = system.form, system.laws, system.form.mass.shape[0]
        steps = road.shape[0] - 1
        position = jnp.linalg.solve(form.stiffness, form.road_stiffness @ road[0])  # where no law carries a force

        def motion_rate(t: Any, x: Array, states: list[Array]) -> tuple[Array, Array, Array]:
            place = jnp.clip(t / dt, 0, steps)
            whole = jnp.minimum(jnp.floor(place), steps - 1.0)
            index = whole.astype(int)
            height = road[index] + (place - whole) * (road[index + 1] - road[index])
            stroke, velocity = form.ports @ x[:q], form.ports @ x[q:]
            forces = [law.force(*at) for law, *at in zip(laws, stroke, velocity, states, strict=True)]
            return system.motion(x, jnp.stack(forces), height, None), stroke, velocity

        def field(t: Any, y: tuple, args: None) -> tuple:
            del args
            x, states, _ = y
            change, stroke, velocity = motion_rate(t, x, states)
            rates = [law.state_rate(*at) for law, *at in zip(laws, stroke, velocity, states, strict=True)]
            return change, rates, change[q] ** 2

        def acceleration(t: Any, y: tuple, args: None) -> Array:
            del args
            return motion_rate(t, y[0], y[1])[0][q]

        start = (jnp.concatenate([position, jnp.zeros(q)]), [law.initial_state() for law in laws], jnp.zeros(()))
        if at_instants:
            saved = diffrax.SaveAt(ts=jnp.arange(steps + 1.0) * dt, fn=acceleration)
        else:
            saved = diffrax.SaveAt(t1=True)
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),  # pyright: ignore[reportArgumentType]
            solver,
            0.0,
            steps * dt,
            dt / substeps,
            start,
            saveat=saved,
            stepsize_controller=diffrax.ConstantStepSize(),
            max_steps=steps * substeps + 2,
            adjoint=diffrax.ForwardMode(),
        )
        if at_instants:
            return jnp.sqrt(jnp.mean(jnp.asarray(solution.ys) ** 2))
        _, _, integral = cast(tuple, solution.ys)
        return jnp.sqrt(integral[0] / (steps * dt))

    return jax.jit(jax.vmap(one, in_axes=(0, None, None)))
