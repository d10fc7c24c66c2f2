"""The force of a law under a prescribed stroke."""

import warnings
from abc import abstractmethod
from typing import TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._jacobian import Mode
from jaxdamp._sharded import varying_as
from jaxdamp._types import Signal, SignalLike, State
from jaxdamp.dampers import (
    AbstractDamper,
    Motion,
    has_fitted_range,
    range_use,
    require_finite_force,
    sentence,
    warn_outside,
    without_fitted_ranges,
)
from jaxdamp.parameters import as_float


if TYPE_CHECKING:
    import diffrax


_STIFF = "Stiff laws need an implicit solver, `diffrax.Kvaerno5()`, or their own steps: leave `engine` out."


class AbstractLawEngine(eqx.Module):
    """What carries the states of a law over a prescribed stroke: every engine of `jaxdamp.simulation`."""

    @abstractmethod
    def respond(self, law: AbstractDamper, time: Signal, stroke: Signal, velocity: Signal) -> Signal:
        """Force [N] of a law at uniform instants [s] of a stroke [m] and its velocity [m/s], without checks."""


def respond(
    law: AbstractDamper,
    time: SignalLike,
    stroke: SignalLike,
    velocity: SignalLike | None = None,
    *,
    temperature: Float[ArrayLike, "..."] | None = None,
    substeps: int = 1,
    engine: AbstractLawEngine | None = None,
    method: "str | diffrax.AbstractSolver | None" = None,
    rtol: float = 1e-8,
    atol: float = 1e-10,
) -> Signal:
    """Force [N] of a damper law whose stroke is prescribed, as on a test bench.

    A motion outside the range that the law was fitted to (`law.fitted_to`) gives an `OutsideFittedRangeWarning`.

    The law starts at rest (`law.initial_state()`), so a law with states needs about a cycle, or a few lag times, to
    forget the start of a record that begins in motion.

    Arguments:
        law: the damper law.
        time: uniformly spaced instants [s], shape (time,).
        stroke: stroke [m] at these instants, positive in extension, shape (time,).
        velocity: velocity [m/s], shape (time,). If it is left out, the stroke is differentiated by central
            differences, which is only good for a stroke without noise.
        temperature: measured temperature of the oil [K], one value or shape (time,), in place of that which a
            `TemperatureScaled` states and that which a `Heated` computes.
        substeps: steps from one instant to the next for laws with states, between which stroke and velocity are
            interpolated by cubics. The error of a step falls with its square.
        engine: `simulation.Exponential(substeps=...)`, the steps that the laws bring, as when it is left out; or
            `simulation.Adaptive(...)`, a diffrax solver of their rates, as reference for stiff laws. Then the stroke
            between two instants is the cubic with the velocities at its ends.
        method: deprecated: `"step"` or a diffrax solver. Pass `engine`.
        rtol: deprecated: of a `method`.
        atol: deprecated: of a `method`.

    Returns:
        Force [N], positive when it resists extension, shape (time,).

    Raises:
        ValueError: time not uniform or not increasing, shapes that differ, fewer than two instants; a stroke outside
            the limits of a law (`law.stroke_limits`); a force that is not finite, as where the motion leaves the data
            that a law was made from; a solver that gives up; a temperature beside a law that does
            not depend on it, or beside an engine.

    >>> from jaxdamp.dampers import Linear
    >>> time = np.linspace(0.0, 1.0, 1001)
    >>> force = respond(Linear(2000.0), time, 0.01 * np.sin(6 * time), 0.06 * np.cos(6 * time))
    >>> round(float(force[0]), 6)
    120.0
    """
    check_module("law", law, (AbstractDamper,), "respond(law, time, stroke, velocity)")
    instants = _checks.concrete(time)
    time, stroke = as_float(time), as_float(stroke)
    if time.ndim != 1 or time.size < 2 or stroke.shape != time.shape:
        _checks.refuse("stroke", "be as long as `time`, two or more", f"of shape {stroke.shape} for time {time.shape}")
    if velocity is not None and jnp.shape(velocity) != time.shape:
        _checks.refuse("velocity", "be as long as `time`", f"of shape {jnp.shape(velocity)} for time {time.shape}")
    if substeps < 1:
        _checks.refuse("substeps", "be 1 or more", substeps)
    for name, values in (("stroke", stroke), ("velocity", velocity)):
        if values is not None:
            _checks.finite(name, values, "Remove or interpolate the missing samples first.")
    if instants is not None:
        steps = np.diff(instants)
        rounding = 4.0 * float(jnp.finfo(time.dtype).eps) * np.abs(instants).max()
        if not (np.all(steps > 0) and np.ptp(steps) <= 1e-3 * steps.mean() + rounding):
            value = f"stepping from {steps.min():g} to {steps.max():g} s"
            _checks.refuse("time", "increase in equal steps", value, "Resample the record to a uniform rate.")
    dt = (time[-1] - time[0]) / (time.size - 1)
    rate = jnp.asarray(jnp.gradient(stroke, dt)) if velocity is None else as_float(velocity)
    _refuse_strokes(law, stroke)
    fitted, law = law, without_fitted_ranges(law)
    if method is not None:
        _refuse_method(method, engine)
    solver = None if isinstance(method, str) else method
    if (engine is not None or solver is not None) and substeps != 1:
        must = "be left out beside an engine, which has its own or chooses them"
        _checks.refuse("substeps", must, substeps, "Write `engine=simulation.Exponential(substeps=...)`.")
    if temperature is not None:
        if engine is not None or solver is not None:
            _checks.refuse("temperature", "be left out beside an engine", temperature, "Leave out `engine`.")
        temperature = _of_instants(law, temperature, time)
    if engine is not None:
        check_module("engine", engine, (AbstractLawEngine,), "respond(law, time, stroke, engine=...)")
        force = engine.respond(law, time, stroke, rate)
    elif solver is not None:
        force = solve_law(law, time, stroke, rate, solver, rtol, atol)
    else:
        force = march(law, dt, stroke, rate, substeps, temperature)
    require_finite_force(law, force, "over the whole motion")
    _warn_of_range(fitted, stroke, rate, force)
    return force


def _of_instants(law: AbstractDamper, temperature: Float[ArrayLike, "..."], time: Signal) -> Signal:
    """A temperature [K] at every instant, for a law that depends on it."""
    if not law.traits().temperature_dependent:
        remedy = "Write `TemperatureScaled(law, ...)` or `Heated(law)`."
        _checks.refuse("temperature", "be left out beside a law that does not depend on it", repr(law), remedy)
    if jnp.shape(temperature) not in ((), time.shape):
        _checks.refuse("temperature", "be one value or as long as `time`", f"of shape {jnp.shape(temperature)}")
    _checks.positive("temperature", temperature, "It is in kelvin.")
    return jnp.broadcast_to(as_float(temperature), time.shape)


def _warn_of_range(law: AbstractDamper, *channels: Signal) -> None:
    """Say by how much known stroke, velocity and force leave the range that the law was fitted to."""
    if has_fitted_range(law):
        known = [_checks.concrete(channel) for channel in channels]
        if all(values is not None for values in known):
            stroke, velocity, force = (np.asarray(values, dtype=float) for values in known)
            motion = Motion(stroke, velocity, force)
            warn_outside([sentence(type(law).__name__, range_use(law, motion))], stacklevel=4)


def _refuse_strokes(law: AbstractDamper, stroke: Signal) -> None:
    """Refuse strokes outside the limits of a law."""
    found = _checks.concrete(stroke)
    for term in law.side_by_side():
        low, high = (_checks.concrete(limit) for limit in term.stroke_limits)
        if found is None or low is None or high is None:
            continue
        if found.min() < low or found.max() > high:
            must = f"stay from {low:.4g} to {high:.4g} m for {type(term).__name__}"
            value = f"from {found.min():.4g} to {found.max():.4g} m"
            _checks.refuse("stroke", must, value, "The law's volumes are those at stroke zero: shift the stroke.")


def _refuse_method(method: "str | diffrax.AbstractSolver", engine: AbstractLawEngine | None) -> None:
    """Warn of the deprecated argument, and refuse what it never was."""
    if isinstance(method, str) and method != "step":
        remedy = "Pass `engine=simulation.Adaptive(diffrax.Kvaerno5())`."
        _checks.refuse("method", "be 'step' or a diffrax solver", repr(method), remedy)
    if engine is not None:
        _checks.refuse("engine", "be given without `method`", repr(engine))
    instead = "`engine=simulation.Adaptive(solver, rtol=..., atol=...)`, or leave it out for the steps of the laws"
    warnings.warn(f"`method` of `respond` is deprecated: pass {instead}.", DeprecationWarning, stacklevel=3)


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


@eqx.filter_jit
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
    warm = None if temperature is None or not law.traits().temperature_dependent else temperature

    def at(temperature: Array | None) -> AbstractDamper:
        return law if temperature is None else law.at_temperature(temperature)

    def force(x: Array, v: Array, state: Array, temperature: Array | None) -> Array:
        return at(temperature).force(x, v, state)

    state = at(None if warm is None else warm[0]).initial_state() if state is None else state
    if state.size == 0:
        return jax.vmap(force, (0, 0, None, 0))(stroke, velocity, state, warm)
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
    return jax.vmap(force)(stroke, velocity, states, warm)


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
