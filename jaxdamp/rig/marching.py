"""The states of a law carried over a prescribed stroke, without checks."""

from typing import TYPE_CHECKING, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._jacobian import Mode
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._sharded import varying_as
from jaxdamp._types import ScalarLike, Signal, State
from jaxdamp.dampers import AbstractDamper, at_command


if TYPE_CHECKING:
    import diffrax


class Followed(NamedTuple):
    """Channels measured beside the motion that a law follows, in place of the numbers that it states; None without one.

    Attributes:
        temperature: of the oil [K], shape (time,), for laws that depend on it.
        command: in the unit of the law's command, shape (time,), straight between the instants.
    """

    temperature: Signal | None = None
    command: Signal | None = None

    def of(self, law: AbstractDamper) -> "Followed":
        """Only what the law follows."""
        return self if law.traits().temperature_dependent else self._replace(temperature=None)

    def first(self, law: AbstractDamper) -> AbstractDamper:
        """The law at the first instant."""
        return law_at(law, *(None if channel is None else channel[0] for channel in self.of(law)))


NOTHING = Followed()
_Ends = tuple[Array, Array, Array, Array, Array | None]  # stroke, velocity, stroke, velocity, command between


def law_at(law: AbstractDamper, temperature: ScalarLike | None, command: ScalarLike | None) -> AbstractDamper:
    """The law at a measured temperature [K] and command, each if there is one."""
    law = law if temperature is None else law.at_temperature(temperature)
    return law if command is None else at_command(law, command)


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

    start = law.state_at_rest(stroke[0])
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
    followed: Followed = NOTHING,
    state: State | None = None,
) -> Signal:
    """`respond` without its checks, for use inside compiled functions, from this state if one is given.

    Arguments:
        law: the damper law.
        dt: step [s].
        stroke: [m], positive in extension, shape (time,).
        velocity: [m/s], shape (time,).
        substeps: steps from one instant to the next.
        followed: measured channels that the law follows; a step takes the mean of both ends.
        state: of the law at the first instant; that at rest at the first stroke if left out.
    """
    return march_states(law, dt, stroke, velocity, substeps, followed, state)[0]


@compiled_for_loops
def state_at_rest(law: AbstractDamper, stroke: Array) -> State:
    """The states of a law at rest at a stroke [m], by one program."""
    return law.state_at_rest(stroke)


@compiled_for_loops
def march_states(
    law: AbstractDamper,
    dt: Array,
    stroke: Signal,
    velocity: Signal,
    substeps: int,
    followed: Followed = NOTHING,
    state: State | None = None,
) -> tuple[Signal, State]:
    """Forces [N] and the states at the last instant, as `march`."""
    warm, commands = followed.of(law)

    def force(x: Array, v: Array, state: Array, warm: Array | None, command: Array | None) -> Array:
        return law_at(law, warm, command).force(x, v, state)

    state = followed.first(law).state_at_rest(stroke[0]) if state is None else state
    if state.size == 0:
        return jax.vmap(force, (0, 0, None, 0, 0))(stroke, velocity, state, warm, commands), state
    h, (fine_x, fine_v), _ = finer(dt, stroke, velocity, NOTHING, substeps)

    def sample(state: Array, inputs: tuple[_Ends, Array | None]) -> tuple[Array, Array]:
        ends, warm = inputs

        def step(state: Array, ends: _Ends) -> tuple[Array, None]:
            x0, v0, x1, v1, command = ends
            return law_at(law, warm, command).advance(x0, v0, x1, v1, state, h), None

        if substeps == 1:
            after = step(state, jax.tree.map(lambda end: end[0], ends))[0]
        else:
            after = jax.lax.scan(step, state, ends)[0]
        return after, state  # the state before: XLA would compute that after the step twice, also to store it

    def grouped(values: Array) -> Array:
        return values.reshape(-1, substeps)

    middles = None
    if commands is not None:
        shares = (jnp.arange(substeps, dtype=commands.dtype) + 0.5) / substeps
        middles = commands[:-1, None] + jnp.diff(commands)[:, None] * shares[None, :]
    grid = (grouped(fine_x[:-1]), grouped(fine_v[:-1]), grouped(fine_x[1:]), grouped(fine_v[1:]), middles)
    between = None if warm is None else 0.5 * (warm[:-1] + warm[1:])
    state = varying_as(state, grid, eqx.filter(law, eqx.is_array), h)
    last, states = jax.lax.scan(sample, state, (grid, between))
    states = jnp.concatenate([states, last[None]])
    return jax.vmap(force)(stroke, velocity, states, warm, commands), last


def step_and_rate(time: Signal, stroke: Signal, velocity: Signal | None) -> tuple[Array, Signal]:
    """Sample spacing, and the velocity: by central differences of the stroke if there is none."""
    return _step_and_rate(time, stroke, velocity, np.asarray(time.size - 1, time.dtype))


@jax.jit
def _step_and_rate(time: Signal, stroke: Signal, velocity: Signal | None, steps: Array) -> tuple[Array, Signal]:
    dt = (time[-1] - time[0]) / steps  # an argument: by a constant XLA multiplies with its rounded reciprocal
    return dt, jnp.asarray(jnp.gradient(stroke, dt)) if velocity is None else velocity


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


def finer(
    dt: Array, stroke: Signal, velocity: Signal, followed: Followed, parts: int
) -> tuple[Array, tuple[Float[Array, " instants"], Float[Array, " instants"]], Followed]:
    """Step [s], motion and channels with so many instants for each: the motion by cubics, the channels straight.

    Arguments:
        dt: step [s].
        stroke: [m], shape (time,).
        velocity: [m/s], shape (time,).
        followed: measured channels beside it.
        parts: of each step.
    """

    def straight(values: Signal) -> Signal:
        places = jnp.arange((values.size - 1) * parts + 1, dtype=values.dtype) / parts
        return jnp.interp(places, jnp.arange(values.size, dtype=values.dtype), values)

    motion = _refine(stroke, dt * velocity, parts), _refine(velocity, dt * slopes(velocity, dt), parts)
    return dt / parts, motion, Followed(*(None if channel is None else straight(channel) for channel in followed))


def hermite(ends: tuple[Array, Array, Array, Array], s: Array) -> Array:
    """The cubic at a share s of an interval, from value and rise (slope × width) at its start and at its end."""
    start, start_rise, stop, stop_rise = ends
    rises = start_rise * (s * (1 - s) ** 2) + stop_rise * (s * s * (s - 1))
    return start * ((1 + 2 * s) * (1 - s) ** 2) + stop * (s * s * (3 - 2 * s)) + rises
