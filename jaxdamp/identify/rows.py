"""A record made ready for a model: averaged in blocks, weighted, led in."""

from collections.abc import Callable, Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from jaxdamp import _checks
from jaxdamp.bench import BenchRun, white_noise
from jaxdamp.identify.initial_states import Cycle, moving_samples, repeated_motion, start_of
from jaxdamp.identify.model import Model, blind_end


LARGEST_TURN = 0.1  # of the peak velocity, by which it may change within an averaged block
LARGEST_NOISE = 5.0  # standard deviations: of the noise, in the block that it changes most
COARSEST = 0.48  # rad between samples, beyond which straight lines between them are the larger error
LAG_ANGLE = 0.02  # rad, largest step of a filter of the force, whose law bends between samples where a valve opens


class Row(NamedTuple):
    """A record made ready for a model with memory."""

    dt: float
    signals: list[np.ndarray]  # stroke, velocity, force, and temperature and command if they are used
    weight: np.ndarray
    number: int
    warm_up: int
    block: int
    substeps: int
    repeated: Callable[[np.ndarray], np.ndarray] | None = None  # stroke and velocity of a periodic record


def averaged(values: np.ndarray, block: int) -> np.ndarray:
    """Means of successive blocks, the remainder dropped."""
    count = len(values) // block * block
    return values[:count].reshape(-1, block).mean(axis=1)


_rates: WeakKeyDictionary[BenchRun, float] = WeakKeyDictionary()  # records do not change


def dominant_rate(run: BenchRun) -> float:
    """Dominant angular frequency of a record [rad/s]: RMS velocity over RMS stroke, or its frequency if higher."""
    if run not in _rates:
        moved = float(np.std(run.stroke))
        _rates[run] = max(2 * np.pi * run.frequency, float(np.std(run.velocity)) / moved)
    return _rates[run]


def refuse_units(runs: Sequence[BenchRun]) -> None:
    """Refuse commands in several units."""
    units = {run.command_unit for run in runs if run.command_channel is not None}
    if len(units) > 1:
        named = ", ".join(f"{run.name} in {run.command_unit or 'none'}" for run in runs if run.command_unit in units)
        _checks.refuse("runs", "have their commands in one unit", named, "Fit those with one unit.")


def settling_samples(run: BenchRun, dt: float) -> int:
    """Samples, `dt` [s] apart, of half a cycle at the start, after which the initial states no longer matter.

    A whole number of them stays one however it is rounded.
    """
    return int(np.ceil(min(np.pi / dominant_rate(run), 0.25 * run.duration) / dt - 1e-6))


def _with_warm_up(run: BenchRun, count: int, channels: Sequence[str]) -> list[np.ndarray]:
    """Channels, preceded by a copy of the first cycle with a continuous stroke."""
    period = min(2 * np.pi / dominant_rate(run), run.duration)
    since = run.time - run.time[0]
    instants = period + np.arange(-count, 0) / run.sampling_rate
    stroke, velocity = (np.interp(instants, since, values) for values in (run.stroke, run.velocity))
    stroke = stroke + run.stroke[0] - np.interp(period, since, run.stroke)
    before = {"stroke": stroke, "velocity": velocity, "force": np.zeros(count)}
    before |= {name: np.full(count, channel(run, name)[0]) for name in channels[3:]}
    return [np.concatenate([before[name], channel(run, name)]) for name in channels]


def channel(run: BenchRun, name: str) -> np.ndarray:
    """A channel of a record, the command at every sample among them."""
    return getattr(run, "commands" if name == "command" else name)


def samples_in_block(run: BenchRun, samples_per_cycle: int | None) -> int:
    """How many samples of a record are averaged; none where the command varies, which is faster than the motion.

    Fewer where the velocity turns within a block, as at the ends of a triangle: a mean force is not that of a mean
    velocity there. A block turns by what the means of its halves differ by, as along a straight line from its first
    sample to its last, beyond the noise of the velocity, which averaging makes smaller.
    """
    if run.command_channel is not None or samples_per_cycle is None:
        return 1
    block = max(int(2 * np.pi * run.sampling_rate / dominant_rate(run) / samples_per_cycle), 1)
    noise = white_noise(run.velocity) if block > 1 else 0.0
    while block > 1:
        within, half = run.velocity[: len(run) // block * block].reshape(-1, block), block // 2
        differences = np.abs(within[:, -half:].mean(axis=1) - within[:, :half].mean(axis=1))
        beyond = differences.max() - LARGEST_NOISE * noise * np.sqrt(2.0 / half)
        if beyond * (block - 1) / (block - half) <= LARGEST_TURN * run.peak_velocity:
            break
        block //= 2
    return block


def resting_blocks(run: BenchRun, block: int) -> Bool[np.ndarray, " blocks"]:
    """Which blocks of a record are not wholly in motion."""
    moving = moving_samples(run)
    begins = np.arange(len(run) // block) * block
    return (begins < moving.start) | (begins + block > moving.stop)


def row_of(
    run: BenchRun,
    sigma: float,
    samples_per_cycle: int | None,
    model: Model,
    angle: float,
    can_rest: bool,
    channels: Sequence[str],
    initial_state: str,
    number: int,
) -> Row:
    """A record as `traces.batches` says; the largest step `angle` [rad] and `can_rest` are asked once for all."""
    omega = dominant_rate(run)
    block = samples_in_block(run, samples_per_cycle)
    dt = block / run.sampling_rate
    substeps = max(int(np.ceil(min(omega * dt, COARSEST) / angle)), 1)
    start = start_of(run, initial_state)
    warm_up = 0 if start in ("rest", "estimated") else int(min(2 * np.pi / omega, run.duration) / dt)
    signals = [averaged(values, block) for values in _with_warm_up(run, warm_up * block, channels)]
    repeated = None
    if start == "periodic":
        repeated = repeated_motion(run, [values[warm_up:] for values in signals[:2]], dt)
        signals[0][:warm_up], signals[1][:warm_up] = repeated(np.arange(-warm_up, 0) * dt)
    weight = np.full(len(signals[0]), np.sqrt(block) / sigma)
    weight[len(weight) - blind_end(model, dt) :] = 0.0
    weight[: warm_up + (settling_samples(run, dt) if start == "warm_up" else 0)] = 0.0
    if not can_rest:
        weight[warm_up:][resting_blocks(run, block)] = 0.0
    return Row(dt, signals, weight, number, warm_up, block, substeps, repeated)


def cycles_of(rows: Sequence[Row], runs: Sequence[BenchRun]) -> Cycle | None:
    """The cycle before each record, all with as many points, where some start in the periodic solution."""
    if not any(row.repeated for row in rows):
        return None
    periods = [1.0 / run.frequency for run in runs]
    points = 1 + max(int(np.ceil(t / row.dt)) * row.substeps for t, row in zip(periods, rows, strict=True))
    motions = [
        np.zeros((2, points))
        if row.repeated is None
        else row.repeated(np.linspace(0.0, t, points) - row.warm_up * row.dt)
        for t, row in zip(periods, rows, strict=True)
    ]
    stroke, velocity = (on_device(np.stack(channel)) for channel in zip(*motions, strict=True))
    periodic = jnp.asarray([row.repeated is not None for row in rows])
    return Cycle(on_device(np.array(periods) / (points - 1)), stroke, velocity, periodic)


def on_device(array: np.ndarray) -> Array:
    """With a type stated, an array is copied; without one JAX compiles a program for that."""
    return jnp.asarray(array, float if array.dtype.kind == "f" else int)
