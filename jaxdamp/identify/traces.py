"""Bench records as batches of equal length, ready for one compiled call."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jaxdamp.bench import BenchRun
from jaxdamp.identify.initial_states import Cycle
from jaxdamp.identify.model import (
    Model,
    can_rest,
    effects_of,
    initial_state,
    law_of,
    marched,
    starts_in,
)
from jaxdamp.identify.residuals import AbstractResiduals, AbstractWeighted
from jaxdamp.identify.rows import (
    LAG_ANGLE,
    Row,
    averaged,
    channel,
    cycles_of,
    on_device,
    resting_blocks,
    row_of,
    samples_in_block,
)
from jaxdamp.identify.stated import followed_channels, stated_values
from jaxdamp.parameters import get, with_values
from jaxdamp.rig import Followed


MOST_GROUPS = 2  # batches of a law with states: each is compiled on its own


@final
class Batch(AbstractWeighted):
    """Records side by side, padded to one length; padded and unused samples have weight zero."""

    dt: Float[Array, " runs"]
    stroke: Float[Array, "runs time"]
    velocity: Float[Array, "runs time"]
    force: Float[Array, "runs time"]
    weight: Float[Array, "runs time"]
    number: Int[Array, " runs"]  # of each record among those given
    fixed: dict[str, Float[Array, " runs"]]  # values of the law that each record states, by path, such as its command
    per_record: tuple[str, ...] = eqx.field(static=True)  # paths where the law has a value for each record
    substeps: int = eqx.field(static=True)
    temperature: Float[Array, "runs time"] | None = None  # where the model takes it from the records
    command: Float[Array, "runs time"] | None = None  # where it varies in one of them
    cycle: Cycle | None = None  # before each record, where some start in the periodic solution
    effects: tuple[str, ...] = eqx.field(static=True, default=())  # of the machine (`Rig.effects`)

    def settled_forces(self, model: Model) -> tuple[Float[Array, "runs time"], Float[Array, " runs"]]:
        """The forces [N], and the change of the states over the cycle before a record that starts periodically."""

        def one(
            dt: Array,
            x: Array,
            v: Array,
            followed: Followed,
            cycle: Cycle | None,
            state: Array | None,
            values: dict[str, Array],
        ) -> tuple[Array, Array]:
            model_of_record, change = with_values(model, values), jnp.zeros(())
            if cycle is not None:
                state, change = initial_state(model_of_record, self.effects, x[0], cycle, followed)
            return marched(model_of_record, self.effects, dt, x, v, followed, self.substeps, state), change

        starts = [start.initial_state for start in starts_in(model) if start is not None]
        estimated = jnp.stack(starts)[self.number] if starts else None
        motion = (self.dt, self.stroke, self.velocity, self.followed, self.cycle, estimated)
        return jax.vmap(one)(*motion, self.own_values(model))

    @property
    def followed(self) -> Followed:
        """What the law follows beside the motion."""
        return Followed(self.temperature, self.command)

    def own_values(self, model: Model) -> dict[str, Array]:
        """The values that differ from record to record, by path."""
        return self.fixed | {path: get(model, path)[self.number] for path in self.per_record}

    def __call__(self, model: Model) -> Float[Array, " samples"]:
        """Weighted difference of the model's force from the measured one; zero where the weight is, even beside NaN."""
        missed = self.settled_forces(model)[0] - self.force
        return jnp.ravel(jnp.where(self.weight > 0, missed * self.weight, 0.0))

    def measurements(self) -> Float[Array, " samples"]:
        """The measured forces [N] of all samples, padding too."""
        return jnp.ravel(self.force)

    def with_measurements(self, numbers: Float[Array, " samples"]) -> "Batch":
        """The same with other measured forces."""
        return dataclasses.replace(self, force=numbers.reshape(self.force.shape))


class SampleRange(NamedTuple):
    """Where a record is: samples `start` to `stop` of a row of a batch, each the mean of `block` measured ones."""

    batch: int
    row: int
    start: int
    stop: int
    block: int


def _round_up(count: int) -> int:
    """The next of 2ᵏ and 1.5·2ᵏ: few distinct lengths mean few compilations."""
    power = 1 << max(count - 1, 1).bit_length()
    return 3 * power // 4 if count <= 3 * power // 4 else power


def _pad(values: np.ndarray, length: int, mode: str = "edge") -> np.ndarray:
    return np.pad(values, (0, length - len(values)), mode=mode)  # type: ignore[call-overload]


def _grouped(rows: Sequence[Row]) -> list[list[int]]:
    """Groups of rows that are computed in one loop, with little padding and few loops to compile.

    All records of a group take the steps of the longest. A step costs about as much as 16 records in parallel.
    """

    def cost(group: list[int]) -> int:
        steps = max(len(rows[i].weight) for i in group) * max(rows[i].substeps for i in group)
        return steps * (16 + len(group))

    alike: dict[tuple[int, int], list[int]] = {}
    for i, row in enumerate(rows):
        alike.setdefault((_round_up(len(row.weight)), row.substeps), []).append(i)
    groups = list(alike.values())

    while len(groups) > MOST_GROUPS:
        pairs = [(a, b) for a in range(len(groups)) for b in range(a)]
        a, b = min(pairs, key=lambda p: cost(groups[p[0]] + groups[p[1]]) - cost(groups[p[0]]) - cost(groups[p[1]]))
        groups[b] = groups[b] + groups.pop(a)
    return groups


def _batch(
    rows: Sequence[Row],
    runs: Sequence[BenchRun],
    fixed: Mapping[str, Sequence[float]],
    per_record: tuple[str, ...],
    effects: tuple[str, ...],
    channels: Sequence[str],
) -> Batch:
    length = _round_up(max(len(row.weight) for row in rows))
    signals = zip(*(row.signals for row in rows), strict=True)
    columns = [on_device(np.stack([_pad(values, length) for values in channel])) for channel in signals]
    stroke, velocity, force, *others = columns
    weight = np.stack([_pad(row.weight, length, "constant") for row in rows])
    number = np.array([row.number for row in rows])
    dt, substeps = np.array([row.dt for row in rows]), max(row.substeps for row in rows)
    on_devices = {path: on_device(np.array(values, float)[number]) for path, values in fixed.items()}
    arrays = (on_device(dt), stroke, velocity, force, on_device(weight), on_device(number))
    followed = dict(zip(channels[3:], others, strict=True))
    return Batch(*arrays, on_devices, per_record, substeps, cycle=cycles_of(rows, runs), effects=effects, **followed)


def _memoryless_batch(
    runs: Sequence[BenchRun],
    sigma: Sequence[float],
    samples_per_cycle: int | None,
    channels: Sequence[str],
) -> tuple[tuple[Batch, ...], list[SampleRange]]:
    blocks = [samples_in_block(run, samples_per_cycle) for run in runs]
    counts = [len(run) // block for run, block in zip(runs, blocks, strict=True)]
    ends = np.cumsum(counts)
    length = _round_up(int(ends[-1]))
    columns = [
        _pad(np.concatenate([averaged(channel(r, name), b) for r, b in zip(runs, blocks, strict=True)]), length)[None]
        for name in channels
    ]
    weight = np.repeat(np.sqrt(blocks) / np.asarray(sigma), counts)
    weight[np.concatenate([resting_blocks(r, b) for r, b in zip(runs, blocks, strict=True)])] = 0.0
    arrays = (np.ones(1), *columns[:3], _pad(weight, length, "constant")[None], np.zeros(1, int))
    followed = dict(zip(channels[3:], map(on_device, columns[3:]), strict=True))
    ranges = [SampleRange(0, 0, int(end) - n, int(end), b) for end, n, b in zip(ends, counts, blocks, strict=True)]
    return (Batch(*map(on_device, arrays), fixed={}, per_record=(), substeps=1, **followed),), ranges


def batches(
    model: Model,
    runs: Sequence[BenchRun],
    sigma: Sequence[float],
    samples_per_cycle: int | None,
    per_record: tuple[str, ...] = (),
    initial_state: str = "warm_up",
) -> tuple[tuple[Batch, ...], list[SampleRange]]:
    """Prepare records for a model.

    If a record has more than `samples_per_cycle`, blocks of samples are averaged and weighted by the root of their
    number. For a model without memory all records are in one batch. For a law with states, or a rig with delay, lag,
    heat or moving mass, every record that begins in motion is preceded by a copy of its first cycle, which gets weight
    zero. During it the states go from rest to those of the steady motion, and the first half cycle of the record gets
    weight zero too, unless they start in the periodic solution. For a law that cannot rest, so do rest before and after
    the motion.

    Only the memory of the model and what it takes from the records matter. Each record has a standard deviation of the
    force [N], `sigma`; `per_record` are the paths where the model that the batches are given has a value for each.
    Returned are the batches, and for each record where it is.
    """
    (answer,) = batches_of_each(model, [runs], [sigma], samples_per_cycle, per_record, initial_state)
    return answer


def batches_of_each(
    model: Model,
    dampers: Sequence[Sequence[BenchRun]],
    sigma: Sequence[Sequence[float]],
    samples_per_cycle: int | None,
    per_record: tuple[str, ...],
    initial_state: str,
) -> list[tuple[tuple[Batch, ...], list[SampleRange]]]:
    """`batches` of the records of each damper, of which the model takes the same."""
    together = [run for runs in dampers for run in runs]
    fixed, channels = stated_values(model, together), followed_channels(model, together)
    rests, effects = can_rest(model), effects_of(model)
    if not (rests or effects or fixed or per_record):
        return [_memoryless_batch(*of, samples_per_cycle, channels) for of in zip(dampers, sigma, strict=True)]
    if not rests:
        initial_state = ("warm_up" if initial_state == "estimated" else initial_state) if effects else "rest"
    angle = min([law_of(model).traits().step_angle, *[LAG_ANGLE] * ("lag" in effects)])
    how, each, first = (samples_per_cycle, model, angle, rests, channels, initial_state), [], 0
    for runs, deviations in zip(dampers, sigma, strict=True):
        rows = [row_of(run, s, *how, number) for number, (run, s) in enumerate(zip(runs, deviations, strict=True))]
        groups, ranges = _grouped(rows), dict[int, SampleRange]()
        for number, group in enumerate(groups):
            for k, i in enumerate(group):
                ranges[i] = SampleRange(number, k, rows[i].warm_up, len(rows[i].weight), rows[i].block)
        of_damper = {path: values[first : first + len(runs)] for path, values in fixed.items()}
        members = [([rows[i] for i in group], [runs[i] for i in group]) for group in groups]
        made = tuple(_batch(*of, of_damper, per_record, effects, channels) for of in members)
        each.append((made, [ranges[i] for i in range(len(runs))]))
        first += len(runs)
    return each


def places(made: Sequence[Batch], ranges: Sequence[SampleRange]) -> tuple[slice, ...]:
    """Where the samples of each record are in the residuals of all batches."""
    begins = np.cumsum([0, *(batch.weight.size for batch in made)])
    rows = [int(begins[at.batch]) + at.row * made[at.batch].weight.shape[1] for at in ranges]
    return tuple(slice(row + at.start, row + at.stop) for row, at in zip(rows, ranges, strict=True))


def signals(residuals: Sequence[AbstractResiduals], *names: str) -> list[Float[np.ndarray, " samples"]]:
    """Channels or weights at the samples of all residuals of bench records."""
    made = [part for part in residuals if isinstance(part, Batch)]
    return [np.concatenate([np.ravel(np.asarray(getattr(batch, name))) for batch in made]) for name in names]
