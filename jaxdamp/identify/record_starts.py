"""How a record begins: states of a law at its first sample, and how warm it is, by the force of its first cycles."""

import dataclasses
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._quickly import compiled_for_loops
from jaxdamp._types import Scalar, State
from jaxdamp.bench import BenchRun, initial_temperature
from jaxdamp.identify.initial_states import moving_samples, rest_window
from jaxdamp.identify.model import (
    Model,
    OnRig,
    RecordStart,
    count_states,
    law_of,
    marched,
    on_rig,
    rig_of,
    starts_in,
    state_history,
)
from jaxdamp.identify.rows import settling_samples
from jaxdamp.identify.stated import start_paths
from jaxdamp.identify.traces import Batch, batches
from jaxdamp.parameters import get, with_values
from jaxdamp.rig import Followed


SAMPLES_PER_CYCLE = 100  # of the motion that shows how large the states become
NEWTON_STEPS = 20  # to states with the force of the rest
FIRST_CYCLES = 3.0  # of a record that tell how warm it begins
FIRST_SHARE = 0.25  # of its motion at most
UNKNOWN = 20.0  # K, standard deviation of a new record's temperature about the mean of the fitted ones
COMPARED_PER_CYCLE = 200  # samples that are compared
ROUNDS = 40  # of Newton's method at most
SETTLED = 1e-3  # K, step after which it ends
WIDER, NARROWER = 4.0, 8.0  # by which the share of a step grows or falls behind one that was accepted or refused


class FirstStates(NamedTuple):
    """The states of a law at the first sample of records, as far as they are known without the force of the motion.

    Attributes:
        expected: without any force: those of the law itself in records that begin at rest, else those after a cycle.
        size: largest change of each state in the motion.
        at_rest: in records that begin at rest those nearest to the expected ones, relative to their size, that give the
            mean force of the first second of rest (of the first half, if this is less); else the expected ones.
    """

    expected: Float[np.ndarray, "runs states"]
    size: Float[np.ndarray, "runs states"]
    at_rest: Float[np.ndarray, "runs states"]


def first_states(model: Model, runs: Sequence[BenchRun]) -> FirstStates:
    """The states at the first sample of each record, of a law with states."""
    made, ranges = batches(model, runs, [1.0] * len(runs), SAMPLES_PER_CYCLE)
    windows = [rest_window(run) for run in runs]
    targets = [float(np.mean(run.force[:n])) if n else np.nan for run, n in zip(runs, windows, strict=True)]
    by_batch = []
    for number, batch in enumerate(made):
        rows = sorted(
            (at.row, at.start, at.stop, y) for at, y in zip(ranges, targets, strict=True) if at.batch == number
        )
        _, start, stop, target = (jnp.asarray(column) for column in zip(*rows, strict=True))
        by_batch.append([np.asarray(a) for a in _first_states(batch, model, start, stop, target)])
    return FirstStates(*(np.stack([by_batch[at.batch][k][at.row] for at in ranges]) for k in range(3)))


@compiled_for_loops
def _first_states(batch: Batch, model: Model, start: Array, stop: Array, target: Array) -> tuple[Array, Array, Array]:
    def one(
        dt: Array, x: Array, v: Array, followed: Followed, values: dict[str, Array], start: Array, stop: Array, y: Array
    ) -> tuple[State, State, State]:
        model_of_record = with_values(model, values)
        history = state_history(model_of_record, dt, x, v, followed)
        changes = jnp.where(jnp.arange(x.size)[:, None] < stop, jnp.abs(history - history[:1]), 0.0)
        size = jnp.max(changes, axis=0)
        size = jnp.where(size > 0, size, 1.0)
        rest, still = jnp.full(4, x[start]), jnp.zeros(4)
        constant = jax.tree.map(lambda channel: jnp.full(4, channel[0]), followed)

        def force(state: State) -> Array:
            return marched(model_of_record, batch.effects, dt, rest, still, constant, 1, state)[0]

        expected = history[start]
        at_rest = _states_with_force(force, expected, size, y)
        return expected, size, jnp.where(jnp.isfinite(y), at_rest, expected)

    motion = (batch.dt, batch.stroke, batch.velocity, batch.followed, batch.own_values(model))
    return jax.vmap(one)(*motion, start, stop, target)


def _states_with_force(force: Callable[[State], Array], expected: State, size: State, target: Array) -> State:
    """The nearest states that give a force [N], by Newton's method; at most their size away from the expected ones."""

    def step(state: State, _: None) -> tuple[State, None]:
        slope = jax.grad(force)(state) * size**2
        gain = jnp.sum(jax.grad(force)(state) * slope)
        moved = state + slope * (target - force(state)) / jnp.where(gain > 0, gain, 1.0)
        return expected + jnp.clip(moved - expected, -size, size), None

    return jax.lax.scan(step, expected, None, NEWTON_STEPS)[0]


def with_first_states(model: Model, runs: Sequence[BenchRun]) -> Model:
    """The model with states at the first sample of every record: those it has, or those by the force at rest."""
    estimated = starts_in(model) or (None,) * len(runs)
    if count_states(model) == 0 or all(start is not None for start in estimated):
        return model
    states = first_states(on_rig(law_of(model), rig_of(model)), runs).at_rest
    starts = [own or RecordStart(jnp.asarray(s)) for own, s in zip(estimated, states, strict=True)]
    return OnRig(law_of(model), rig_of(model), tuple(starts))


class Warmed(NamedTuple):
    """A model made for a new record, and how many of its first samples told the temperature, which are not scored."""

    model: Model
    told: int


def unknown_starts(model: Model, runs: Sequence[BenchRun], per_record: Collection[str]) -> list[str]:
    """Paths of the starts that a new record needs, where each of the fitted records had one of its own; else none."""
    paths = start_paths(model)
    if differing := [path for path in paths if path in per_record]:
        return differing
    warms = law_of(model).traits().temperature_dependent
    return paths if paths and warms and all(initial_temperature(run) is not None for run in runs) else []


def first_samples(run: BenchRun) -> int:
    """Samples at the beginning of a record that tell how warm it begins: three cycles, a quarter of the motion at most.

    In a record that begins in motion they follow those in which a law settles.
    """
    moving = moving_samples(run)
    begin = moving.start or settling_samples(run, 1.0 / run.sampling_rate)
    count = min(FIRST_CYCLES / run.frequency * run.sampling_rate, FIRST_SHARE * (moving.stop - moving.start))
    return begin + int(np.ceil(count))


def warmed(model: Model, run: BenchRun, paths: Sequence[str], noise: float, initial_state: str) -> Warmed:
    """The model with the temperature at the start of a record that its first cycles show.

    It is the most likely one, 20 K about that of the model known beforehand, by Gauss and Newton's method with steps
    that make it likelier. Without an effect on the force it stays where it is.

    `model` has the mean start of the fitted records; `paths` are the starts [K] in it, which all move together; `noise`
    is the standard deviation of the force [N] about the model.
    """
    told = first_samples(run)
    (batch,), (at,) = batches(model, [run], [1.0], COMPARED_PER_CYCLE, (), initial_state)
    weight = np.array(batch.weight)
    weight[:, at.start + told // at.block :] = 0.0
    batch = dataclasses.replace(batch, weight=jnp.asarray(weight))
    begin = {path: jnp.asarray(get(model, path), float) for path in paths}
    shift = float(_shift(batch, model, begin, jnp.asarray(noise)))
    return Warmed(with_values(model, {path: value + shift for path, value in begin.items()}), told)


class _Tried(NamedTuple):
    """The best shift [K] so far, with the sum of squares there, Newton's step and the share of it that is tried."""

    shift: Scalar
    squares: Scalar
    step: Scalar
    share: Scalar
    rounds: Scalar


@compiled_for_loops
def _shift(batch: Batch, model: Model, begin: dict[str, Array], noise: Scalar) -> Scalar:
    def missed(shift: Scalar) -> Float[Array, " samples"]:
        values = {path: jnp.broadcast_to(value + shift, batch.dt.shape) for path, value in begin.items()}
        return dataclasses.replace(batch, fixed=batch.fixed | values)(model) / noise

    def at(shift: Scalar) -> tuple[Scalar, Scalar]:
        residual, slope = jax.jvp(missed, (shift,), (jnp.ones_like(shift),))
        gain = jnp.sum(slope**2) + 1.0 / UNKNOWN**2
        return jnp.sum(residual**2) + (shift / UNKNOWN) ** 2, -(jnp.sum(slope * residual) + shift / UNKNOWN**2) / gain

    def tried(best: _Tried) -> _Tried:
        shift = best.shift + best.share * best.step
        squares, step = at(shift)
        better = squares < best.squares  # never where the force is not finite
        as_far = step * best.step > 0.5 * best.step**2  # the force falls exponentially: many steps of one length
        wider = jnp.where(as_far, WIDER * best.share, jnp.minimum(WIDER * best.share, 1.0))
        rounds = best.rounds + 1
        refused = best._replace(share=best.share / NARROWER, rounds=rounds)
        accepted = _Tried(shift, squares, step, wider, rounds)
        return jax.tree.map(lambda new, old: jnp.where(better, new, old), accepted, refused)

    def goes_on(best: _Tried) -> Array:
        return (best.rounds < ROUNDS) & (jnp.abs(best.share * best.step) > SETTLED)

    zero = jnp.zeros_like(noise)
    begun = _Tried(zero, *at(zero), jnp.ones_like(noise), jnp.zeros((), int))
    return jax.lax.while_loop(goes_on, tried, begun).shift
