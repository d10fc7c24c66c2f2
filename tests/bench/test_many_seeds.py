"""Artefacts of sign, heat and stick-slip, and those of several records: found, named and sized over many seeds."""

from typing import Any

import numpy as np
import pytest

from jaxdamp.bench import BenchRun, preflight


RATE, CYCLES = 300.0, 8


def record(rng: np.random.Generator, frequency=2.0, rates=(2600.0, 1200.0), loss=0.0, drift=0.0, stick=0.0, name=""):
    """A damper with noise, of which the damping falls, the static force drifts, or the seal holds behind reversals."""
    time = np.arange(round(CYCLES / frequency * RATE)) / RATE
    omega, share = 2 * np.pi * frequency, np.arange(len(time)) / (len(time) - 1)
    stroke, velocity = 0.02 * np.sin(omega * time), 0.02 * omega * np.cos(omega * time)
    force = velocity * np.where(velocity > 0, *rates) * (1 - loss * share) + drift * share
    force = force + breakaway(velocity, stick)
    stroke = stroke + 1e-5 * rng.standard_normal(len(time))
    return BenchRun.from_arrays(
        name or f"{frequency:g} Hz", time, stroke, force + rng.uniform(1.0, 4.0) * rng.standard_normal(len(time))
    )


def breakaway(velocity, stick):
    return stick * np.tanh(velocity / 0.003) * np.exp(-((velocity / 0.05) ** 2))


def turned(run: BenchRun, motion: float, force: float) -> BenchRun:
    return BenchRun.from_arrays(run.name, run.time, motion * run.stroke, force * run.force)


def reversed_force(rng) -> tuple[Any, ...]:
    return turned(record(rng), 1.0, -1.0), "force sign", ("2 Hz",), None, 0.0


def one_record_turned(rng) -> tuple[Any, ...]:
    rates = (2000.0, 2000.0 * rng.uniform(0.3, 0.8))
    runs = [record(rng, frequency, rates) for frequency in (1.9, 2.0, 2.1, 2.2)]
    odd = int(rng.integers(4))
    runs[odd] = turned(runs[odd], -1.0, -1.0)
    return runs, "sign unlike its bench", (runs[odd].name,), None, 0.0


def heat(rng) -> tuple[Any, ...]:
    loss = rng.uniform(0.03, 0.2)
    return record(rng, loss=loss), "drift of damping", ("2 Hz",), -loss * (1 - 1 / CYCLES) / (1 - 0.5 * loss), 0.1


def gas_that_warms(rng) -> tuple[Any, ...]:
    drift = -rng.uniform(30.0, 150.0)
    return record(rng, drift=drift), "drift of static force", ("2 Hz",), drift * (1 - 1 / CYCLES), 0.15


def stick_slip(rng) -> tuple[Any, ...]:
    stick, velocity = rng.uniform(80.0, 200.0), np.linspace(0.0, 0.25, 1000)
    force = 300.0 * velocity + breakaway(velocity, stick)
    top = int(np.argmax(force[:200]))
    size = force[top] - force[top:].min()
    return record(rng, rates=(300.0, 300.0), stick=stick), "stick-slip", ("2 Hz",), size, 0.25


def contradiction(rng) -> tuple[Any, ...]:
    runs, factor = [record(rng, frequency) for frequency in (1.5, 2.0, 2.5)], 1.0 + rng.uniform(0.15, 0.8)
    other = record(rng, 2.0, (factor * 2600.0, factor * 1200.0), name="other")
    difference = (factor - 1.0) * float(np.sqrt(np.mean(runs[1].force ** 2)))
    return [*runs, other], "contradiction", ("2 Hz", "other"), difference, 0.05


ARTEFACTS = (reversed_force, one_record_turned, heat, gas_that_warms, stick_slip, contradiction)


def check(artefact, seed: int) -> None:
    runs, name, records, size, error = artefact(np.random.default_rng(seed))
    findings = preflight(runs).findings
    assert [(finding.name, finding.records) for finding in findings] == [(name, records)], seed
    if size is not None:
        assert findings[0].size == pytest.approx(size, rel=error), seed


@pytest.mark.parametrize("artefact", ARTEFACTS)
def test_found_named_and_sized(artefact):
    for seed in range(2):
        check(artefact, seed)


@pytest.mark.exhaustive
@pytest.mark.parametrize("artefact", ARTEFACTS)
def test_found_named_and_sized_over_many_seeds(artefact):
    for seed in range(50):
        check(artefact, seed)
