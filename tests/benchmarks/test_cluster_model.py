"""The simulated scheduler beside closed forms."""

import pytest

from benchmarks.cluster_model import Cluster, simulate


def test_without_losses_the_work_or_the_scheduler_decides():
    work = Cluster(4000, 20, 2.0, spread=0.0, handing=0.0, compiling=5.0)
    course = simulate(work)
    assert course.wall == pytest.approx(5.0 + 4000 / 20 * 2.0) and course.busy == pytest.approx(400.0 / course.wall)
    slow = Cluster(4000, 200, 0.5, spread=0.0, handing=0.01, compiling=0.0)  # 50 blocks a worker's second are too many
    assert simulate(slow).wall == pytest.approx(4000 * 0.01 + 0.5, rel=0.01)
    one = Cluster(7, 1, 1.0, spread=0.0, handing=0.1, compiling=0.0)
    assert simulate(one).wall == pytest.approx(0.1 + 7.0)


def test_losses_cost_their_blocks_and_the_absence():
    lossy = Cluster(60_000, 100, 10.0, spread=0.0, handing=0.0, compiling=0.0, failures=6.0, restart=60.0)
    course = simulate(lossy)
    expected = 60_000 * 10.0 / 100  # without losses
    rate = 6.0 / 3600.0
    there = 1.0 / (1.0 + rate * 60.0)  # share of the time
    useful = rate * 10.0 / (2.718281828459045 ** (rate * 10.0) - 1.0)  # of the time at work: blocks that end
    assert course.wall == pytest.approx(expected / (there * useful), rel=0.02)
    assert course.lost_workers == pytest.approx(100 * course.wall * rate * there, rel=0.05)
    assert course.lost_blocks == pytest.approx(course.lost_workers, rel=0.02)
