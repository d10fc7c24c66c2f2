"""Bench records as batches of equal length, ready for one compiled call."""

from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper
from jaxdamp.rig import march


STEP_ANGLE = 0.06  # rad of the dominant frequency per step: keeps the error of a law's step near 1e-4


@final
class Batch(eqx.Module):
    """Records side by side, padded to one length; padded and unused samples have weight zero."""

    dt: Float[Array, " runs"]
    stroke: Float[Array, "runs time"]
    velocity: Float[Array, "runs time"]
    force: Float[Array, "runs time"]
    weight: Float[Array, "runs time"]
    substeps: int = eqx.field(static=True)

    def predict(self, law: AbstractDamper) -> Float[Array, "runs time"]:
        """Force of the law under these strokes [N]."""
        return jax.vmap(lambda dt, x, v: march(law, dt, x, v, self.substeps))(self.dt, self.stroke, self.velocity)

    def residual(self, law: AbstractDamper) -> Float[Array, "runs time"]:
        """Weighted difference of the law's force from the measured one."""
        return (self.predict(law) - self.force) * self.weight


def is_memoryless(law: AbstractDamper) -> bool:
    """Whether the law has no states."""
    return law.initial_state().size == 0


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


def pace(run: BenchRun) -> float:
    """How fast a record moves [rad/s]: RMS velocity over RMS stroke, or its frequency if that is higher."""
    moved = float(np.std(run.stroke))
    return max(2 * np.pi * run.frequency, float(np.std(run.velocity)) / moved)


def settling(run: BenchRun) -> float:
    """Time [s] at the start of a record, half a cycle, in which a law with states forgets how it was started."""
    return min(np.pi / pace(run), 0.25 * run.duration)


def batches(
    law: AbstractDamper,
    runs: Sequence[BenchRun],
    sigma: Sequence[float],
    samples_per_cycle: int | None = None,
) -> tuple[list[Batch], list[tuple[int, int, int, int]]]:
    """Prepare records for a law.

    For a memoryless law all samples stand in one batch. For a law with states the records are grouped by length and
    substeps; where a record has more than `samples_per_cycle`, blocks of samples are averaged, whose weight grows with
    the root of their number, so that nothing is lost but the noise; its first half cycle gets weight zero.

    Returns:
        The batches, and for each record (batch, row, count, block): where its samples are.
    """
    if is_memoryless(law):
        ends = np.cumsum([len(run) for run in runs])
        length = _round_up(int(ends[-1]))
        stroke, velocity, force = (
            _pad(np.concatenate([getattr(run, name) for run in runs]), length)[None]
            for name in ("stroke", "velocity", "force")
        )
        weight = np.concatenate([np.full(len(run), 1.0 / s) for run, s in zip(runs, sigma, strict=True)])
        arrays = (np.ones(1), stroke, velocity, force, _pad(weight, length, "constant")[None])
        return [Batch(*map(jnp.asarray, arrays), substeps=1)], [
            (0, 0, int(end), len(run)) for end, run in zip(ends, runs, strict=True)
        ]
    groups: dict[tuple[int, int], list[tuple]] = {}
    places = []
    for run, s in zip(runs, sigma, strict=True):
        dt, omega = 1.0 / run.sampling_rate, pace(run)
        block = 1 if samples_per_cycle is None else max(int(2 * np.pi / (omega * dt * samples_per_cycle)), 1)
        substeps = int(np.clip(np.ceil(omega * dt * block / STEP_ANGLE), 1, 8))
        signals = [_averaged(getattr(run, name), block) for name in ("stroke", "velocity", "force")]
        count = len(signals[0])
        weight = np.full(count, np.sqrt(block) / s)
        weight[: int(np.ceil(settling(run) / (dt * block)))] = 0.0
        length = _round_up(count)
        row = (dt * block, *(_pad(signal, length) for signal in signals), _pad(weight, length, "constant"))
        group = groups.setdefault((length, substeps), [])
        places.append(((length, substeps), len(group), count, block))
        group.append(row)
    keys = list(groups)
    made = [
        Batch(*(jnp.asarray(np.stack(column)) for column in zip(*rows, strict=True)), substeps=key[1])
        for key, rows in groups.items()
    ]
    return made, [(keys.index(key), row, count, block) for key, row, count, block in places]


@eqx.filter_jit
def _predict(batch: Batch, law: AbstractDamper) -> Array:
    return batch.predict(law)


def predict_runs(law: AbstractDamper, runs: Sequence[BenchRun]) -> list[np.ndarray]:
    """Force [N] of the law at every sample of every record."""
    made, places = batches(law, runs, [1.0] * len(runs))
    forces = [np.asarray(_predict(batch, law)) for batch in made]
    if is_memoryless(law):
        return [forces[0][0, end - count : end] for _, _, end, count in places]
    return [forces[batch][row, :count] for batch, row, count, _ in places]


def used_samples(law: AbstractDamper, run: BenchRun) -> slice:
    """The samples of a record that a fit of this law looks at: all, or those after settling."""
    return slice(0 if is_memoryless(law) else int(np.ceil(settling(run) * run.sampling_rate)), None)
