"""Bench records as batches of equal length, ready for one compiled call."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple, final
from weakref import WeakKeyDictionary

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxdamp import _checks
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import command_paths, require_finite_force, takes_command, with_command, without_fitted_ranges
from jaxdamp.identify.model import Model, blind_end, effects_of, is_memoryless, law_of, marched, rig_of
from jaxdamp.identify.problem import AbstractResiduals
from jaxdamp.parameters import get, with_values


STEP_ANGLE = 0.06  # rad of the dominant frequency per step: keeps the error of a law's step near 1e-4
MOST_GROUPS = 2  # batches of a law with states: each is compiled on its own
PREDICTED_PER_CYCLE = 1000  # samples at which a law with states is evaluated; straight lines between them: error 5e-6


@final
class Batch(AbstractResiduals):
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
    effects: tuple[str, ...] = eqx.field(static=True, default=())  # of the machine (`Rig.effects`)

    def predict(self, model: Model) -> Float[Array, "runs time"]:
        """Force of the model under these strokes [N]."""

        def one(dt: Array, x: Array, v: Array, temperature: Array | None, values: dict[str, Array]) -> Array:
            return marched(with_values(model, values), self.effects, dt, x, v, temperature, self.substeps)

        own = {path: get(model, path)[self.number] for path in self.per_record}
        return jax.vmap(one)(self.dt, self.stroke, self.velocity, self.temperature, self.fixed | own)

    def __call__(self, model: Model) -> Float[Array, " samples"]:
        """Weighted difference of the model's force from the measured one; zero where the weight is, even beside NaN."""
        return jnp.ravel(jnp.where(self.weight > 0, (self.predict(model) - self.force) * self.weight, 0.0))

    def reweighted(self, factor: Float[np.ndarray, " samples"]) -> "Batch":
        """The same with every weight times a factor."""
        return dataclasses.replace(self, weight=self.weight * jnp.asarray(factor.reshape(self.weight.shape)))

    def used(self) -> Bool[np.ndarray, " samples"]:
        """Which samples count."""
        return np.ravel(self.weight) > 0

    def total_weight(self) -> Float[Array, ""]:
        """Sum of the squared weights."""
        return jnp.sum(jnp.square(self.weight))


class SampleRange(NamedTuple):
    """Where a record is: samples `start` to `stop` of a row of a batch, each the mean of `block` measured ones."""

    batch: int
    row: int
    start: int
    stop: int
    block: int


class _Row(NamedTuple):
    """A record made ready for a model with memory."""

    dt: float
    signals: list[np.ndarray]  # stroke, velocity, force, and the temperature if it is used
    weight: np.ndarray
    number: int
    warm_up: int
    block: int
    substeps: int


def _round_up(count: int) -> int:
    """The next of 2ᵏ and 1.5·2ᵏ: few distinct lengths mean few compilations."""
    power = 1 << max(count - 1, 1).bit_length()
    return 3 * power // 4 if count <= 3 * power // 4 else power


def _pad(values: np.ndarray, length: int, mode: str = "edge") -> np.ndarray:
    return np.pad(values, (0, length - len(values)), mode=mode)  # type: ignore[call-overload]


def _averaged(values: np.ndarray, block: int) -> np.ndarray:
    """Means of successive blocks, the remainder dropped."""
    kept = len(values) // block * block
    return values[:kept].reshape(-1, block).mean(axis=1)


_rates: WeakKeyDictionary[BenchRun, float] = WeakKeyDictionary()  # records do not change


def dominant_rate(run: BenchRun) -> float:
    """Dominant angular frequency of a record [rad/s]: RMS velocity over RMS stroke, or its frequency if higher."""
    if run not in _rates:
        moved = float(np.std(run.stroke))
        _rates[run] = max(2 * np.pi * run.frequency, float(np.std(run.velocity)) / moved)
    return _rates[run]


def settling_time(run: BenchRun) -> float:
    """Settling time [s] at the start of a record, half a cycle, after which the initial states no longer matter."""
    return min(np.pi / dominant_rate(run), 0.25 * run.duration)


def _with_warm_up(run: BenchRun, count: int, channels: Sequence[str]) -> list[np.ndarray]:
    """Channels, preceded by a copy of the first cycle with a continuous stroke."""
    period = min(2 * np.pi / dominant_rate(run), run.duration)
    since = run.time - run.time[0]
    instants = period + np.arange(-count, 0) / run.sampling_rate
    stroke, velocity = (np.interp(instants, since, values) for values in (run.stroke, run.velocity))
    stroke = stroke + run.stroke[0] - np.interp(period, since, run.stroke)
    before = {"stroke": stroke, "velocity": velocity, "force": np.zeros(count)}
    if "temperature" in channels and run.temperature is not None:
        before["temperature"] = np.full(count, run.temperature[0])
    return [np.concatenate([before[channel], getattr(run, channel)]) for channel in channels]


def _block(run: BenchRun, samples_per_cycle: int | None) -> int:
    """How many samples of a record are averaged."""
    cycle = 2 * np.pi * run.sampling_rate / dominant_rate(run)
    return 1 if samples_per_cycle is None else max(int(cycle / samples_per_cycle), 1)


def _row(
    run: BenchRun,
    sigma: float,
    samples_per_cycle: int | None,
    model: Model,
    warms_up: bool,
    channels: Sequence[str],
    number: int,
) -> _Row:
    dt, omega = 1.0 / run.sampling_rate, dominant_rate(run)
    block = _block(run, samples_per_cycle)
    substeps = int(np.clip(np.ceil(omega * dt * block / STEP_ANGLE), 1, 8))
    warm_up = int(min(2 * np.pi / omega, run.duration) / (dt * block)) if warms_up else 0
    signals = [_averaged(values, block) for values in _with_warm_up(run, warm_up * block, channels)]
    weight = np.full(len(signals[0]), np.sqrt(block) / sigma)
    weight[len(weight) - blind_end(model, dt * block) :] = 0.0
    if warms_up:
        weight[: warm_up + int(np.ceil(settling_time(run) / (dt * block)))] = 0.0
    return _Row(dt * block, signals, weight, number, warm_up, block, substeps)


def _grouped(rows: Sequence[_Row]) -> list[list[int]]:
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
    rows: Sequence[_Row],
    fixed: Mapping[str, Sequence[float]],
    per_record: tuple[str, ...],
    effects: tuple[str, ...],
) -> Batch:
    length = _round_up(max(len(row.weight) for row in rows))
    signals = zip(*(row.signals for row in rows), strict=True)
    columns = [_on_device(np.stack([_pad(values, length) for values in channel])) for channel in signals]
    stroke, velocity, force, *temperature = columns
    weight = np.stack([_pad(row.weight, length, "constant") for row in rows])
    number = np.array([row.number for row in rows])
    dt, substeps = np.array([row.dt for row in rows]), max(row.substeps for row in rows)
    own = {path: _on_device(np.array(values, float)[number]) for path, values in fixed.items()}
    arrays = (_on_device(dt), stroke, velocity, force, _on_device(weight), _on_device(number))
    return Batch(*arrays, own, per_record, substeps, temperature[0] if temperature else None, effects)


def _memoryless_batch(
    runs: Sequence[BenchRun], sigma: Sequence[float], samples_per_cycle: int | None, channels: Sequence[str]
) -> tuple[tuple[Batch, ...], list[SampleRange]]:
    blocks = [_block(run, samples_per_cycle) for run in runs]
    counts = [len(run) // block for run, block in zip(runs, blocks, strict=True)]
    ends = np.cumsum(counts)
    length = _round_up(int(ends[-1]))
    columns = [
        _pad(np.concatenate([_averaged(getattr(r, name), b) for r, b in zip(runs, blocks, strict=True)]), length)[None]
        for name in channels
    ]
    weight = np.repeat(np.sqrt(blocks) / np.asarray(sigma), counts)
    arrays = (np.ones(1), *columns[:3], _pad(weight, length, "constant")[None], np.zeros(1, int))
    temperature = _on_device(columns[3]) if len(columns) > 3 else None
    ranges = [SampleRange(0, 0, int(end) - n, int(end), b) for end, n, b in zip(ends, counts, blocks, strict=True)]
    return (Batch(*map(_on_device, arrays), fixed={}, per_record=(), substeps=1, temperature=temperature),), ranges


def _on_device(array: np.ndarray) -> Array:
    """With a type stated, an array is copied; without one JAX compiles a program for that."""
    return jnp.asarray(array, float if array.dtype.kind == "f" else int)


def _stated(model: Model, runs: Sequence[BenchRun]) -> dict[str, list[float]]:
    """Values that the records state for the law, by path: the command, if the law has one."""
    commands, law = [run.command for run in runs if run.command is not None], law_of(model)
    if not takes_command(law) or not commands:
        return {}
    remedy = 'Pass it when reading, `bench.read(..., command={"*_0.5A": 0.5})`.'
    _refuse_some("command", runs, remedy)
    for command in set(commands):
        with_command(law, command)  # refuses what is out of range
    return dict.fromkeys(command_paths(model), commands)


def _refuse_some(what: str, runs: Sequence[BenchRun], remedy: str) -> None:
    """Refuse records of which some state what others do not."""
    lacking = [run.name for run in runs if getattr(run, what) is None]
    if lacking:
        _checks.refuse("runs", f"all state their {what}", f"without one: {', '.join(lacking)}", remedy)


def _channels(model: Model, runs: Sequence[BenchRun]) -> list[str]:
    """The channels that a model is compared with, the temperature among them if it says something of the force."""
    channels, rig = ["stroke", "velocity", "force"], rig_of(model)
    of_rig = rig is not None and (np.any(rig.temperature_slope) or np.any(rig.gas_temperature_slope))
    if not (of_rig or law_of(model).traits().temperature_dependent):
        return channels
    if all(run.temperature is None for run in runs):
        return channels
    _refuse_some("temperature", runs, "Fit those with and those without it apart.")
    return [*channels, "temperature"]


def batches(
    model: Model,
    runs: Sequence[BenchRun],
    sigma: Sequence[float],
    samples_per_cycle: int | None,
    per_record: tuple[str, ...] = (),
) -> tuple[tuple[Batch, ...], list[SampleRange]]:
    """Prepare records for a model.

    If a record has more than `samples_per_cycle`, blocks of samples are averaged and weighted by the root of their
    number. For a model without memory all records are in one batch. For a law with states, or a rig with delay, lag,
    heat or moving mass, every record is preceded by a copy of its first cycle, during which the states go from rest to
    those of the steady motion; the copy and the first half cycle of the record get weight zero.

    Arguments:
        model: the law, on a rig or not; only its memory and what it takes from the records matter.
        runs: the records.
        sigma: standard deviation [N] of the force for each record.
        samples_per_cycle: see above; `None` takes every sample.
        per_record: paths where the model that the batches are given has a value for each record.

    Returns:
        The batches, and for each record where it is.
    """
    fixed, channels, warms_up = _stated(model, runs), _channels(model, runs), not is_memoryless(model)
    if not (warms_up or fixed or per_record):
        return _memoryless_batch(runs, sigma, samples_per_cycle, channels)
    rows, groups, made = _row_batches(model, runs, sigma, samples_per_cycle, per_record)
    ranges: dict[int, SampleRange] = {}
    for number, group in enumerate(groups):
        for k, i in enumerate(group):
            ranges[i] = SampleRange(number, k, rows[i].warm_up, len(rows[i].weight), rows[i].block)
    return made, [ranges[i] for i in range(len(runs))]


def record_batches(
    model: Model, runs: Sequence[BenchRun], sigma: Sequence[float], samples_per_cycle: int | None
) -> tuple[Batch, ...]:
    """Records prepared as in `batches`, but always with a row for each record, also for a model without memory."""
    return _row_batches(model, runs, sigma, samples_per_cycle, ())[2]


def _row_batches(
    model: Model,
    runs: Sequence[BenchRun],
    sigma: Sequence[float],
    samples_per_cycle: int | None,
    per_record: tuple[str, ...],
) -> tuple[list[_Row], list[list[int]], tuple[Batch, ...]]:
    """A row for each record, the groups of rows, and the batch of each group."""
    how = (samples_per_cycle, model, not is_memoryless(model), _channels(model, runs))
    rows = [_row(run, s, *how, number) for number, (run, s) in enumerate(zip(runs, sigma, strict=True))]
    groups, fixed = _grouped(rows), _stated(model, runs)
    return rows, groups, tuple(_batch([rows[i] for i in g], fixed, per_record, effects_of(model)) for g in groups)


def owners(made: Sequence[Batch], ranges: Sequence[SampleRange]) -> Int[np.ndarray, " samples"]:
    """The number of the record that each sample of the residuals belongs to."""
    numbers = [np.zeros(batch.weight.shape, dtype=int) for batch in made]
    for i, at in enumerate(ranges):
        numbers[at.batch][at.row, at.start : at.stop] = i
    return np.concatenate([np.ravel(a) for a in numbers])


@eqx.filter_jit
def _predict(batch: Batch, model: Model) -> Array:
    return batch.predict(model)


def _spread(values: np.ndarray, block: int, count: int) -> np.ndarray:
    """Values at every sample from the means of blocks, by straight lines between the centres and beyond the ends."""
    if block == 1:
        return values
    places = (np.arange(count) - 0.5 * (block - 1)) / block
    left = np.clip(np.floor(places).astype(int), 0, len(values) - 2)
    return values[left] + (places - left) * (values[left + 1] - values[left])


def predict_runs(model: Model, runs: Sequence[BenchRun]) -> list[np.ndarray]:
    """Force [N] of the model at every sample of every record, states settled by a copy of its first cycle.

    Arguments:
        model: a law, or a law on a test machine.
        runs: the records, whose motion is prescribed.
    """
    model = without_fitted_ranges(model)
    memoryless = is_memoryless(model)
    made, ranges = batches(model, runs, [1.0] * len(runs), None if memoryless else PREDICTED_PER_CYCLE)
    forces = [np.asarray(_predict(batch, model)) for batch in made]
    spread = [
        _spread(forces[p.batch][p.row, p.start : p.stop], p.block, len(run))
        for p, run in zip(ranges, runs, strict=True)
    ]
    for run, force in zip(runs, spread, strict=True):
        require_finite_force(
            law_of(model), force[used_samples(model, run, memoryless)], f"over the record {run.name!r}"
        )
    return spread


def predict_by_record(model: Model | Sequence[Model], runs: Sequence[BenchRun]) -> tuple[list[Model], list[np.ndarray]]:
    """The model of each record and its force [N] there, of one model for all records or of one for each."""
    if isinstance(model, Sequence):
        return list(model), [predict_runs(own, [run])[0] for own, run in zip(model, runs, strict=True)]
    return [model] * len(runs), predict_runs(model, runs)


def used_samples(model: Model, run: BenchRun, memoryless: bool) -> slice:
    """The samples of a record that a fit of this model uses: all, or those from settling to a blind end."""
    if memoryless:
        return slice(0, None)
    block = _block(run, PREDICTED_PER_CYCLE)
    blind = blind_end(model, block / run.sampling_rate) * block
    return slice(int(np.ceil(settling_time(run) * run.sampling_rate)), len(run) - blind)
