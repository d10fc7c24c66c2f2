"""Values that parameters share (ties), values that records have of their own, and the three steps of a fit."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import identify, roads, tune
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import Bilinear, CoulombFriction, Lag, Linear, Scheduled, Table
from jaxdamp.identify import Status, cross_validate, default_ladder, fit, judge, ladder_starts, prepare, solve, train
from jaxdamp.parameters import get
from jaxdamp.vehicles.presets import half_car_002


BOTH = {"compression_rate": "rebound_rate"}


# ---- ties


def test_tied_rates_of_a_linear_law_are_one_rate(sines):
    runs = sines(Bilinear(2600.0, 1200.0), noise=5.0)
    tied = fit(Bilinear(2000.0, 2000.0, knee_width=0.001), runs, tie=BOTH)
    alone = fit(Linear(2000.0), runs)
    assert [e.name for e in tied.parameters] == ["rebound_rate"] and tied.steps == 0
    assert tied["rebound_rate"].tied == ("compression_rate",) and "= compression_rate" in repr(tied)
    assert tied["rebound_rate"].value == pytest.approx(alone["rate"].value, rel=1e-6)
    assert tied["rebound_rate"].standard_error == pytest.approx(alone["rate"].standard_error, rel=1e-4)
    assert get(tied.law, "compression_rate") == get(tied.law, "rebound_rate")


def test_tied_parameters_of_a_search_have_exact_derivatives(sines):
    truth = Linear(1500.0) + CoulombFriction(40.0, 0.02) + CoulombFriction(40.0, 0.02)
    runs = sines(truth, noise=2.0)
    start = Linear(1000.0) + CoulombFriction(20.0, 0.05) + CoulombFriction(20.0, 0.05)
    result = fit(start, runs, tie={"terms.1.*": "terms.2.*"}, starts=1)
    assert result.status is Status.CONVERGED and len(result.parameters) == 3
    for e, true in zip(result.parameters, (1500.0, 40.0, 0.02), strict=True):
        assert abs(e.value - true) < 4.0 * e.standard_error


def test_training_keeps_ties(maxwell_runs):
    law = Lag(Bilinear(1500.0, 1500.0), 0.002)
    trained = train(law, maxwell_runs[0], held_out=maxwell_runs[1], steps=25, tie=BOTH)
    assert get(trained.law, "law.rebound_rate") == get(trained.law, "law.compression_rate") != 1500.0
    assert trained.status is Status.ALL_STEPS and trained.respond(maxwell_runs[2]).shape == (1200,)


def test_a_tuning_moves_both_axles_together():
    front = {"front.damper.*": "rear.damper.*"}
    arguments = ("rms_sprung_acceleration", half_car_002(Linear(2000.0)), roads.white("C", 20.0))
    result = tune.minimise(*arguments, over=["rate"], bounds={"front.damper.rate": (500.0, 6000.0)}, tie=front)
    (change,) = result.parameters
    assert change.name == "rear.damper.rate" and change.tied == ("front.damper.rate",)
    assert (change.lower, change.upper) == (500.0, 6000.0) and "= front.damper.rate" in repr(result)
    assert result.status is tune.Status.CONVERGED and result.converged
    assert get(result.vehicle, "front.damper.rate") == get(result.vehicle, "rear.damper.rate") == change.after
    apart = tune.minimise(*arguments, over=["rate"], bounds={"rate": (500.0, 6000.0)})
    assert apart.after["rms_sprung_acceleration"] < result.after["rms_sprung_acceleration"]


def test_a_tuning_that_is_cut_short_says_so():
    car, road = half_car_002(Linear(3000.0)), roads.white("C", 20.0)
    result = tune.minimise("rms_sprung_acceleration", car, road, over=["rate"], max_steps=1)
    assert result.status is Status.STEP_LIMIT and "max_steps" in result.status.sentence


# ---- values of each record


FRICTION = (20.0, 60.0, 120.0)


@pytest.fixture(scope="module")
def warming_up(sines):
    """Records of one damper whose friction changes from record to record."""
    tests = ((0.02, 1.0), (0.02, 2.0), (0.02, 5.0))
    laws = [Linear(1500.0) + CoulombFriction(f, 0.02) for f in FRICTION]
    pairs = enumerate(zip(laws, tests, strict=True))
    return [sines(law, noise=2.0, seed=i, tests=[test])[0] for i, (law, test) in pairs]


def test_a_value_of_each_record_beside_common_ones(warming_up):
    start = Linear(1000.0) + CoulombFriction(50.0, 0.02)
    result = fit(start, warming_up, freeze=["friction_velocity"], per_record=["friction_force"])
    path = "terms.1.friction_force"
    assert [e.name for e in result.parameters] == ["terms.0.rate", *(f"{path}[{i}]" for i in range(3))]
    for e, true in zip(result.parameters, (1500.0, *FRICTION), strict=True):
        assert abs(e.value - true) < 4.0 * e.standard_error
    assert result.rmse == pytest.approx(2.0, rel=0.05)
    assert result[f"{path}[1]"].meaning.endswith(f"in record {warming_up[1].name!r}")
    assert [float(get(law, path)) for law in result.record_laws] == [result[f"{path}[{i}]"].value for i in range(3)]
    assert float(get(result.law, path)) == pytest.approx(np.mean([result[f"{path}[{i}]"].value for i in range(3)]))
    assert [w for w in result.main_warnings if f"{path} of the law is the mean over the records" in w]
    common = fit(start, warming_up, freeze=["friction_velocity"])
    assert common.rmse > 5.0 * result.rmse and common.record_laws == ()


def test_a_value_of_each_record_of_a_law_with_states(maxwell_runs):
    halved = [
        BenchRun(run.name, run.time, run.stroke, run.velocity, factor * run.force)
        for run, factor in zip(maxwell_runs[:2], (1.0, 0.5), strict=True)
    ]
    result = fit(Lag(Linear(1500.0), 0.003), halved, per_record=["rate"], starts=1)
    values = [result[f"law.rate[{i}]"].value for i in range(2)]
    assert values == pytest.approx([2000.0, 1000.0], rel=2e-3)
    assert result["lag_time"].value == pytest.approx(0.004, rel=5e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"per_record": ["rat"]}, "No parameter is named 'rat'"),
        ({"per_record": ["force_points"]}, "`per_record` must name parameters that are one number"),
        ({"per_record": ["factor"], "weighting": [1.0, 1.0, np.inf]}, "`weighting` must be finite with `per_record`"),
        ({"per_record": ["factor"], "freeze": ["factor"]}, "is factor, which is held at its start. Remove it from"),
        ({"per_record": ["factor"], "over": ["force_points"]}, "is factor, which is held at its start. Remove it"),
    ],
)
def test_values_of_records_that_make_no_sense_are_refused(sines, options, message):
    law = 2.0 * Table([-1.0, 0.0, 1.0], [-900.0, 0.0, 900.0])
    with pytest.raises(ValueError, match=message):
        fit(law, sines(Linear(1500.0)), **options)


def test_the_command_of_a_record_is_a_value_that_it_states(sines):
    run, law = sines(Linear(1500.0))[0], Scheduled((Linear(1000.0), Linear(3000.0)), [0.0, 2.0], 0.0)
    runs = [BenchRun(f"{u} V", run.time, run.stroke, run.velocity, run.force, command=u) for u in (0.5, 2.0)]
    (batch,) = prepare(law, runs, samples_per_cycle=None).residuals
    differences = np.asarray(batch(law))[batch.used()]
    expected = [rate * run.velocity - run.force for rate in (1500.0, 3000.0)]
    np.testing.assert_allclose(differences, np.concatenate(expected), atol=1e-8)


# ---- prepare, solve, judge


def test_the_three_steps_are_the_fit(sines):
    runs = sines(Bilinear(2600.0, 1200.0), noise=5.0)
    problem = prepare(Bilinear(1000.0, 1000.0), runs)
    assert problem.free.names == ["rebound_rate", "compression_rate"] and problem.used.sum() == 2400
    solution = solve(problem)
    result, whole = judge(problem, solution), fit(Bilinear(1000.0, 1000.0), runs)
    assert solution.closed_form and repr(result) == repr(whole) and result.status is Status.CONVERGED
    residual = np.concatenate([np.asarray(part(result.law)) for part in problem.residuals])
    np.testing.assert_allclose(residual, solution.best.residual, atol=1e-8)


def test_a_status_can_be_branched_on_and_read(sines):
    runs = sines(Linear(1500.0) + CoulombFriction(80.0, 0.02), noise=20.0)
    start = Linear(500.0) + CoulombFriction(10.0, 0.2)
    result = fit(start, runs, max_steps=1, starts=1)
    assert result.status is Status.STEP_LIMIT and not result.converged
    assert result.status.sentence in result.warnings[0]


# ---- starts from records


def test_a_start_of_the_ladder_is_made_anew_of_the_records_of_each_fit(maxwell_runs):
    starts = ladder_starts(["linear", "linear_friction_lag"])
    seen = []

    def watched(start, runs, weighting):
        seen.append([run.name for run, s in zip(runs, weighting, strict=True) if np.isfinite(s)])
        made = identify.prepare(start, runs, weighting=weighting).law
        expected = default_ladder([r for r, s in zip(runs, weighting, strict=True) if np.isfinite(s)], names, rig=None)
        assert repr(made) == repr(expected[names[0]])
        return fit(Linear, runs, weighting=weighting)

    for name in starts:
        names = [name]
        cross_validate({name: starts[name]}, maxwell_runs[:3], method=watched)
    assert seen[0] == [run.name for run in maxwell_runs[1:3]] and len(seen) == 6


def test_a_class_may_start_from_records(sines):
    runs = sines(Linear(1500.0))

    class Own(Bilinear):  # type: ignore[misc]
        @classmethod
        def from_runs(cls, runs: Any):
            fastest = float(max(run.peak_velocity for run in runs))
            return Bilinear(fastest, fastest)

    assert get(prepare(Own, runs).law, "rebound_rate") == pytest.approx(max(one.peak_velocity for one in runs))
    assert get(prepare(lambda runs: Linear(float(len(runs))), runs).law, "rate") == 3.0
    assert jnp.isfinite(get(prepare(Linear, runs).law, "rate"))
