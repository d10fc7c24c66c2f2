"""First looks of several starts see the first part of long records: the same answer for fewer samples."""

import numpy as np
import pytest

from jaxdamp.bench import BenchRun, SineTest, VirtualDyno
from jaxdamp.dampers import Besinger
from jaxdamp.identify import fit, prepare, several
from jaxdamp.identify.search import Searches


LAW = Besinger(1600.0, 4200.0, 900.0, limit_velocity=0.13, transition_velocity=0.05)
NEAR = Besinger(1500.0, 4000.0, 800.0, limit_velocity=0.12, transition_velocity=0.06)


@pytest.fixture(scope="module")
def runs():
    tests = [SineTest(0.02, 5.0, cycles=20, rest_before=1.0, run_up=0.2), SineTest(0.004, 10.0, cycles=20)]
    return VirtualDyno(LAW, force_noise=20.0, seed=1).run(tests)


def growing(run):
    """The record with an amplitude that grows to its end."""
    share = np.linspace(0.1, 1.0, len(run))
    return BenchRun("growing", run.time, share * run.stroke, share * run.velocity, run.force)


def test_the_first_part_has_the_whole_motion_in_fewer_samples(runs):
    problem = prepare(NEAR, runs, rig="offset")
    part, values = several.first_part(problem), problem.free.values
    assert part is not None
    whole, seen = np.asarray(problem.residual(values)), np.asarray(part.residual(values))
    for place, run in zip(problem.places, problem.runs, strict=True):
        kept = np.flatnonzero(seen[place])
        moving = np.abs(run.velocity[: len(whole[place])]) > 0.1 * np.abs(run.velocity).max()
        assert 0.2 * moving.sum() < np.count_nonzero(moving[: kept[-1]]) < 0.5 * moving.sum()
        covered = [np.ptp(signal[: kept[-1]]) / np.ptp(signal) for signal in (run.stroke, run.velocity)]
        assert min(covered) > 0.95
        assert np.sum(seen[place] ** 2) == pytest.approx(np.sum(whole[place] ** 2), rel=0.3)


def test_there_is_none_of_short_records_and_of_a_motion_that_grows(runs):
    short = VirtualDyno(LAW).run(SineTest(0.02, 5.0))
    assert several.first_part(prepare(NEAR, runs)) is not None
    assert several.first_part(prepare(NEAR, short)) is None
    assert several.first_part(prepare(NEAR, [growing(run) for run in (*runs, *runs)])) is None


@pytest.fixture
def counted(monkeypatch):
    """The samples of each search, and the points that it tried."""
    searches, plain = list[tuple[int, int]](), Searches.end

    def end(self, values, max_steps, **how):
        found = plain(self, values, max_steps, **how)
        searches.append((int(np.count_nonzero(self.problem.used)), found.steps))
        return found

    monkeypatch.setattr(several.Searches, "end", end)
    return searches


def test_starts_are_compared_on_fewer_samples_with_the_same_answer(runs, counted, monkeypatch):
    result, looks = fit(NEAR, runs, rig="offset"), counted.copy()
    counted.clear()
    monkeypatch.setattr(several, "LEAST", np.inf)
    on_all = fit(NEAR, runs, rig="offset")
    assert result.converged and result.starts == on_all.starts > 3
    for one, other in zip(result.parameters, on_all.parameters, strict=True):
        assert abs(one.value - other.value) < 1e-3 * other.standard_error
        assert one.standard_error == pytest.approx(other.standard_error, rel=1e-3)
    work = [sum(samples * steps for samples, steps in searches) for searches in (looks, counted)]
    assert work[0] < 0.7 * work[1]


def test_a_start_that_leads_to_the_same_minimum_is_not_followed(runs, counted):
    result = fit(NEAR, runs, rig="offset")
    most = max(samples for samples, _ in counted)
    assert len(result.minima) == 1 and result.minima[0].starts > 1
    assert sum(samples == most for samples, _ in counted) == 1
