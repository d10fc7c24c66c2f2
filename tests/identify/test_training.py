"""Gradient descent with early stopping: it finds what is there, stops in time, and gives the same again."""

import dataclasses
import json

import jax
import numpy as np
import optax
import pytest

from jaxdamp import identify
from jaxdamp.bench import RandomTest, SineTest, VirtualDyno
from jaxdamp.dampers import Bilinear, BoucWen, Hybrid, Lag, Linear, PiecewiseLinear
from jaxdamp.parameters import free_parameters, get


@pytest.fixture(scope="module")
def lagged():
    dyno = VirtualDyno(Lag(Linear(2000.0), 0.004), sampling_rate=400.0, force_noise=5.0)
    return list(dyno.run([SineTest(0.01, f, cycles=3) for f in (1.5, 3.0, 6.0)]))


def test_finds_the_parameters(lagged):
    start = Lag(Linear(1500.0), 0.002)
    result = identify.train(start, lagged[:2], held_out=lagged[2], steps=400, learning_rate=0.05)
    np.testing.assert_allclose(get(result.law, "law.rate"), 2000.0, rtol=0.01)
    np.testing.assert_allclose(get(result.law, "lag_time"), 0.004, rtol=0.05)
    best = int(np.argmin(result.held_out_history))
    assert result.best_step == result.steps[best]
    assert result.held_out_history[best] < 0.1 * result.held_out_history[0]
    assert result.held_out_fit_percent > 97.0
    assert [s.name for s in result.scores] == [run.name for run in lagged]
    assert "Lag trained on 2 records" in repr(result)
    rows = result.table().records()
    assert [row["use"] for row in rows] == ["training", "training", "held out"]
    assert [row["RMSE"] for row in rows] == [score.rmse for score in result.scores]
    plain = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert plain["held_out_rmse"] == {"value": result.held_out_rmse, "unit": "N"}
    assert plain["history"]["value"] == list(result.history) and plain["status"] == result.status.name.lower()


@pytest.mark.slow
def test_hybrid_learns_a_hysteresis_that_it_does_not_contain_the_same_each_time():
    law = BoucWen(300.0, 0.0, 500.0, 1e-3)
    runs = list(VirtualDyno(law, sampling_rate=400.0).run([SineTest(a, 2.0, cycles=3) for a in (0.02, 0.01, 0.005)]))

    rule = optax.adam(0.05)

    def train(steps):
        def start(velocity, force):
            return Hybrid.guess(velocity, force, key=jax.random.key(3), elements=1, width=4)

        options = {"steps": steps, "optimiser": rule, "samples_per_cycle": 100}
        return identify.train(start, runs[::2], held_out=runs[1], **options)

    result, first, again = train(250), train(25), train(25)
    assert result.held_out_fit_percent > 90.0
    static = identify.fit(PiecewiseLinear, runs[::2])
    assert static.score([runs[1]])[0] < 80.0
    np.testing.assert_array_equal(free_parameters(first.law).values, free_parameters(again.law).values)
    np.testing.assert_array_equal(result.history[:2], again.history)


def test_a_training_without_a_better_step_says_so(lagged):
    result = identify.train(Linear(1990.0), lagged[:1], held_out=lagged[1], steps=25, learning_rate=50.0)
    assert result.best_step == 0 and float(get(result.law, "rate")) == 1990.0
    said = "No step was better on `held_out` than the start, which is the result: lower `learning_rate` (50)"
    assert result.warnings == (f"{said}, if it is no fit.",)


def test_stops_when_the_held_out_error_grows(lagged):
    # ascent in small steps on the records held out: the first error is the best
    rising = optax.sgd(-1e-3)
    start = Lag(Linear(1900.0), 0.004)
    result = identify.train(start, lagged[:1], held_out=lagged[1], optimiser=rising, steps=1000, patience=50)
    assert result.best_step == 0 and result.steps[-1] == 50
    assert result.warnings[0].startswith("No step was better on `held_out`") and "of `optimiser`" in result.warnings[0]
    assert "stopped at step 50, 50 steps after the held-out error last fell" in result.stopped
    np.testing.assert_allclose(get(result.law, "law.rate"), 1900.0, rtol=1e-9)


def test_a_record_of_infinite_weighting_is_not_trained_on(lagged):
    start, options = Lag(Linear(1500.0), 0.002), {"held_out": lagged[2], "steps": 25}
    alone = identify.train(start, lagged[:1], **options)
    beside = identify.train(start, lagged[:2], weighting=[1.0, np.inf], **options)
    np.testing.assert_allclose(free_parameters(beside.law).values, free_parameters(alone.law).values, rtol=1e-6)
    np.testing.assert_allclose(beside.rmse, alone.rmse, rtol=1e-6)
    assert "Lag trained on 1 record:" in repr(beside)
    assert [row["use"] for row in beside.table().records()] == ["training", "scored only", "held out"]


def test_records_with_errors_and_records_that_contradict_are_refused_as_in_a_fit(lagged):
    start = Linear(1500.0)
    clipped = dataclasses.replace(lagged[1], name="clipped", force=np.clip(lagged[1].force, -200.0, 200.0))
    with pytest.raises(ValueError, match=r"`runs` must be records without errors, but is clipped.*leave_out"):
        identify.train(start, [lagged[0], clipped], held_out=lagged[2], steps=25)
    with pytest.raises(ValueError, match="`held_out` must be records without errors, but is clipped"):
        identify.train(start, lagged[0], held_out=clipped, steps=25)
    both, weights = [clipped, lagged[0]], [1.0, 2.0]
    rest = identify.train(start, both, held_out=lagged[2], bad_records="leave_out", weighting=weights, steps=25)
    assert [run.name for run in rest.runs] == [lagged[0].name]
    kept = identify.train(start, both, held_out=lagged[2], bad_records="keep", steps=25)
    assert len(kept.runs) == 2
    hard = dataclasses.replace(lagged[0], name="hard", force=1.5 * lagged[0].force)
    with pytest.raises(ValueError, match="`runs` must be records that one law can follow"):
        identify.train(start, [lagged[0], hard], held_out=lagged[2], steps=25)


def test_refusals(lagged):
    start = Linear(1000.0)
    with pytest.raises(ValueError, match="`held_out` must hold at least one record, but is empty"):
        identify.train(start, lagged, held_out=[])
    with pytest.raises(ValueError, match="`held_out` must hold records that are not trained on"):
        identify.train(start, lagged, held_out=lagged[0])
    copy = dataclasses.replace(lagged[0], name="copy")
    with pytest.raises(ValueError, match=f"copy \\(the same as {lagged[0].name} of `runs`\\)"):
        identify.train(start, lagged, held_out=copy)
    with pytest.raises(ValueError, match="`patience` must be 1 or more"):
        identify.train(start, lagged[:1], held_out=lagged[1], patience=0)
    with pytest.raises(ValueError, match="`learning_rate` must be positive"):
        identify.train(start, lagged[:1], held_out=lagged[1], learning_rate=-0.1)


@pytest.mark.exhaustive
def test_the_learnt_rung_is_trained_without_the_record_it_stops_by(lagged, monkeypatch):
    start = identify.ladder_starts(["neural_hysteresis_spring"])["neural_hysteresis_spring"]
    assert isinstance(start, identify.LearntStart) and "neural_hysteresis_spring" not in identify.LAWS
    start = identify.LearntStart(keys=2, options={"steps": 50})
    first, second = start.trainings(lagged)
    assert [run.name for run in first.held_out] == [lagged[1].name] and first.runs == (lagged[0], lagged[2])
    assert first.held_out_rmse != second.held_out_rmse  # another key
    best = min((first, second), key=lambda training: training.held_out_rmse)
    sigma = [1.0, 1.0, 1.0]
    with monkeypatch.context() as patch:  # trained once, on the records less their static force, which is the machine's
        patch.setattr(identify.LearntStart, "trainings", lambda self, runs: seen.append(runs) or [first, second])
        seen: list = []
        result = identify.fit(start, lagged, rig="offset", weighting=sigma, max_steps=20)
    assert [[run.name for run in runs] for runs in seen] == [[run.name for run in lagged]]
    offset = seen[0][0].force - lagged[0].force
    assert np.ptp(offset) < 1e-9 and float(get(result.law, "terms.2.preload")) == 0.0
    for name in start.freeze:
        np.testing.assert_array_equal(get(result.law, f"terms.1.{name}"), get(best.law, f"terms.1.{name}"))
    assert {e.name for e in result.parameters} == {
        "law.terms.0.rate",
        "law.terms.1.stiffness[0]",
        "law.terms.1.stiffness[1]",
        "law.terms.2.stiffness",
        "rig.force_offset",
    }


def test_a_copy_of_a_record_is_not_what_a_learnt_start_stops_by(lagged, monkeypatch):
    calls = []
    monkeypatch.setattr("jaxdamp.identify.training.train", lambda law, runs, **how: calls.append((runs, how)))
    copies = [dataclasses.replace(run, name=f"{run.name} again") for run in lagged[:2]]
    identify.LearntStart(keys=1).trainings([*lagged, *copies])
    ((rest, how),) = calls
    assert len({run.fingerprint for run in (*rest, how["held_out"])}) == len(rest) + 1 == 3
    assert how["bad_records"] == "keep"  # the fit around it has judged them


@pytest.mark.slow
def test_of_a_single_record_the_last_part_decides_when_the_training_stops():
    test = RandomTest(0.02, 0.3, duration=8.0, band=(0.25, 4.0))
    (run,) = VirtualDyno(Lag(Bilinear(2400.0, 1100.0), 0.006), 250.0, force_noise=5.0).run([test])
    known = run.between(0.0, 5.6)
    start = identify.LearntStart(keys=1, options={"steps": 200})
    (training,) = start.trainings([known])
    (first,), (last,) = training.runs, training.held_out
    assert len(first) + len(last) == len(known) and last.time[0] > first.time[-1]
    assert len(first) == pytest.approx(0.7 * len(known), abs=1)
    result = identify.fit(start, known)
    assert result.score([run.between(5.6, 8.0)])[0] > 90.0  # a straight line reaches 60 %, two slopes 87
