"""Records of all kinds of tests by formulas of NumPy alone, clean or with one artefact."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from jaxdamp.bench import BenchRun, RandomTest, SineTest, TriangleTest, programmes


KINDS = ("qct", "table", "random", "chirp", "road", "triangle", "slow")
QCT = programmes.qct_545(cycles=8)
TABLE = programmes.paper_000_table_1(cycles=5)
Arrays = tuple[np.ndarray, np.ndarray, np.ndarray]


def motion(kind: str, seed: int) -> Arrays:
    """Time [s], stroke [m] and velocity [m/s] of a test."""
    rng = np.random.default_rng([seed, 2])
    if kind in ("chirp", "road"):
        time = np.arange(0.0, 12.0, 1 / 500.0)
        low = rng.uniform(0.3, 1.0)
        growth = np.log(rng.uniform(4.0, 10.0) / low) / time[-1]
        if kind == "chirp":
            phase, slope = 2 * np.pi * low * np.expm1(growth * time) / growth, 2 * np.pi * low * np.exp(growth * time)
            size = 0.02 * np.exp(-0.7 * growth * time)
            return time, size * np.sin(phase), size * (slope * np.cos(phase) - 0.7 * growth * np.sin(phase))
        frequency = np.arange(3, 250) / time[-1]  # a body at 1.3 Hz and a wheel at 12 Hz over a rough road
        gains = [1.0 / np.abs(1 - (frequency / f) ** 2 + 0.6j * frequency / f) for f in (1.3, 12.0)]
        lines = (gains[0] + 0.15 * gains[1]) / frequency * rng.normal(1.0, 0.2, len(frequency))
        angle = 2 * np.pi * frequency * time[:, None] + rng.uniform(0.0, 2 * np.pi, len(frequency))
        x, v = np.sin(angle) @ lines, np.cos(angle) @ (2 * np.pi * frequency * lines)
        return time, 0.03 / np.max(np.abs(x)) * x, 0.03 / np.max(np.abs(x)) * v
    tests: dict[str, Callable[[], Any]] = {
        "qct": lambda: QCT[seed % len(QCT)],
        "table": lambda: TABLE[seed % len(TABLE)],
        "random": lambda: RandomTest(0.02, 0.5, 12.0, (0.3, float(rng.uniform(2.0, 5.0))), seed),
        "triangle": lambda: TriangleTest(0.02, float(rng.uniform(0.3, 2.0)), cycles=6),
        "slow": lambda: SineTest(0.04, float(rng.uniform(0.03, 0.2)), cycles=4),
    }
    test = tests[kind]()
    rate = (
        float(rng.choice([500.0, 1000.0, 2000.0])) if kind in ("qct", "table") else 500.0 if kind != "slow" else 100.0
    )
    time = np.arange(round(test.duration * rate)) / rate
    return time, test.stroke(time), test.velocity(time)


def clean(seed: int, kind: str | None = None, noise: float | None = None) -> BenchRun:
    """A record without artefacts: digressive, with gas, friction, hysteresis and noise of both channels."""
    rng, kind = np.random.default_rng([seed, 1]), kind or KINDS[seed % len(KINDS)]
    time, x, v = motion(kind, seed)
    step, knee = time[1] - time[0], rng.uniform(0.05, 0.3)
    rate = np.where(v > 0, rng.uniform(1500.0, 4000.0), rng.uniform(600.0, 1500.0))
    force = rate * knee * np.tanh(v / knee) + 0.3 * rate * v
    force = force + rng.uniform(10.0, 60.0) * np.tanh(v / rng.uniform(0.002, 0.01))
    lag = float(rng.choice([0.0, 0.001, 0.003]))
    if lag > 0:
        share, state = -np.expm1(-step / lag), force[0]
        lagging = np.empty_like(force)
        for i, f in enumerate(force.tolist()):
            state += share * (f - state)
            lagging[i] = state
        force = lagging
    force = force - rng.uniform(50.0, 200.0) + rng.uniform(0.0, 3000.0) * x
    force = force + (rng.uniform(1.0, 6.0) if noise is None else noise) * rng.standard_normal(len(time))
    x = x + 10 ** rng.uniform(-6.0, -5.0) * rng.standard_normal(len(time))
    return BenchRun.from_arrays(f"{kind} {seed}", time, x, force)


def changed(run: BenchRun, **channels: np.ndarray) -> BenchRun:
    """The record with other channels, and the velocity of its stroke."""
    given: dict[str, Any] = {"time": run.time, "stroke": run.stroke, "force": run.force, **channels}
    return BenchRun.from_arrays(run.name, **given)


def _span(run: BenchRun, rng: np.random.Generator, count: int) -> slice:
    first = int(rng.integers(len(run) // 4, 3 * len(run) // 4 - min(count, len(run) // 4)))
    return slice(first, first + count)


def _over(run: BenchRun, channel: str, part: slice, value: Any) -> BenchRun:
    values = np.array(getattr(run, channel))
    values[part] = value
    return changed(run, **{channel: values})


def dropout(run: BenchRun, rng: np.random.Generator, channel: str, count: int) -> BenchRun:
    return _over(run, channel, _span(run, rng, count), 0.0)


def held(run: BenchRun, rng: np.random.Generator, channel: str, count: int) -> BenchRun:
    part = _span(run, rng, count)
    return _over(run, channel, part, getattr(run, channel)[part.start])


def half_cycle(run: BenchRun) -> int:
    return int(0.5 * run.sampling_rate / run.frequency)


def spike(run: BenchRun, rng: np.random.Generator, count: int, size: float) -> BenchRun:
    part = _span(run, rng, count)
    return _over(run, "force", part, run.force[part] + size * rng.choice([-1.0, 1.0]))


def jump(run: BenchRun, size: float) -> BenchRun:
    return changed(run, force=run.force + size * (run.time > 0.5 * (run.time[0] + run.time[-1])))


def late(run: BenchRun, delay: float, since: float) -> BenchRun:
    shifted = np.interp(run.time - delay, run.time, run.force)
    return changed(run, force=np.where(run.time - run.time[0] < since, run.force, shifted))


def jittered(run: BenchRun, rng: np.random.Generator, size: float) -> BenchRun:
    taken = run.time + size * rng.standard_normal(len(run))
    x, f = (np.interp(taken, run.time, channel) for channel in (run.stroke, run.force))
    inside = slice(20, -20)
    return BenchRun.from_arrays(run.name, run.time[inside], x[inside], f[inside])


def hum(run: BenchRun, frequency: float, sizes: tuple[float, ...]) -> BenchRun:
    wave = sum(a * np.sin(2 * np.pi * k * frequency * run.time + k) for k, a in enumerate(sizes, 1))
    return changed(run, force=run.force + wave)


def exchanged(run: BenchRun) -> BenchRun:
    """Stroke and force columns exchanged: the force's number read as mm, the stroke's, in mm, as N."""
    return changed(run, stroke=1e-3 * run.force, force=1e3 * run.stroke)


def of_time(run: BenchRun, factor: float) -> BenchRun:
    return replace(run, time=factor * run.time, velocity=run.velocity / factor)


def of_stroke(run: BenchRun, factor: float) -> BenchRun:
    return replace(run, stroke=factor * run.stroke, velocity=factor * run.velocity)


def of_force(run: BenchRun, factor: float) -> BenchRun:
    return replace(run, force=factor * run.force)
