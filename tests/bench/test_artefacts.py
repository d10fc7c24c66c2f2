"""Artefacts in records of all kinds of tests are found and named, clean records raise nothing."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from jaxdamp import bench
from jaxdamp.bench import BenchRun, preflight, usable
from jaxdamp.bench.preflight.check import ERRORS
from jaxdamp.bench.preflight.finding import Examined

from . import plain_records as made


Random = np.random.Generator
# what true records of a damper with gas force and hysteresis have, and fast ones of few samples
TRUE = {"gas force", "delay", "hysteresis", "few samples"}
LARGEST = 11.0  # times the largest force

# artefact: the names of which one must be found, and what makes it
ARTEFACTS: dict[str, tuple[tuple[str, ...], Callable[[BenchRun, Random], BenchRun]]] = {
    **{
        f"{kind} {channel} {count}": (
            (f"{channel} {kind}",),
            lambda run, rng, make=make, channel=channel, count=count: make(
                run, rng, channel, count or made.half_cycle(run)
            ),
        )
        for kind, make in (("dropout", made.dropout), ("held", made.held))
        for channel in ("force", "stroke")
        for count in (2, 20, 0)
    },
    **{
        f"spike {count}": (("force spikes",), lambda run, rng, count=count: made.spike(run, rng, count, 200.0))
        for count in (1, 2, 3, 5)
    },
    "spike 3 large": (
        ("force spikes",),
        lambda run, rng: made.spike(run, rng, 3, LARGEST * float(np.abs(run.force).max())),
    ),
    "spike 1e30": (("force spikes",), lambda run, rng: made.spike(run, rng, 2, 1e30)),
    "jump": (("force jump", "force level changes"), lambda run, rng: made.jump(run, 100.0)),
    "late from 2 s": (("delay changes",), lambda run, rng: made.late(run, 0.02, 2.0)),
    "exchanged": (("channels exchanged",), lambda run, rng: made.exchanged(run)),
    "jitter": (("clock jitter",), lambda run, rng: made.jittered(run, rng, 2e-3)),
    "hum 50": (("force ripple",), lambda run, rng: made.hum(run, 50.0, (10.0,))),
    "hum 60": (("force ripple",), lambda run, rng: made.hum(run, 60.0, (15.0, 8.0, 5.0))),
    "hum 150": (("force ripple",), lambda run, rng: made.hum(run, 50.0, (0.0, 0.0, 10.0))),
}
ERROR = ("dropout force 0", "held force 0", "spike 1e30", "exchanged")


def found_in(name: str, seed: int) -> bool:
    """Whether an artefact is found in the sine record of this seed, and nothing is said of damper or machine."""
    names, make = ARTEFACTS[name]
    run = make(made.clean(seed, "qct"), np.random.default_rng([seed, 7]))
    found = preflight(run)
    said = {finding.name for finding in found.findings}
    assert not said & {"stick-slip", "drift of damping", "drift of static force"} or name == "jump", said
    return bool(said & set(names)) and (name not in ERROR or not found.ok)


@pytest.mark.parametrize("name", ARTEFACTS)
def test_an_artefact_of_a_sine_record_is_found(name: str) -> None:
    assert found_in(name, 2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ARTEFACTS)
def test_an_artefact_of_a_sine_record_is_found_in_29_of_30(name: str) -> None:
    """Five samples of 200 N beside each other are hardly told from the motion: 28."""
    assert sum(found_in(name, seed) for seed in range(30)) >= (28 if name == "spike 5" else 29)


def alarms(seed: int) -> set[str]:
    return {finding.name for finding in preflight(made.clean(seed)).findings} - TRUE


def test_clean_records_of_all_kinds_raise_nothing() -> None:
    assert not any(alarms(seed) for seed in range(14))


def short(seed: int) -> BenchRun:
    """A clean sine record of three cycles, or of four."""
    run = made.clean(seed, "qct")
    return run.process(between=(run.time[0], run.time[0] + (3 + seed % 2) / run.frequency))


def begins_late(seed: int) -> bool:
    """Whether a force that is late by 20 ms from between 30 and 70 % of a short record is found."""
    run, rng = short(seed), np.random.default_rng([seed, 7])
    begin, delay = rng.uniform(0.3, 0.7) * run.duration, 0.02 * rng.choice([-1.0, 1.0])
    found = preflight(made.late(run, delay, begin)).named("delay changes")
    sized = [abs(f.size - delay) < 0.1 * abs(delay) for f in found if f.size is not None]
    placed = [abs(f.between[0] - run.time[0] - begin) < 0.15 / run.frequency for f in found if f.between is not None]
    return sized == placed == [True]


def test_a_delay_that_begins_within_three_or_four_cycles_is_found() -> None:
    assert all(begins_late(seed) for seed in range(4))
    drifting = [made.changed(run, force=run.force * (1.0 - 0.02 * run.time)) for run in map(short, range(4))]
    assert not any(preflight(run).named("delay changes") for run in [*map(short, range(4)), *drifting])


@pytest.mark.slow
def test_a_delay_that_begins_within_three_or_four_cycles_is_found_in_29_of_30() -> None:
    assert sum(begins_late(seed) for seed in range(30)) >= 29
    assert not any(preflight(short(seed)).named("delay changes") for seed in range(200))


@pytest.mark.slow
def test_200_clean_records_raise_nothing() -> None:
    assert {seed: found for seed in range(210) if (found := alarms(seed))} == {}


def test_the_quick_check_refuses_what_the_preflight_calls_an_error() -> None:
    rng, run = np.random.default_rng(0), made.clean(5, "qct")
    bad = ARTEFACTS["dropout force 0"][1](run, rng)
    with pytest.raises(ValueError, match=r"qct 5: the force drops to zero .* Samples were lost.*bad_records="):
        usable([run, bad])
    assert usable([run, bad], "leave_out") == (run,) and usable([run, bad], "keep") == (run, bad)
    with pytest.raises(ValueError, match="the force drops to zero"):
        usable([bad], "leave_out")
    wild = ARTEFACTS["spike 1e30"][1](run, rng)
    assert usable([wild], robust=True) == (wild,)
    with pytest.raises(ValueError, match="spike"):
        usable([wild])


def test_a_held_force_at_constant_velocity_or_a_coarse_channel_is_none() -> None:
    """A force rounded to 5 N, and friction alone, which is constant between the reversals."""
    run = made.clean(5, "qct", noise=0.5)
    coarse = made.changed(run, force=5.0 * np.round(run.force / 5.0))
    friction = made.changed(run, force=60.0 * np.tanh(run.velocity / 0.003))
    for each in (coarse, friction):
        examined = Examined(each)
        assert [f.name for check in ERRORS for f in check(examined)] == []


def test_findings_are_said_once_worst_first() -> None:
    rng = np.random.default_rng(0)
    runs: list[Any] = [made.spike(made.clean(seed, "qct"), rng, 3, 200.0) for seed in (2, 5)]
    found = preflight([*runs, made.exchanged(made.clean(7, "qct"))])
    sentences = found.sentences()
    assert sentences[0].startswith("error, channels exchanged: qct 7") and len(sentences) == len(set(sentences))
    assert any("force spikes in 2 records, most in qct" in text for text in sentences)
    assert not found.without(["force spikes"]).named("force spikes")


@pytest.mark.slow
def test_measured_records_and_parts_of_them_have_no_error(data):
    """At the ends of its stroke a real machine stands still for some samples, which is no clipping."""
    runs = bench.read(data / "mr_damper" / "*.csv", sign="rebound-positive")
    for some in (runs, bench.BenchSet(run.last_cycles(4) for run in runs), runs.process(moving=True, low_pass=50.0)):
        assert not bench.preflight(some).of("error")
