"""Robust losses and priors."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import Besinger, Bilinear, Lag, Linear
from jaxdamp.identify import fit, fit_many, judge, prepare, solve


TRUTH = Bilinear(2600.0, 1200.0)


@pytest.fixture(scope="module")
def spiky(sines) -> list[BenchRun]:
    """Noise of 5 N, and one sample in fifty with a spike of 500 N."""
    rng, runs = np.random.default_rng(3), sines(TRUTH, noise=5.0)
    spikes = [500.0 * (rng.random(len(run)) < 0.02) for run in runs]
    return [dataclasses.replace(run, force=run.force + s) for run, s in zip(runs, spikes, strict=True)]


@pytest.mark.parametrize("loss", ["huber", "soft_l1", "student_t"])
def test_spikes_hardly_move_a_robust_fit(spiky, loss):
    squares, robust = fit(Bilinear, spiky, bad_records="keep"), fit(Bilinear, spiky, loss=loss)
    away = [abs(r["rebound_rate"].value - 2600.0) for r in (squares, robust)]
    assert away[1] < 3.0 * robust["rebound_rate"].standard_error < 0.25 * squares["rebound_rate"].standard_error
    assert away[1] < 0.2 * away[0]
    assert f"loss {loss}: " in robust.criterion and "less than half weight" in robust.criterion
    assert robust.criterion in repr(robust)
    assert robust.to_dict()["criterion"] == robust.criterion and robust.criterion in robust.table().title


def test_records_of_equal_weight_have_outliers_of_their_own(sines):
    """Of normal noise 0.7 % has less than half weight; beside a large record much of a small one seemed far away."""
    runs = sines(Linear(1500.0), noise=5.0, tests=[(0.002, 1.0), (0.02, 4.0)])
    how: dict[str, Any] = dict(loss="huber", weighting="runs", samples_per_cycle=None)
    one, many = (fit(Linear(1000.0), fitted, **how) for fitted in (runs, {"a": runs, "b": runs}))
    share = float(one.criterion.partition("huber: ")[2].partition(" %")[0])
    assert 0.3 < share < 1.2 and np.allclose(100.0 * many.share_left_out, share, rtol=0.05)


@pytest.mark.slow
def test_standard_errors_of_robust_fits_hold_with_normal_noise(sines):
    robust = [fit(Linear(1000.0), sines(Linear(1500.0), noise=20.0, seed=s), loss="huber") for s in range(40)]
    scores = [(r["rate"].value - 1500.0) / r["rate"].standard_error for r in robust]
    plain = fit(Linear(1000.0), sines(Linear(1500.0), noise=20.0))
    assert 0.75 < np.std(scores) < 1.3
    assert robust[0]["rate"].standard_error == pytest.approx(1.026 * plain["rate"].standard_error, rel=0.03)


def test_errors_of_robust_fits_follow_the_noise_of_each_record(sines, rng):
    """Huber's estimate of two slopes by hand, with its sandwich covariance by the influence in each record."""
    runs = [
        dataclasses.replace(run, force=run.force + level * rng.standard_normal(len(run)))
        for run, level in zip(sines(TRUTH, noise=0.0, tests=[(0.02, 1.0), (0.01, 4.0)]), (5.0, 80.0), strict=True)
    ]
    force = np.concatenate([run.force for run in runs])
    owner = np.repeat([0, 1], [len(run) for run in runs])
    velocity = np.concatenate([run.velocity for run in runs])
    slopes = np.stack([np.maximum(velocity, 0.0), np.minimum(velocity, 0.0)], axis=1)
    rates, missed, far = np.zeros(2), force, 1e9
    for _ in range(60):
        weighted = np.minimum(1.0, far / np.maximum(np.abs(missed), 1e-9))[:, None] * slopes
        rates = np.linalg.solve(weighted.T @ slopes, weighted.T @ force)
        missed = force - slopes @ rates
        far = 1.345 * 1.4826 * np.median(np.abs(missed))
    bread, meat = np.zeros((2, 2)), np.zeros((2, 2))
    for of_record in (owner == 0, owner == 1):
        products, here = slopes[of_record].T @ slopes[of_record], missed[of_record]
        bread += np.mean(np.abs(here) < far) * products
        meat += np.mean(np.clip(here, -far, far) ** 2) * products
    errors = np.sqrt(np.diag(np.linalg.inv(bread) @ meat @ np.linalg.inv(bread)))
    start = Bilinear(2000.0, 2000.0)
    one = fit(start, runs, loss="huber", samples_per_cycle=None, starts=1)
    many = fit(start, {"a": runs, "b": runs}, loss="huber", samples_per_cycle=None)
    for i, name in enumerate(("rebound_rate", "compression_rate")):
        assert one[name].value == pytest.approx(rates[i], abs=0.02 * errors[i])
        assert one[name].standard_error == pytest.approx(errors[i], rel=0.02)
        assert many.standard_errors[0, i] == pytest.approx(one[name].standard_error, rel=1e-4)


def test_a_prior_is_weighed_against_the_records(sines):
    runs = sines(Linear(1500.0), noise=20.0)
    alone = fit(Linear(1000.0), runs, force_noise=20.0)["rate"]
    error, mean = alone.standard_error, alone.value + 3.0 * alone.standard_error
    result = fit(Linear(1000.0), runs, force_noise=20.0, priors={"rate": (mean, error)})
    assert result["rate"].value == pytest.approx(alone.value + 1.5 * error, abs=0.01 * error)
    assert result["rate"].standard_error == pytest.approx(error / np.sqrt(2.0), rel=1e-3)
    assert result.criterion.startswith("priors rate 15")
    estimated = fit(Linear(1000.0), runs, priors={"rate": (mean, error)})  # with the noise that the residual shows
    assert estimated["rate"].value == pytest.approx(result["rate"].value, abs=0.1 * error)


@pytest.mark.parametrize("start", [Bilinear(2000.0, 2000.0), Lag(Bilinear(2000.0, 2000.0), 1e-3)])
def test_three_steps_and_a_program_weigh_a_prior_as_a_fit_does(sines, start):
    runs, priors = sines(TRUTH, noise=20.0), {"rebound_rate": (2500.0, 5.0)}
    whole = fit(start, runs, starts=1, priors=priors)
    problem = prepare(start, runs, priors=priors)
    solution = solve(problem, starts=1)
    steps = judge(problem, solution)
    error = whole["rebound_rate"].standard_error
    assert steps["rebound_rate"].value == pytest.approx(whole["rebound_rate"].value, abs=0.01 * error)
    assert steps["rebound_rate"].standard_error == pytest.approx(error, rel=1e-3)
    with pytest.raises(ValueError, match=r"noise of the records.*problem\.at_noise\(identify\.solve\(problem\)"):
        problem.minimum()
    values = problem.at_noise(solution.noise).minimum()
    np.testing.assert_allclose(values, [p.value for p in whole.parameters], atol=0.01 * error, rtol=1e-4)


def test_a_prior_beside_records_without_noise_has_a_noise_to_be_taken_too(sines):
    problem = prepare(Bilinear(2000.0, 2000.0), sines(TRUTH), priors={"rebound_rate": (2600.0, 5.0)})
    values = problem.at_noise(solve(problem).noise).minimum()
    np.testing.assert_allclose(values, [2600.0, 1200.0], rtol=1e-6)


@pytest.mark.parametrize("memory", [0.0, 0.95])
@pytest.mark.parametrize("deviation", [10.0, 100.0])
def test_a_prior_is_weighed_against_noise_with_a_memory(sines, memory, deviation):
    """As the mean of two estimates, weighted by their standard errors: once noise with a memory counted as white."""
    rng = np.random.default_rng(1)
    runs = [
        dataclasses.replace(run, force=run.force + lfilter([10.0], [1.0, -memory], rng.standard_normal(len(run))))
        for run in sines(TRUTH)
    ]
    alone = fit(Bilinear, runs)["rebound_rate"]
    both = fit(Bilinear, runs, priors={"rebound_rate": (2620.0, deviation)})["rebound_rate"]
    weights = np.array([alone.standard_error, deviation]) ** -2.0
    error = np.sum(weights) ** -0.5
    assert both.standard_error == pytest.approx(error, rel=0.1)
    assert both.value == pytest.approx(np.average([alone.value, 2620.0], weights=weights), abs=0.2 * error)


def test_a_prior_determines_what_the_records_do_not(sines):
    slow = sines(Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05), noise=5.0, tests=[(0.01, 1.0)])  # never opens the valve
    known = {"blow_off_rate": (900.0, 50.0), "limit_velocity": (0.13, 0.005)}
    start = Besinger(1500.0, 4000.0, 1000.0, 0.12, 0.06)
    result = fit(start, slow, priors=known, starts=1)
    assert result["blow_off_rate"].value == pytest.approx(900.0, abs=1.0)
    assert result["blow_off_rate"].standard_error == pytest.approx(50.0, rel=0.05)


def test_the_bias_by_noise_of_the_velocity_is_reported(sines):
    rng, exact = np.random.default_rng(5), sines(Linear(1500.0), noise=2.0)
    deviation = 0.1  # m/s
    runs = [dataclasses.replace(r, velocity=r.velocity + deviation * rng.standard_normal(len(r))) for r in exact]
    result = fit(Linear(1000.0), runs, input_noise=(0.0, deviation))
    rate = result["rate"]
    assert rate.value < 1500.0 - 3.0 * rate.standard_error
    assert rate.bias == pytest.approx(rate.value - 1500.0, rel=0.15)
    assert any("biases rate by about -" in warning for warning in result.warnings)
    assert result.table().records()[0]["bias by input noise"] == rate.bias
    assert result.to_dict()["parameters"][0]["bias"] == rate.bias
    none = fit(Linear(1000.0), exact, input_noise=(1e-6, 1e-5))
    assert none["rate"].bias is not None and not none.warnings
    assert abs(none["rate"].bias) < 0.1 * none["rate"].standard_error


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"loss": "hubber"}, "Did you mean 'huber'"),
        ({"weighting": None}, "`weighting` must be a word or a number for each record"),
        ({"weighting": 50.0}, r"but is 50\.0\. Give 'samples', 'runs', or"),
        ({"weighting": ["a"]}, "`weighting` must be a word or a number for each record"),
        ({"input_noise": (-1.0, 0.0)}, "`input_noise` must be"),
        ({"priors": {"rat": (1.0, 1.0)}}, "No parameter is named 'rat'"),
        ({"priors": {"rate": (1.0, 0.0)}}, "be a mean and a positive standard deviation"),
    ],
)
def test_what_is_refused(sines, options: dict[str, Any], message: str):
    with pytest.raises(ValueError, match=message):
        fit(Linear(1000.0), sines(Linear(1500.0)), **options)


RATE, BOTH, OTHER = ("rebound_rate", (2600.0, 1e-3)), ("*_rate", (2000.0, 5000.0)), ("compression_rate", (1500.0, 10.0))


@pytest.mark.parametrize(
    ("priors", "options", "message"),
    [
        ([RATE, BOTH], {}, r"`priors` must give rebound_rate one prior, but is two, of 'rebound_rate' and '\*_rate'"),
        ([BOTH, RATE], {}, r"`priors` must give rebound_rate one prior, but is two, of '\*_rate' and 'rebound_rate'"),
        ([OTHER], {"tie": {"compression_rate": "rebound_rate"}}, "tied to rebound_rate. Give the prior of 'rebound_r"),
        ([OTHER], {"freeze": ["compression_rate"]}, "of compression_rate, which is frozen"),
        ([OTHER], {"over": ["rebound_rate"]}, "of compression_rate, which is frozen"),
    ],
)
def test_a_prior_is_that_of_one_free_parameter(sines, priors, options: dict[str, Any], message: str):
    with pytest.raises(ValueError, match=message):
        fit(Bilinear(2000.0, 2000.0), sines(TRUTH), priors=dict(priors), **options)


def test_a_number_of_the_law_is_named_once_beside_a_machine(sines):
    twice = {"rebound_rate": (2600.0, 1.0), "law.rebound_rate": (2000.0, 1.0)}
    with pytest.raises(ValueError, match=r"name each number once, but is 'rebound_rate' and 'law.rebound_rate'"):
        fit(Bilinear(2000.0, 2000.0), sines(TRUTH), priors=twice, rig="offset")


@pytest.mark.parametrize("mean", [2250.0, 2300.0])
def test_a_prior_that_the_records_contradict_does_not_win_by_the_noise_it_makes(sines, mean):
    runs = sines(TRUTH, noise=10.0)
    alone = fit(Bilinear, runs, samples_per_cycle=None)["rebound_rate"]
    weights = alone.standard_error**-2, 5.0**-2
    expected = np.average([alone.value, mean], weights=weights)
    result = fit(Bilinear, runs, samples_per_cycle=None, priors={"rebound_rate": (mean, 5.0)})
    assert result["rebound_rate"].value == pytest.approx(expected, abs=0.2 * (alone.value - expected))
    assert result["compression_rate"].value == pytest.approx(1200.0, rel=5e-3)
    assert any("contradict the prior of rebound_rate" in warning for warning in result.warnings)


@pytest.mark.parametrize("shared", [(), ("compression_rate",)])
def test_a_prior_wins_over_no_damper_by_the_noise_it_makes(sines, shared):
    """Of three dampers the prior suits the second; that of the others was 2252 of 2600 N s/m."""
    records = {str(rate): sines(Bilinear(rate, 1200.0), noise=10.0) for rate in (2600.0, 2250.0, 2550.0)}
    how: dict[str, Any] = {"samples_per_cycle": None, "priors": {"rebound_rate": (2250.0, 5.0)}}
    many = fit_many(Bilinear, records, shared=shared, **how)
    for name, remark, (value, *_) in zip(records, many.remarks, many.values, strict=True):
        alone = fit(Bilinear, records[name], **how)["rebound_rate"]
        assert value == pytest.approx(alone.value, abs=0.1 * alone.standard_error)
        assert ("contradict the prior of rebound_rate, 2250 ± 5 N s/m" in remark) == (name != "2250.0")
