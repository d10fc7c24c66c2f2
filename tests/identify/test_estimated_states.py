"""States at the beginning of each record: estimated in a fit, and taken from the force at rest in a prediction."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.bench import BenchRun, SineTest, VirtualDyno
from jaxdamp.dampers import Dahl, Lag, Linear, ViscoPlastic
from jaxdamp.identify import fit
from jaxdamp.identify.initial_states import REST_WINDOW
from jaxdamp.identify.predicting import predict_runs
from jaxdamp.rig import march


LAW = Dahl(2e5, 100.0) + Linear(500.0)  # its friction holds at rest what an earlier motion left


def record(name, law, state, amplitude=0.005, rest=2.5, noise=1.0):
    """A record that begins at rest with these states, in steps of 5 ms."""
    time = np.arange(0.0, 4.5, 5e-3)
    phase = 8.0 * np.maximum(time - rest, 0.0)
    stroke, velocity = amplitude * (1.0 - np.cos(phase)), 8.0 * amplitude * np.sin(phase)
    of_law = march(law, jnp.asarray(5e-3), jnp.asarray(stroke), jnp.asarray(velocity), 1, state=jnp.asarray(state))
    force = np.asarray(of_law) + noise * np.random.default_rng(len(name)).standard_normal(time.size)
    return BenchRun(name, time, stroke, velocity, force)


@pytest.fixture(scope="module")
def runs():
    return [record("one", LAW, [40.0]), record("three", LAW, [-60.0], 0.004), record("eleven", LAW, [20.0], 0.006)]


@pytest.fixture(scope="module")
def result(runs):
    start = Dahl(3e5, 130.0) + Linear(400.0)
    return fit(start, runs, initial_state="estimated", weighting=[1.0, 1.0, np.inf], starts=1)


def test_the_states_of_fitted_records_are_estimated_with_their_errors(result):
    assert result.criterion == "all records start with states estimated from their force"
    first, second, left_out = result.initial_states
    assert left_out is None and not any("records.2" in e.name for e in result.parameters)
    for number, state, true in ((0, first, 40.0), (1, second, -60.0)):
        estimate = result[f"records.{number}.initial_state[0]"]
        assert estimate.value == state[0] == pytest.approx(true, abs=4 * estimate.standard_error)
        assert estimate.standard_error < 0.2 and estimate.note == ""
    assert estimate.meaning == "state of the law at the beginning of record 'three'"
    for name, true in (("friction_force", 100.0), ("rate", 500.0)):
        assert abs(result[name].value - true) < 4 * result[name].standard_error
    assert "records.1.initial_state[0]" in repr(result) and result.rmse == pytest.approx(1.0, rel=0.1)


def test_a_new_record_begins_with_the_mean_force_of_its_first_second_of_rest(result, runs):
    left_out = runs[2]
    window = round(REST_WINDOW * left_out.sampling_rate)
    changed = dataclasses.replace(left_out, force=np.where(np.arange(len(left_out)) < window, left_out.force, 7e3))
    first, other = (result.respond(run) for run in (left_out, changed))
    np.testing.assert_array_equal(first, other)
    assert np.abs(first - left_out.force).max() < 5.0
    first_second = dataclasses.replace(left_out, force=left_out.force + 1e-3 * np.r_[[1, -1] * 100, [0] * 700])
    assert result.score([first_second])[1] == pytest.approx(result.score([left_out])[1], rel=1e-6)  # not scored
    assert abs(predict_runs(result.law, [left_out])[0][0] - left_out.force[0]) > 10.0
    assert result.score(runs)[2][0] == result.scores[0] and result.scores[2].rmse < 1.2


def test_a_state_that_its_record_does_not_tell_keeps_what_is_expected():
    law = ViscoPlastic(10.0, 500.0, 1.0, 0.002, [100.0], [1e-4], [1e-4], [0.01])
    told = fit(law, record("r", law, [0.0]), initial_state="estimated", freeze=["law.*"], starts=1)
    (state,) = told.parameters
    assert state.note == "not identifiable" and abs(state.value) < 2e-5 and 5e-5 < state.standard_error < 5e-4
    assert any("keeps the value that is expected" in warning for warning in told.warnings)


@pytest.mark.slow
def test_a_record_cut_out_of_a_motion_begins_with_any_state():
    """A slow lag: without the first half cycle, which is not compared otherwise, its time is wrong by a fifth."""
    long = VirtualDyno(Lag(Linear(2000.0), 0.5), sampling_rate=200.0).run(SineTest(0.02, 2.0, cycles=12))[0]
    run = long.process(between=(4.8, 5.95))
    found = fit(Lag(Linear(2600.0), 0.65), run, initial_state="estimated", starts=1)
    assert (found["rate"].value, found["lag_time"].value) == pytest.approx((2000.0, 0.5), rel=1e-2)
    assert found.initial_states[0] == pytest.approx(run.force[0], rel=1e-2)
