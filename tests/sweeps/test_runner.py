"""The choice between two programs, which run on a clock of their own."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxdamp import Ride, roads, vehicles
from jaxdamp.codegen import _native
from jaxdamp.sweeps import points, running
from jaxdamp.sweeps.function import trace
from jaxdamp.sweeps.program import Program, prepare


COUNT = 3000


@pytest.fixture
def program(monkeypatch):
    """Makes a program that takes so many seconds a point, and counts the points that it takes."""
    clock, of = SimpleNamespace(now=0.0), {}
    monkeypatch.setattr(running.time, "perf_counter", lambda: clock.now)
    start = Program.start

    def timed(program, columns):
        seconds, taken = of[id(program)]
        clock.now += seconds * len(columns["x"])
        taken.append(len(columns["x"]))
        return start(program, columns)

    def program(seconds):
        made = prepare(trace(lambda point: {"twice": 2.0 * point["x"]}, ["x"], False), COUNT, 4, 1, None)
        of[id(made)] = seconds, []
        return made, of[id(made)][1]

    monkeypatch.setattr(Program, "start", timed)
    monkeypatch.setattr(running, "LONG", 30.0)
    return program


def run(first, other):
    runs = running.Runner(first, points({"x": np.arange(float(COUNT))}), other)
    parts = list(runs.results(np.arange(COUNT)))
    np.testing.assert_array_equal(np.concatenate([indices for indices, _ in parts]), np.arange(COUNT))
    doubled = np.concatenate([found["twice"] for _, found in parts if found is not None])
    np.testing.assert_array_equal(doubled, 2.0 * np.arange(COUNT))
    return runs


@pytest.mark.parametrize(("first", "second"), [(0.04, 0.02), (0.02, 0.04)])
def test_the_faster_program_does_the_rest_of_a_long_sweep(program, first, second):
    (one, by_one), (two, by_two) = program(first), program(second)
    runs = run(one, lambda: two)
    slow, fast = (by_one, by_two) if first > second else (by_two, by_one)
    assert runs.program is (two if first > second else one)
    assert 0 < sum(slow) < 0.05 * COUNT and sum(slow) + sum(fast) == COUNT
    assert runs.rate == pytest.approx(50.0)


def test_a_short_sweep_asks_for_no_other_program(program):
    one, taken = program(0.009)
    run(one, lambda: pytest.fail("asked for"))
    assert sum(taken) == COUNT


def test_points_that_follow_count_as_work_left(program):
    (one, _), (two, by_two) = program(0.04), program(0.02)
    runs = running.Runner(one, points({"x": np.arange(float(COUNT))}), lambda: two)
    assert sum(len(indices) for indices, _ in runs.results(np.arange(100), later=COUNT - 100)) == 100
    assert sum(by_two) > 0


def test_a_loop_that_the_machine_does_not_load_is_left_to_xla_with_a_word(monkeypatch):
    def unloadable(*_):
        raise OSError("failed to map segment from shared object")

    monkeypatch.setattr(_native, "_compiled", unloadable)
    road = roads.cosine_bump(0.05, start=0.1, length=1.0, speed=10.0)
    ride = Ride(vehicles.presets.quarter_car_000(), road, metrics=["peak_sprung_acceleration"], duration=0.3)
    computation = running.Computation(ride, points({"damper.rate": np.array([1000.0, 2000.0])}), chunk=2)
    with pytest.warns(UserWarning, match="failed to map .* TMPDIR. This sweep goes on with the loop of XLA"):
        assert computation._printed(2) is None


def test_without_another_program_the_first_does_all(program):
    (one, taken), asked = program(0.04), []
    run(one, lambda: asked.append(1))
    assert (sum(taken), len(asked)) == (COUNT, 1)
