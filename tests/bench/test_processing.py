"""Steps of processing: each does what it says, names itself, and leaves the raw record; their order does not matter."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from jaxdamp.bench import BenchRun, BenchSet, fold_cycles, low_pass_gain, separate_gas_and_friction


RATE = 1000.0


def moved(*, noise=0.0, rest=(0.7, 0.9), frequency=2.0, delay=0.0, ripple=0.0, cycles=8):
    """Rest, a sine of so many cycles, rest; a linear damper with gas, friction and a delayed force channel."""
    time = np.arange(round((sum(rest) + cycles / frequency) * RATE)) / RATE
    omega = 2 * np.pi * frequency

    def motion(t):
        inside = (t >= rest[0]) & (t < rest[0] + cycles / frequency)
        angle = omega * (t - rest[0])
        return np.where(inside, 0.02 * np.sin(angle), 0.0), np.where(inside, 0.02 * omega * np.cos(angle), 0.0)

    stroke, velocity = motion(time)
    x, v = motion(time - delay)
    rng = np.random.default_rng(1)
    force = 2000.0 * v - 100.0 + 500.0 * x + 30.0 * np.sign(v)
    force = force + ripple * np.sin(2 * np.pi * 150.0 * time) + noise * rng.standard_normal(len(time))
    return BenchRun("run", time, stroke + 1e-6 * noise * rng.standard_normal(len(time)), velocity, force)


def same(a: BenchRun, b: BenchRun) -> None:
    for channel in ("time", "stroke", "velocity", "force"):
        np.testing.assert_array_equal(getattr(a, channel), getattr(b, channel))
    assert a.notes == b.notes and a.raw is b.raw


@pytest.mark.parametrize("noise", [0.0, 10.0])
def test_the_moving_part(noise):
    run = moved(noise=noise)
    part = run.process(moving=True)
    assert part.time[0] == pytest.approx(0.7, abs=0.025) and part.time[-1] == pytest.approx(4.7, abs=0.025)
    assert "rest cut off: 0.6" in part.notes[-1] and part.raw is run and run.notes == ()
    again = moved(rest=(0.0, 0.0), noise=noise)
    whole = again.process(moving=True)
    assert len(whole) == len(again) and whole.notes == ()


def test_cycles():
    run = moved()
    assert run.cycles == 8
    assert run.process(last_cycles=2).time[0] == pytest.approx(3.7, abs=0.002)
    skipped = run.process(moving=True, skip_cycles=3)
    assert skipped.cycles == 5 and "cycles 4 to 8 of 8" in skipped.notes[-1]
    assert run.process(between=(1.0, 3.01), last_cycles=1).time[0] == pytest.approx(2.2, abs=0.002)
    with pytest.raises(ValueError, match="`last_cycles` must be between 1 and the number of full cycles, 8"):
        run.process(last_cycles=9)
    with pytest.raises(ValueError, match="`skip_cycles` must be less than the number of full cycles of 'run', 8"):
        run.process(skip_cycles=8)


def test_the_filter_leaves_what_it_says_and_shifts_nothing():
    run = moved(rest=(0.0, 0.0), ripple=50.0)
    filtered = run.process(low_pass=75.0)
    middle = slice(500, 3500)
    clean = moved(rest=(0.0, 0.0)).process(low_pass=75.0)
    hum = (filtered.force - clean.force)[middle]
    assert np.std(hum) * np.sqrt(2) == pytest.approx(50.0 * low_pass_gain(150.0, 75.0, RATE), rel=0.01)
    np.testing.assert_allclose(filtered.stroke[middle], run.stroke[middle], atol=2e-8)
    time = np.arange(4000) / 4000
    wave = np.sin(2 * np.pi * 60 * time)
    sixty = BenchRun("60 Hz", time, wave, wave, wave).process(low_pass=50.0)
    assert np.ptp(sixty.force[800:3200]) / 2 == pytest.approx(low_pass_gain(60.0, 50.0, 4000.0), rel=0.01)
    assert "it leaves 18.8 % at 60 Hz" in sixty.notes[-1]
    np.testing.assert_allclose(sixty.force, sixty.stroke)  # force and stroke alike
    with pytest.raises(ValueError, match=r"`low_pass` must be less than 0\.45 times the sampling rate"):
        run.process(low_pass=450.0)


def test_a_delay_is_taken_out():
    late, right = moved(delay=0.0034, rest=(0.0, 0.0)), moved(rest=(0.0, 0.0))
    mended = late.process(delay=0.0034)
    away = np.abs(mended.velocity) > 0.03  # friction jumps at zero velocity
    both = np.abs(mended.force - right.force[: len(mended)])[away]
    assert np.max(both[10:-10]) < 0.5 < np.max(np.abs(late.force - right.force))
    assert "3.4 ms later" in mended.notes[-1]
    early = right.process(delay=-0.002)
    np.testing.assert_allclose(early.force[5:50], right.force[5:50], atol=1e-6)
    assert early.time[0] == pytest.approx(0.002)
    with pytest.raises(ValueError, match="shorter than half the record"):
        right.process(delay=3.0)


def test_gas_and_friction_are_taken_out():
    run = moved(rest=(0.0, 0.0), frequency=1.0)
    found = separate_gas_and_friction(run)
    damping = run.process(without=found)
    fast = np.abs(run.velocity) > 0.02
    np.testing.assert_allclose(damping.force[fast], (2000.0 * run.velocity)[fast], atol=1.0)
    assert "subtracted, as measured on run" in damping.notes[-1]


def test_the_mean_cycle():
    run = moved(rest=(0.0, 0.0), noise=20.0, cycles=50)
    mean = run.process(mean_cycle=True)
    assert mean.cycles >= 1 and mean.frequency == pytest.approx(2.0, rel=1e-3)
    cycles = fold_cycles(run)
    np.testing.assert_array_equal(mean.force[: cycles.force.shape[1]], cycles.force.mean(axis=0))
    away = np.abs(mean.velocity) > 0.02
    law = 2000.0 * mean.velocity - 100.0 + 500.0 * mean.stroke + 30.0 * np.sign(mean.velocity)
    assert np.std((mean.force - law)[away]) == pytest.approx(20.0 / np.sqrt(50), rel=0.35)
    assert "mean cycle over" in mean.notes[-1] and "(RMS)" in mean.notes[-1]
    assert BenchSet([run]).process(mean_cycle=True)[0].notes == mean.notes
    warming = replace(run, temperature=300.0 + run.time / run.time[-1])
    mean = warming.process(mean_cycle=True)
    assert mean.temperature is not None and np.all(np.abs(mean.temperature - 300.5) < 0.05)
    assert mean.notes[-1].endswith(", at their mean temperature, 27.4 °C")


def test_the_order_does_not_matter():
    run = moved(noise=5.0, delay=0.002)
    found = separate_gas_and_friction(run)
    steps = [{"delay": 0.002}, {"low_pass": 60.0}, {"moving": True}, {"last_cycles": 4}, {"without": found}]
    expected = run.process(**{name: value for step in steps for name, value in step.items()})
    assert len(expected.notes) == 5
    for order in itertools.islice(itertools.permutations(steps), 0, None, 7):
        part = run
        for step in order:
            part = part.process(**step)
        same(part, expected)
    same(run.process(mean_cycle=True).process(low_pass=60.0), run.process(low_pass=60.0).process(mean_cycle=True))
    same(run.process(between=(1.0, 4.0)).process(between=(0.0, 3.0)), run.process(between=(1.0, 3.0)))


def test_where_the_order_would_matter_it_is_refused():
    run = moved()
    with pytest.raises(ValueError, match="`between` must be given before cycles are chosen"):
        run.process(last_cycles=2).process(between=(1.0, 2.0))
    with pytest.raises(
        ValueError, match=r"`low_pass` must be given once, but is 50.0 after 60.0. Begin with `run.raw`"
    ):
        run.process(low_pass=60.0).process(low_pass=50.0)
    for steps in ({"last_cycles": 3}, {"skip_cycles": 1, "last_cycles": 3}):
        with pytest.raises(
            ValueError, match=r"`skip_cycles` must .*in one call, `process\(skip_cycles=1, last_cycles=3"
        ):
            run.process(**steps).process(skip_cycles=1)
    same(run.process(skip_cycles=1).process(last_cycles=3), run.process(skip_cycles=1, last_cycles=3))
    for cut in (run.between(1.0, 4.0), run.last_cycles(2)):
        assert cut.raw is run
        with pytest.raises(ValueError, match="`low_pass` must be asked for before a record is cut"):
            cut.process(low_pass=50.0)
    assert run.last_cycles(4).process(last_cycles=1).time[0] == run.last_cycles(1).time[0]


def test_steps_that_do_not_exist_are_refused():
    with pytest.raises(TypeError, match="lowpass"):
        moved().process(lowpass=50.0)
    with pytest.raises(ValueError, match="`last_cycles` must be 1 or more, but is 0"):
        moved().process(last_cycles=0)


def test_a_record_with_other_data_is_a_raw_one():
    part = moved().process(moving=True)
    other = replace(part, force=2.0 * part.force)
    assert other.raw is other and part.steps.moving and not other.steps.moving


def test_rest_of_measured_records_is_found(data):
    from jaxdamp.bench import read

    for run in read(sorted((data / "mr_damper").glob("*.csv")), sign="rebound-positive"):
        part = run.process(moving=True)
        assert 0.2 < len(part) / len(run) < 0.8
        assert part.cycles == run.cycles and np.ptp(part.stroke) == np.ptp(run.stroke)
