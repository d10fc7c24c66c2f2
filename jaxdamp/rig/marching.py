"""The states of a law carried over a prescribed stroke, without checks."""

from typing import TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._jacobian import Mode
from jaxdamp._sharded import varying_as
from jaxdamp._types import Signal, State
from jaxdamp.dampers import AbstractDamper


if TYPE_CHECKING:
    import diffrax


_STIFF = "Stiff laws need an implicit solver, `diffrax.Kvaerno5()`, or their own steps: leave `engine` out."


def solve_law(
    law: AbstractDamper,
    time: Signal,
    stroke: Signal,
    velocity: Signal,
    solver: "diffrax.AbstractSolver",
    rtol: float,
    atol: float,
    mode: Mode = "forward",
) -> Signal:
    """`march` by a solver of diffrax.

    Arguments:
        law: the damper law.
        time: uniform instants [s], shape (time,).
        stroke: [m], positive in extension, shape (time,).
        velocity: [m/s], shape (time,).
        solver: of diffrax.
        rtol: relative tolerance.
        atol: absolute tolerance, in the units of the states.
        mode: "forward" or "reverse", the derivatives that pass through it.
    """
    from jaxdamp._driven import check_solver, driven_states, verdict

    start = law.initial_state()
    if not start.size:
        return jax.vmap(lambda x, v: law.force(x, v, start))(stroke, velocity)
    check_solver(solver, rtol, atol)
    states, result = driven_states(law.state_rate, start, time, stroke, velocity, solver, rtol, atol, mode)
    last = _checks.concrete(states[-1])
    if last is not None and not np.all(np.isfinite(last)):
        said = verdict(result) or "finished with states that are not finite"
        _checks.refuse("engine", "reach the end", f"one with {type(solver).__name__}, which says: {said}", _STIFF)
    return jax.vmap(law.force)(stroke, velocity, states)


def march(
    law: AbstractDamper,
    dt: Array,
    stroke: Signal,
    velocity: Signal,
    substeps: int,
    temperature: Signal | None = None,
    state: State | None = None,
) -> Signal:
    """`respond` without its checks, for use inside compiled functions, from this state if one is given.

    Arguments:
        law: the damper law.
        dt: step [s].
        stroke: [m], positive in extension, shape (time,).
        velocity: [m/s], shape (time,).
        substeps: steps from one instant to the next.
        temperature: [K], shape (time,), for laws that depend on one; within a step it is the mean of both ends.
        state: of the law at the first instant; its own initial state if left out.
    """
    return march_states(law, dt, stroke, velocity, substeps, temperature, state)[0]


@eqx.filter_jit
def march_states(
    law: AbstractDamper,
    dt: Array,
    stroke: Signal,
    velocity: Signal,
    substeps: int,
    temperature: Signal | None = None,
    state: State | None = None,
) -> tuple[Signal, State]:
    """Forces [N] and the states at the last instant, as `march`."""
    warm = None if temperature is None or not law.traits().temperature_dependent else temperature

    def at(temperature: Array | None) -> AbstractDamper:
        return law if temperature is None else law.at_temperature(temperature)

    def force(x: Array, v: Array, state: Array, temperature: Array | None) -> Array:
        return at(temperature).force(x, v, state)

    state = at(None if warm is None else warm[0]).initial_state() if state is None else state
    if state.size == 0:
        return jax.vmap(force, (0, 0, None, 0))(stroke, velocity, state, warm), state
    fine_x = _refine(stroke, dt * velocity, substeps)
    fine_v = _refine(velocity, dt * slopes(velocity, dt), substeps)
    h = dt / substeps

    def sample(state: Array, inputs: tuple[tuple[Array, Array, Array, Array], Array | None]) -> tuple[Array, Array]:
        ends, own = inputs[0], at(inputs[1])

        def step(state: Array, ends: tuple[Array, Array, Array, Array]) -> tuple[Array, None]:
            x0, v0, x1, v1 = ends
            return own.advance(x0, v0, x1, v1, state, h), None

        if substeps == 1:
            after = step(state, (ends[0][0], ends[1][0], ends[2][0], ends[3][0]))[0]
        else:
            after = jax.lax.scan(step, state, ends)[0]
        return after, state  # the state before: XLA would compute that after the step twice, also to store it

    def grouped(values: Array) -> Array:
        return values.reshape(-1, substeps)

    grid = (grouped(fine_x[:-1]), grouped(fine_v[:-1]), grouped(fine_x[1:]), grouped(fine_v[1:]))
    between = None if warm is None else 0.5 * (warm[:-1] + warm[1:])
    state = varying_as(state, grid, eqx.filter(law, eqx.is_array), h)
    last, states = jax.lax.scan(sample, state, (grid, between))
    states = jnp.concatenate([states, last[None]])
    return jax.vmap(force)(stroke, velocity, states, warm), last


def slopes(values: Signal, dt: Array) -> Signal:
    """Derivative by five-point differences, exact for quartics up to the ends."""
    if values.size < 5:
        return jnp.asarray(jnp.gradient(values, dt))
    inner = (values[:-4] - 8.0 * values[1:-3] + 8.0 * values[3:-1] - values[4:]) / 12.0
    edge = jnp.array([[-25.0, 48.0, -36.0, 16.0, -3.0], [-3.0, -10.0, 18.0, -6.0, 1.0]]) / 12.0
    return jnp.concatenate([edge @ values[:5], inner, -(edge @ values[:-6:-1])[::-1]]) / dt


def _refine(values: Signal, steps: Signal, parts: int) -> Float[Array, " fine"]:
    """Cubic Hermite interpolation to `parts` intervals per sample; `steps` are slopes times the sample spacing."""
    if parts == 1:
        return values
    ends = (values[:-1, None], steps[:-1, None], values[1:, None], steps[1:, None])
    fine = hermite(ends, (jnp.arange(parts) / parts)[None, :])
    return jnp.append(jnp.ravel(fine), values[-1])


def hermite(ends: tuple[Array, Array, Array, Array], s: Array) -> Array:
    """The cubic at a share s of an interval, from value and rise (slope × width) at its start and at its end."""
    start, start_rise, stop, stop_rise = ends
    rises = start_rise * (s * (1 - s) ** 2) + stop_rise * (s * s * (s - 1))
    return start * ((1 + 2 * s) * (1 - s) ** 2) + stop * (s * s * (3 - 2 * s)) + rises
