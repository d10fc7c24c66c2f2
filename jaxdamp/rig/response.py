"""The force of a law under a prescribed stroke."""

import operator
from abc import abstractmethod
from typing import Literal, TypedDict, Unpack, overload

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._settings import with_defaults
from jaxdamp._types import Signal, SignalLike, State
from jaxdamp._warned import warn
from jaxdamp.dampers import (
    AbstractDamper,
    Heated,
    Motion,
    check_commands,
    has_fitted_range,
    laws_inside,
    range_use,
    require_finite_force,
    sentence,
    warn_outside,
)
from jaxdamp.parameters import as_float
from jaxdamp.rig.marching import Followed, march_states, state_at_rest, step_and_rate
from jaxdamp.rig.strokes import refuse_strokes


IN_MOTION = 0.1  # of the largest velocity, above which a record begins in motion


class StartsInMotionWarning(UserWarning):
    """A law with states starts at rest although the record begins in motion."""


class AbstractLawEngine(eqx.Module):
    """What carries the states of a law over a prescribed stroke: every engine of `jaxdamp.simulation`."""

    @abstractmethod
    def respond(self, law: AbstractDamper, time: Signal, stroke: Signal, velocity: Signal) -> Signal:
        """Force [N] of a law at uniform instants [s] of a stroke [m] and its velocity [m/s], without checks."""


class ResponseSettings(TypedDict, total=False):
    """The keywords of `respond` beside the record and `return_state`.

    Arguments:
        state: states of the law at the first instant, shape (states,).
        temperature: measured temperature of the oil [K], one value or shape (time,), in place of that which a
            `TemperatureScaled` states and that which a `Heated` computes.
        command: coil current, voltage or clicks, one value or shape (time,), in place of that which the law states, in
            its unit; straight between the instants. The law has it at once: `Rig(command_lag=...).force(law, ...)` has
            an actuator with a lag. Values up to a twentieth of the levels' range outside of the levels of a `Scheduled`
            law, such as noise, take the nearest level.
        substeps: steps from one instant to the next for laws with states, between which stroke and velocity are
            interpolated by cubics. The error of a step falls with its square.
        engine: `simulation.Exponential(substeps=...)`, the steps that the laws bring, as when it is left out; or
            `simulation.Adaptive(...)`, a diffrax solver of their rates, as reference for stiff laws. Then the stroke
            between two instants is the cubic with the velocities at its ends.
    """

    state: Float[ArrayLike, " states"] | None
    temperature: Float[ArrayLike, "..."] | None
    command: Float[ArrayLike, "..."] | None
    substeps: int
    engine: AbstractLawEngine | None


DEFAULTS: ResponseSettings = {"state": None, "temperature": None, "command": None, "substeps": 1, "engine": None}


@overload
def respond(
    law: AbstractDamper,
    time: SignalLike,
    stroke: SignalLike,
    velocity: SignalLike | None = ...,
    *,
    return_state: Literal[False] = ...,
    **settings: Unpack[ResponseSettings],
) -> Signal: ...
@overload
def respond(
    law: AbstractDamper,
    time: SignalLike,
    stroke: SignalLike,
    velocity: SignalLike | None = ...,
    *,
    return_state: Literal[True],
    **settings: Unpack[ResponseSettings],
) -> tuple[Signal, State]: ...
@with_defaults(DEFAULTS)
def respond(
    law: AbstractDamper,
    time: SignalLike,
    stroke: SignalLike,
    velocity: SignalLike | None = None,
    *,
    return_state: bool = False,
    **settings: Unpack[ResponseSettings],
) -> Signal | tuple[Signal, State]:
    """Force [N] of a damper law whose stroke is prescribed, as on a test bench.

    A motion outside the range that the law was fitted to (`law.fitted_to`) gives an `OutsideFittedRangeWarning`.

    A law with states starts at rest at the first stroke (`law.state_at_rest(stroke[0])`) unless it is given a `state`.
    In a record that begins in motion it then needs about a cycle, or a few lag times, to forget the start, and a
    `StartsInMotionWarning` says so. Better starts are the state after a cycle of a periodic motion (`return_state`) and
    that of a constant velocity (`rig.quasi_static(law, velocity[:1], stroke=stroke[0]).states[0]`). A long record can
    be computed in pieces: each begins with the last sample and the state of the one before.

    Arguments:
        law: the damper law.
        time: uniformly spaced instants [s], shape (time,).
        stroke: stroke [m] at these instants, positive in extension, shape (time,).
        velocity: velocity [m/s], shape (time,). If it is left out, the stroke is differentiated by central
            differences, which is only good for a stroke without noise.
        return_state: whether to return the states at the last instant too.
        settings: keywords, all optional: `state`, `temperature`, `command`, `substeps` and `engine` (see
            `ResponseSettings`).

    Returns:
        Force [N], positive when it resists extension, shape (time,); with `return_state` a pair of it and the states
        at the last instant, shape (states,).

    Raises:
        ValueError: time not uniform or not increasing, shapes that differ, fewer than two instants; a stroke outside
            the limits of a law (`law.stroke_limits`); a force that is not finite, as where the motion leaves the data
            that a law was made from; a solver that gives up; a temperature or a command beside a law that does not
            depend on it, or beside an engine; a command outside the levels of the law; a state of another size, or
            beside an engine.

    >>> from jaxdamp.dampers import Linear
    >>> time = np.linspace(0.0, 1.0, 1001)
    >>> force = respond(Linear(2000.0), time, 0.01 * np.sin(6 * time), 0.06 * np.cos(6 * time))
    >>> round(float(force[0]), 6)
    120.0
    """
    state, temperature, command = settings["state"], settings["temperature"], settings["command"]
    substeps, engine = settings["substeps"], settings["engine"]
    check_module("law", law, (AbstractDamper,), "respond(law, time, stroke, velocity)")
    instants = _checks.concrete(time)
    if isinstance(time, np.ndarray) and time.size:  # before it becomes single: times of day need double precision
        time = time - time.flat[0]
    time, stroke = as_float(time), as_float(stroke)
    _check_record(instants, time, stroke, velocity)
    _checks.untraced("substeps", substeps, "The number of steps is part of a compiled program: give a plain number.")
    _checks.counts(substeps=substeps)
    substeps = operator.index(substeps)
    dt, rate = step_and_rate(time, stroke, None if velocity is None else as_float(velocity))
    if (concrete := _checks.concrete(stroke)) is not None:
        refuse_strokes(law, "stroke", concrete.min(), concrete.max())
    if engine is not None:
        _refuse_beside_engine(temperature, command, substeps, state, return_state)
    if temperature is not None:
        temperature = _of_instants(law, temperature, time)
    if command is not None:
        command = _commands(law, command, time)
    followed = Followed(temperature, command)
    if state is None:
        _warn_of_motion(followed.first(law), stroke, rate)
    last: State | None = None
    if engine is not None:
        check_module("engine", engine, (AbstractLawEngine,), "respond(law, time, stroke, engine=...)")
        force = engine.respond(law, time, stroke, rate)
    else:
        if state is None:  # outside of the long program, which is then that of a given state too
            begin = state_at_rest(followed.first(law), stroke[0] if concrete is None else concrete[0])
        else:
            begin = _checked_state(law, state, followed)
        force, last = march_states(law, dt, stroke, rate, substeps, followed, begin)
    if force.shape != time.shape:
        _checks.refuse("law", "give one number as force", f"{type(law).__name__}, which gives {force.shape[1:]}")
    require_finite_force(law, force, "over the whole motion")
    _warn_of_range(law, stroke, rate, force)
    return (force, last) if return_state and last is not None else force


def _check_record(instants: np.ndarray | None, time: Signal, stroke: Signal, velocity: SignalLike | None) -> None:
    """Refuse a record with other shapes, missing samples or unequal steps."""
    if time.ndim != 1 or time.size < 2 or stroke.shape != time.shape:
        _checks.refuse("stroke", "be as long as `time`, two or more", f"of shape {stroke.shape} for time {time.shape}")
    if velocity is not None and jnp.shape(velocity) != time.shape:
        _checks.refuse("velocity", "be as long as `time`", f"of shape {jnp.shape(velocity)} for time {time.shape}")
    for name, values in (("stroke", stroke), ("velocity", velocity)):
        if values is not None:
            _checks.finite(name, values, "Remove or interpolate the missing samples first.")
    if instants is not None:
        steps = np.diff(instants)
        rounding = 4.0 * float(jnp.finfo(time.dtype).eps) * np.abs(instants).max()
        if not (np.all(steps > 0) and np.ptp(steps) <= 1e-3 * steps.mean() + rounding):
            value = f"stepping from {steps.min():g} to {steps.max():g} s"
            _checks.refuse("time", "increase in equal steps", value, "Resample the record to a uniform rate.")


def _refuse_beside_engine(
    temperature: object, command: object, substeps: int, state: object, return_state: bool
) -> None:
    """Refuse what only the steps of the laws have."""
    if substeps != 1:
        must = "be left out beside an engine, which has its own or chooses them"
        _checks.refuse("substeps", must, substeps, "Write `engine=simulation.Exponential(substeps=...)`.")
    others = {"temperature": temperature, "command": command, "state": state, "return_state": return_state or None}
    for name, value in others.items():
        if value is not None:
            _checks.refuse(name, "be left out beside an engine", value, "Leave out `engine`.")


def _checked_state(law: AbstractDamper, state: object, followed: Followed) -> State:
    """The states, as many as the law has."""
    begin, shape = as_float(state), followed.first(law).initial_state().shape
    if begin.shape != shape:
        _checks.refuse("state", f"have the shape {shape} for {type(law).__name__}", f"of shape {begin.shape}")
    _checks.finite("state", begin)
    return begin


def _warn_of_motion(law: AbstractDamper, stroke: Signal, velocity: Signal) -> None:
    """Say that a law with states, other than its heat, starts at rest in a record that begins in motion."""
    values, x = _checks.concrete(velocity), _checks.concrete(stroke)
    rises = sum(isinstance(part, Heated) for _, part in laws_inside(law))
    if values is None or x is None or law.initial_state().size == rises:
        return
    if abs(values[0]) <= IN_MOTION * np.abs(values).max():
        return
    text = (
        f"The record begins at {values[0]:.3g} m/s, but the states of {type(law).__name__} start at rest: the first "
        "forces are wrong, for about a cycle or a few lag times. Begin at rest, or pass a state: "
        f"`rig.quasi_static(law, velocity[:1], stroke={x[0]:.4g}).states[0]`, that after a cycle "
        f"(`return_state=True`), or `law.state_at_rest({x[0]:.4g})` if it is meant."
    )
    warn(text, StartsInMotionWarning)


def _of_instants(law: AbstractDamper, temperature: Float[ArrayLike, "..."], time: Signal) -> Signal:
    """A temperature [K] at every instant, for a law that depends on it."""
    if not law.traits().temperature_dependent:
        remedy = "Write `TemperatureScaled(law, ...)` or `Heated(law)`."
        _checks.refuse("temperature", "be left out beside a law that does not depend on it", repr(law), remedy)
    if jnp.shape(temperature) not in ((), time.shape):
        _checks.refuse("temperature", "be one value or as long as `time`", f"of shape {jnp.shape(temperature)}")
    _checks.kelvin("temperature", temperature)
    return jnp.broadcast_to(as_float(temperature), time.shape)


def _commands(law: AbstractDamper, command: Float[ArrayLike, "..."], time: Signal) -> Signal:
    """A command at every instant, for a law that takes one."""
    check_commands("command", law, command)
    if jnp.shape(command) not in ((), time.shape):
        _checks.refuse("command", "be one value or as long as `time`", f"of shape {jnp.shape(command)}")
    return jnp.broadcast_to(as_float(command), time.shape)


def _warn_of_range(law: AbstractDamper, *channels: Signal) -> None:
    """Say by how much known stroke, velocity and force leave the range that the law was fitted to."""
    if has_fitted_range(law):
        concrete = [_checks.concrete(channel) for channel in channels]
        if all(values is not None for values in concrete):
            stroke, velocity, force = (np.asarray(values, dtype=float) for values in concrete)
            motion = Motion(stroke, velocity, force)
            warn_outside([sentence(type(law).__name__, range_use(law, motion))])
