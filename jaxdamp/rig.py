"""The bench: the force of a law under a prescribed stroke."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Signal, SignalLike
from jaxdamp.dampers import AbstractDamper


def respond(
    law: AbstractDamper, time: SignalLike, stroke: SignalLike, velocity: SignalLike | None = None, *, substeps: int = 1
) -> Signal:
    """Force [N] of a damper law whose stroke is prescribed, as on a test bench.

    The law starts at rest (`law.initial_state()`), so a law with states needs about a cycle, or a few lag times, to
    forget the start of a record that begins in motion.

    Arguments:
        law: the damper law.
        time: uniformly spaced instants [s], shape (time,).
        stroke: stroke [m] at these instants, positive in extension, shape (time,).
        velocity: velocity [m/s], shape (time,). If it is left out, the stroke is differentiated by central
            differences, which is only good for a stroke without noise.
        substeps: steps from one instant to the next for laws with states, between which stroke and velocity are
            interpolated by cubics. The error of a step falls with its square.

    Returns:
        Force [N], positive when it resists extension, shape (time,).

    Raises:
        ValueError: time not uniform or not increasing, shapes that differ, fewer than two instants.

    >>> from jaxdamp.dampers import Linear
    >>> time = np.linspace(0.0, 1.0, 1001)
    >>> force = respond(Linear(2000.0), time, 0.01 * np.sin(6 * time), 0.06 * np.cos(6 * time))
    >>> round(float(force[0]), 6)
    120.0
    """
    time, stroke = jnp.asarray(time), jnp.asarray(stroke)
    if time.ndim != 1 or time.size < 2 or stroke.shape != time.shape:
        _checks.refuse("stroke", "be as long as `time`, two or more", f"of shape {stroke.shape} for time {time.shape}")
    if velocity is not None and jnp.shape(velocity) != time.shape:
        _checks.refuse("velocity", "be as long as `time`", f"of shape {jnp.shape(velocity)} for time {time.shape}")
    if substeps < 1:
        _checks.refuse("substeps", "be 1 or more", substeps)
    _checks.finite("stroke", stroke, "Remove or interpolate the missing samples first.")
    instants = _checks.concrete(time)
    if instants is not None:
        steps = np.diff(instants)
        if not (np.all(steps > 0) and np.ptp(steps) <= 1e-3 * steps.mean()):
            value = f"stepping from {steps.min():g} to {steps.max():g} s"
            _checks.refuse("time", "increase in equal steps", value, "Resample the record to a uniform rate.")
    dt = (time[-1] - time[0]) / (time.size - 1)
    velocity = jnp.gradient(stroke, dt) if velocity is None else jnp.asarray(velocity)
    return march(law, dt, stroke, velocity, substeps)


@eqx.filter_jit
def march(law: AbstractDamper, dt: Array, stroke: Signal, velocity: Signal, substeps: int) -> Signal:
    """`respond` without its checks, for use inside compiled functions."""
    state = law.initial_state()
    if state.size == 0:
        return jax.vmap(lambda x, v: law.force(x, v, state))(stroke, velocity)
    fine_x = _refine(stroke, dt * velocity, substeps)
    fine_v = _refine(velocity, dt * _slopes(velocity, dt), substeps)
    h = dt / substeps

    def step(state: Array, ends: tuple[Array, Array, Array, Array]) -> tuple[Array, None]:
        x0, v0, x1, v1 = ends
        return law.advance(x0, v0, x1, v1, state, h), None

    def sample(state: Array, ends: tuple[Array, Array, Array, Array]) -> tuple[Array, Array]:
        if substeps == 1:
            state = step(state, tuple(e[0] for e in ends))[0]
        else:
            state = jax.lax.scan(step, state, ends)[0]
        return state, state

    grid = tuple(a.reshape(-1, substeps) for a in (fine_x[:-1], fine_v[:-1], fine_x[1:], fine_v[1:]))
    _, states = jax.lax.scan(sample, state, grid)
    states = jnp.concatenate([state[None], states])
    return jax.vmap(law.force)(stroke, velocity, states)


def _slopes(values: Signal, dt: Array) -> Signal:
    """Derivative by five-point differences, exact for quartics up to the ends."""
    if values.size < 5:
        return jnp.gradient(values, dt)
    inner = (values[:-4] - 8.0 * values[1:-3] + 8.0 * values[3:-1] - values[4:]) / 12.0
    edge = jnp.array([[-25.0, 48.0, -36.0, 16.0, -3.0], [-3.0, -10.0, 18.0, -6.0, 1.0]]) / 12.0
    return jnp.concatenate([edge @ values[:5], inner, -(edge @ values[:-6:-1])[::-1]]) / dt


def _refine(values: Signal, steps: Signal, parts: int) -> Float[Array, " fine"]:
    """Cubic Hermite interpolation to `parts` intervals per sample; `steps` are slopes times the sample spacing."""
    if parts == 1:
        return values
    s = jnp.arange(parts) / parts
    h00, h10 = (1 + 2 * s) * (1 - s) ** 2, s * (1 - s) ** 2
    h01, h11 = s * s * (3 - 2 * s), s * s * (s - 1)
    ends = (values[:-1, None], steps[:-1, None], values[1:, None], steps[1:, None])
    fine = sum(end * basis[None, :] for end, basis in zip(ends, (h00, h10, h01, h11), strict=True))
    return jnp.append(jnp.ravel(fine), values[-1])
