"""One fit: every option of a fit of a law works for a vehicle and for numbers too, and every result has the same."""

import json

import numpy as np
import optimistix as optx
import pytest

from jaxdamp import bench, identify, roads
from jaxdamp.dampers import Bilinear, Linear
from jaxdamp.parameters import replace
from jaxdamp.vehicles import QuarterCar


LAW = Bilinear(2600.0, 1200.0)
CAR = QuarterCar(300.0, 40.0, 20e3, 180e3, LAW)
STARTS = {"damper.rebound_rate": 2000.0, "damper.compression_rate": 1500.0}
GOALS = {"sum": (3800.0, 20.0), "ratio": (2600.0 / 1200.0, 0.05), "difference": (1400.0, 20.0)}
RATES = ["rebound_rate", "compression_rate"]


def numbers(law):
    return {
        "sum": law.rebound_rate + law.compression_rate,
        "ratio": law.rebound_rate / law.compression_rate,
        "difference": law.rebound_rate - law.compression_rate,
    }


@pytest.fixture(scope="module")
def runs():
    return bench.VirtualDyno(LAW, force_noise=5.0, seed=1).run(bench.SineTest(0.02, 2.0, cycles=6))


@pytest.fixture(scope="module")
def ride():
    sweep = roads.sweep_sine(1.0, 5.0, duration=1.5, velocity_amplitude=0.15)
    return identify.virtual_ride(CAR, sweep, {"stroke": 1e-4}, sampling_rate=100.0, finer=4, seed=2)


@pytest.fixture(scope="module", params=["law", pytest.param("vehicle", marks=pytest.mark.slow), "targets"])
def fitted(request, runs, ride):
    """A fit of two rates from a start away from the truth, as a function of the options."""
    if request.param == "law":
        return lambda **how: identify.fit(Bilinear(2000.0, 1500.0), runs, over=RATES, **how)
    if request.param == "vehicle":
        return lambda **how: identify.fit(replace(CAR, STARTS), ride, over=RATES, dt=5e-3, **how)
    return lambda **how: identify.fit(Bilinear(2000.0, 1500.0), GOALS, numbers=numbers, over=RATES, **how)


@pytest.fixture(scope="module")
def plain(fitted):
    return fitted(starts=1)


def value(result, name):
    return result.estimate(name).value


def test_a_fit_finds_the_rates_and_holds_everything(plain):
    assert isinstance(plain, identify.Fit) and plain.converged and plain.starts == 1
    for name, truth in zip(RATES, (2600.0, 1200.0), strict=True):
        found = plain.estimate(name)
        assert abs(found.value - truth) < 5.0 * found.standard_error
    assert plain.covariance.shape == (2, 2) and len(plain.minima) == 1
    np.testing.assert_allclose(np.sqrt(np.diag(plain.covariance)), [e.standard_error for e in plain.parameters])
    data = json.loads(json.dumps(plain.to_dict(), allow_nan=False))
    assert len(data["parameters"]) == 2 and np.shape(data["covariance"]) == (2, 2)
    assert {"rebound_rate", "compression_rate"} <= {e.name.rpartition(".")[2] for e in plain.parameters}


def test_a_function_of_the_model_has_an_error(plain):
    def rate(model):
        return (model if isinstance(model, Bilinear) else model.damper).rebound_rate

    found = plain.propagate(rate)
    assert float(found.value) == pytest.approx(value(plain, "rebound_rate"))
    assert float(found.standard_error) == pytest.approx(plain.estimate("rebound_rate").standard_error, rel=1e-6)


def test_a_profile_agrees_with_the_standard_error(plain):
    curve = plain.profile(plain.parameters[0].name)
    low, high = curve.interval
    assert high - low == pytest.approx(np.diff(curve.linear_interval)[0], rel=0.2)


def test_several_starts_end_in_one_minimum(fitted, plain):
    result = fitted(starts=3)
    assert result.starts >= plain.starts
    for name in RATES:
        error = plain.estimate(name).standard_error
        assert value(result, name) == pytest.approx(value(plain, name), abs=0.01 * error)


def test_a_prior_draws_a_parameter_and_stands_in_the_criterion(fitted, plain):
    error = plain.estimate("rebound_rate").standard_error
    mean = value(plain, "rebound_rate") + 4.0 * error
    result = fitted(starts=1, priors={"rebound_rate": (mean, error)})
    assert value(result, "rebound_rate") == pytest.approx(mean - 2.0 * error, abs=0.6 * error)
    assert "priors rebound_rate" in result.criterion


def test_a_robust_loss_takes_sound_data_as_they_are(fitted, plain):
    result = fitted(starts=1, loss="huber")
    assert value(result, "rebound_rate") == pytest.approx(
        value(plain, "rebound_rate"), abs=2.0 * plain.estimate("rebound_rate").standard_error
    )
    assert "loss huber" in result.criterion


@pytest.mark.slow
def test_a_solver_of_optimistix_ends_in_the_same_minimum(fitted, plain):
    result = fitted(starts=1, solver=optx.Dogleg(rtol=1e-8, atol=1e-8))
    for name in RATES:
        error = plain.estimate(name).standard_error
        assert value(result, name) == pytest.approx(value(plain, name), abs=0.01 * error)


def test_bounds_ties_and_frozen_numbers(fitted):
    bounded = fitted(starts=1, bounds={"rebound_rate": (1000.0, 2300.0)})
    assert value(bounded, "rebound_rate") == pytest.approx(2300.0) and bounded.estimate("rebound_rate").note
    frozen = fitted(starts=1, freeze=["compression_rate"])
    assert [e.name.rpartition(".")[2] for e in frozen.parameters] == ["rebound_rate"]


def test_channels_with_spikes_need_a_robust_loss(ride):
    spoilt = np.array(ride["stroke"])
    spoilt[::17] += 0.05
    record = identify.virtual_ride(
        CAR, roads.sweep_sine(1.0, 5.0, duration=1.5, velocity_amplitude=0.15), {"stroke": 1e-4},
        sampling_rate=100.0, finer=4, seed=2,
    )  # fmt: skip
    object.__setattr__(record, "channels", {"stroke": spoilt})
    how = {"over": RATES, "dt": 5e-3}
    squares, robust = (
        identify.fit(replace(CAR, STARTS), record, loss=loss, **how) for loss in ("squares", "student_t")
    )
    away = [abs(value(result, "rebound_rate") - 2600.0) for result in (squares, robust)]
    assert away[1] < 0.1 * away[0] and "student_t" in robust.criterion


def test_a_mapping_of_records_is_a_fit_of_many_dampers(runs):
    many = identify.fit(Bilinear, {"A": runs, "B": runs})
    assert isinstance(many, identify.ManyFits) and many.names == ("A", "B")


def test_over_names_what_a_law_may_change(runs):
    held = identify.fit(Bilinear(2000.0, 1200.0), runs, over=["rebound_rate"], rig=["offset"])
    assert [e.name for e in held.parameters] == ["law.rebound_rate", "rig.force_offset"]
    assert float(held.law.compression_rate) == 1200.0


def test_records_held_out_of_a_comparison_are_not_fitted(sines):
    runs = sines(Bilinear(2600.0, 1200.0), noise=5.0)
    same, apart = (identify.compare({"linear": Linear}, some, held_out=runs[-1:]) for some in (runs, runs[:-1]))
    assert same.best.held_out_rmse == apart.best.held_out_rmse
    assert [run.name for run in same.best.result.runs] == [run.name for run in runs[:-1]]
    with pytest.raises(ValueError, match="`held_out` must leave records to fit, but is all"):
        identify.compare({"linear": Linear}, runs, held_out=runs)
