"""Bench records as batches of equal length, ready for one compiled call."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxdamp import _checks
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import (
    AbstractDamper,
    command_paths,
    require_finite_force,
    takes_command,
    with_command,
    without_fitted_ranges,
)
from jaxdamp.identify.problem import AbstractResiduals
from jaxdamp.parameters import get, with_values
from jaxdamp.rig import march


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

    def predict(self, law: AbstractDamper) -> Float[Array, "runs time"]:
        """Force of the law under these strokes [N]."""

        def one(dt: Array, x: Array, v: Array, values: dict[str, Array]) -> Array:
            return march(with_values(law, values), dt, x, v, self.substeps)

        own = {path: get(law, path)[self.number] for path in self.per_record}
        return jax.vmap(one)(self.dt, self.stroke, self.velocity, self.fixed | own)

    def __call__(self, model: AbstractDamper) -> Float[Array, " samples"]:
        """Weighted difference of the law's force from the measured one; zero where the weight is, even beside NaN."""
        return jnp.ravel(jnp.where(self.weight > 0, (self.predict(model) - self.force) * self.weight, 0.0))

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
    """A record made ready for a law with states."""

    dt: float
    signals: tuple[np.ndarray, np.ndarray, np.ndarray]  # stroke, velocity, force
    weight: np.ndarray
    number: int
    warm_up: int
    block: int
    substeps: int


def is_memoryless(law: AbstractDamper) -> bool:
    """Whether the law has no states."""
    return jax.eval_shape(law.initial_state).size == 0


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


def dominant_rate(run: BenchRun) -> float:
    """Dominant angular frequency of a record [rad/s]: RMS velocity over RMS stroke, or its frequency if higher."""
    moved = float(np.std(run.stroke))
    return max(2 * np.pi * run.frequency, float(np.std(run.velocity)) / moved)


def settling_time(run: BenchRun) -> float:
    """Settling time [s] at the start of a record, half a cycle, after which the initial states no longer matter."""
    return min(np.pi / dominant_rate(run), 0.25 * run.duration)


def _with_warm_up(run: BenchRun, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stroke, velocity and force, preceded by a copy of the first cycle with a continuous stroke."""
    period = min(2 * np.pi / dominant_rate(run), run.duration)
    since = run.time - run.time[0]
    instants = period + np.arange(-count, 0) / run.sampling_rate
    stroke, velocity = (np.interp(instants, since, values) for values in (run.stroke, run.velocity))
    stroke = stroke + run.stroke[0] - np.interp(period, since, run.stroke)
    before = (stroke, velocity, np.zeros(count))
    after = (run.stroke, run.velocity, run.force)
    return tuple(np.concatenate(pair) for pair in zip(before, after, strict=True))  # type: ignore[return-value]


def _block(run: BenchRun, samples_per_cycle: int | None) -> int:
    """How many samples of a record are averaged."""
    cycle = 2 * np.pi * run.sampling_rate / dominant_rate(run)
    return 1 if samples_per_cycle is None else max(int(cycle / samples_per_cycle), 1)


def _row(run: BenchRun, sigma: float, samples_per_cycle: int | None, warms_up: bool, number: int) -> _Row:
    dt, omega = 1.0 / run.sampling_rate, dominant_rate(run)
    block = _block(run, samples_per_cycle)
    substeps = int(np.clip(np.ceil(omega * dt * block / STEP_ANGLE), 1, 8))
    warm_up = int(min(2 * np.pi / omega, run.duration) / (dt * block)) if warms_up else 0
    stroke, velocity, force = (_averaged(values, block) for values in _with_warm_up(run, warm_up * block))
    weight = np.full(len(force), np.sqrt(block) / sigma)
    if warms_up:
        weight[: warm_up + int(np.ceil(settling_time(run) / (dt * block)))] = 0.0
    return _Row(dt * block, (stroke, velocity, force), weight, number, warm_up, block, substeps)


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


def _batch(rows: Sequence[_Row], fixed: Mapping[str, Sequence[float]], per_record: tuple[str, ...]) -> Batch:
    length = _round_up(max(len(row.weight) for row in rows))
    columns = [np.stack([_pad(row.signals[k], length) for row in rows]) for k in range(3)]
    weight = np.stack([_pad(row.weight, length, "constant") for row in rows])
    number = np.array([row.number for row in rows])
    arrays = map(_on_device, (np.array([row.dt for row in rows]), *columns, weight, number))
    own = {path: _on_device(np.array(values, float)[number]) for path, values in fixed.items()}
    return Batch(*arrays, fixed=own, per_record=per_record, substeps=max(row.substeps for row in rows))


def _memoryless_batch(
    runs: Sequence[BenchRun], sigma: Sequence[float], samples_per_cycle: int | None
) -> tuple[tuple[Batch, ...], list[SampleRange]]:
    blocks = [_block(run, samples_per_cycle) for run in runs]
    counts = [len(run) // block for run, block in zip(runs, blocks, strict=True)]
    ends = np.cumsum(counts)
    length = _round_up(int(ends[-1]))
    stroke, velocity, force = (
        _pad(np.concatenate([_averaged(getattr(r, name), b) for r, b in zip(runs, blocks, strict=True)]), length)[None]
        for name in ("stroke", "velocity", "force")
    )
    weight = np.repeat(np.sqrt(blocks) / np.asarray(sigma), counts)
    arrays = (np.ones(1), stroke, velocity, force, _pad(weight, length, "constant")[None], np.zeros(1, int))
    ranges = [SampleRange(0, 0, int(end) - n, int(end), b) for end, n, b in zip(ends, counts, blocks, strict=True)]
    return (Batch(*map(_on_device, arrays), fixed={}, per_record=(), substeps=1),), ranges


def _on_device(array: np.ndarray) -> Array:
    """With a type stated, an array is copied; without one JAX compiles a program for that."""
    return jnp.asarray(array, float if array.dtype.kind == "f" else int)


def _stated(law: AbstractDamper, runs: Sequence[BenchRun]) -> dict[str, list[float]]:
    """Values that the records state for the law, by path: the command, if the law has one."""
    commands = [run.command for run in runs if run.command is not None]
    if not takes_command(law) or not commands:
        return {}
    lacking = [run.name for run in runs if run.command is None]
    if lacking:
        must, remedy = "all state their command", 'Pass it when reading, `bench.read(..., command={"*_0.5A": 0.5})`.'
        _checks.refuse("runs", must, f"without one: {', '.join(lacking)}", remedy)
    for command in set(commands):
        with_command(law, command)  # refuses what is out of range
    return dict.fromkeys(command_paths(law), commands)


def batches(
    law: AbstractDamper,
    runs: Sequence[BenchRun],
    sigma: Sequence[float],
    samples_per_cycle: int | None,
    per_record: tuple[str, ...] = (),
) -> tuple[tuple[Batch, ...], list[SampleRange]]:
    """Prepare records for a law.

    If a record has more than `samples_per_cycle`, blocks of samples are averaged and weighted by the root of their
    number. For a law without states all records are in one batch. For a law with states every record is preceded by a
    copy of its first cycle, during which the states go from rest to those of the steady motion; the copy and the first
    half cycle of the record get weight zero.

    Arguments:
        law: the law; only its states and its command matter.
        runs: the records.
        sigma: standard deviation [N] of the force for each record.
        samples_per_cycle: see above; `None` takes every sample.
        per_record: paths where the law that the batches are given has a value for each record.

    Returns:
        The batches, and for each record where it is.
    """
    fixed, warms_up = _stated(law, runs), not is_memoryless(law)
    if not (warms_up or fixed or per_record):
        return _memoryless_batch(runs, sigma, samples_per_cycle)
    pairs = zip(runs, sigma, strict=True)
    rows = [_row(run, s, samples_per_cycle, warms_up, number) for number, (run, s) in enumerate(pairs)]
    groups = _grouped(rows)
    ranges: dict[int, SampleRange] = {}
    for number, group in enumerate(groups):
        for k, i in enumerate(group):
            ranges[i] = SampleRange(number, k, rows[i].warm_up, len(rows[i].weight), rows[i].block)
    made = tuple(_batch([rows[i] for i in group], fixed, per_record) for group in groups)
    return made, [ranges[i] for i in range(len(runs))]


def owners(made: Sequence[Batch], ranges: Sequence[SampleRange]) -> Int[np.ndarray, " samples"]:
    """The number of the record that each sample of the residuals belongs to."""
    numbers = [np.zeros(batch.weight.shape, dtype=int) for batch in made]
    for i, at in enumerate(ranges):
        numbers[at.batch][at.row, at.start : at.stop] = i
    return np.concatenate([np.ravel(a) for a in numbers])


@eqx.filter_jit
def _predict(batch: Batch, law: AbstractDamper) -> Array:
    return batch.predict(law)


def _spread(values: np.ndarray, block: int, count: int) -> np.ndarray:
    """Values at every sample from the means of blocks, by straight lines between the centres and beyond the ends."""
    if block == 1:
        return values
    places = (np.arange(count) - 0.5 * (block - 1)) / block
    left = np.clip(np.floor(places).astype(int), 0, len(values) - 2)
    return values[left] + (places - left) * (values[left + 1] - values[left])


def predict_runs(law: AbstractDamper, runs: Sequence[BenchRun]) -> list[np.ndarray]:
    """Force [N] of the law at every sample of every record."""
    law = without_fitted_ranges(law)
    made, ranges = batches(law, runs, [1.0] * len(runs), None if is_memoryless(law) else PREDICTED_PER_CYCLE)
    forces = [np.asarray(_predict(batch, law)) for batch in made]
    spread = [
        _spread(forces[p.batch][p.row, p.start : p.stop], p.block, len(run))
        for p, run in zip(ranges, runs, strict=True)
    ]
    for run, force in zip(runs, spread, strict=True):
        require_finite_force(law, force[used_samples(law, run)], f"over the record {run.name!r}")
    return spread


def predict_by_record(
    law: AbstractDamper | Sequence[AbstractDamper], runs: Sequence[BenchRun]
) -> tuple[list[AbstractDamper], list[np.ndarray]]:
    """The law of each record and its force [N] there, of one law for all records or of one for each."""
    if isinstance(law, AbstractDamper):
        return [law] * len(runs), predict_runs(law, runs)
    return list(law), [predict_runs(own, [run])[0] for own, run in zip(law, runs, strict=True)]


def used_samples(law: AbstractDamper, run: BenchRun) -> slice:
    """The samples of a record that a fit of this law uses: all, or those after settling."""
    return slice(0 if is_memoryless(law) else int(np.ceil(settling_time(run) * run.sampling_rate)), None)
