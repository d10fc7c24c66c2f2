"""How warm a new record begins: by the force of its first cycles, where every fitted record had its own value."""

import dataclasses
from collections.abc import Collection, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._quickly import compiled_for_loops
from jaxdamp._types import Scalar
from jaxdamp.bench import BenchRun, initial_temperature
from jaxdamp.identify.initial_states import moving_samples
from jaxdamp.identify.model import Model, law_of
from jaxdamp.identify.rows import settling_samples
from jaxdamp.identify.stated import start_paths
from jaxdamp.identify.traces import Batch, batches
from jaxdamp.parameters import get, with_values


FIRST_CYCLES = 3.0  # of a record that tell how warm it begins
FIRST_SHARE = 0.25  # of its motion at most
UNKNOWN = 20.0  # K, standard deviation of a new record's temperature about the mean of the fitted ones
SAMPLES_PER_CYCLE = 200  # that are compared
ROUNDS = 8  # of Newton's method


class Warmed(NamedTuple):
    """A model made for a new record, and how many of its first samples told the temperature, which are not scored."""

    model: Model
    told: int


def unknown_starts(model: Model, runs: Sequence[BenchRun], per_record: Collection[str]) -> list[str]:
    """Paths of the starts that a new record needs, where each of the fitted records had one of its own; else none."""
    paths = start_paths(model)
    if own := [path for path in paths if path in per_record]:
        return own
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

    It is the most likely one, 20 K about that of the model known beforehand, by Gauss and Newton's method. Without an
    effect on the force it stays where it is.

    `model` has the mean start of the fitted records; `paths` are the starts [K] in it, which all move together; `noise`
    is the standard deviation of the force [N] about the model.
    """
    told = first_samples(run)
    (batch,), (at,) = batches(model, [run], [1.0], SAMPLES_PER_CYCLE, (), initial_state)
    weight = np.array(batch.weight)
    weight[:, at.start + told // at.block :] = 0.0
    batch = dataclasses.replace(batch, weight=jnp.asarray(weight))
    begin = {path: jnp.asarray(get(model, path), float) for path in paths}
    shift = float(_shift(batch, model, begin, jnp.asarray(noise)))
    return Warmed(with_values(model, {path: value + shift for path, value in begin.items()}), told)


@compiled_for_loops
def _shift(batch: Batch, model: Model, begin: dict[str, Array], noise: Scalar) -> Scalar:
    def missed(shift: Scalar) -> Float[Array, " samples"]:
        own = {path: jnp.broadcast_to(value + shift, batch.dt.shape) for path, value in begin.items()}
        return dataclasses.replace(batch, fixed=batch.fixed | own)(model) / noise

    def step(shift: Scalar, _: None) -> tuple[Scalar, None]:
        residual, slope = jax.jvp(missed, (shift,), (jnp.ones_like(shift),))
        gain = jnp.sum(slope**2) + 1.0 / UNKNOWN**2
        return shift - (jnp.sum(slope * residual) + shift / UNKNOWN**2) / gain, None

    return jax.lax.scan(step, jnp.zeros_like(noise), None, ROUNDS)[0]
