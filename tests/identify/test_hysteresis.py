"""Laws with states: led into the records, averaged where they are slow, and found from starts away from the truth."""

import numpy as np
import pytest

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import Lag, Linear
from jaxdamp.identify import default_ladder, fit
from jaxdamp.identify.predicting import predict_runs, used_samples
from jaxdamp.identify.traces import batches
from jaxdamp.parameters import free_parameters


def scaled(law, factor):
    free = free_parameters(law)
    return free.build(factor * free.values)


def check_car(result, car):
    assert result.converged and result.steps < 60, result
    assert result.rmse == pytest.approx(20.0, rel=0.01)
    for true, e in zip(free_parameters(car).values, result.parameters, strict=True):
        assert abs(e.value - true) < 3.0 * e.standard_error, e
    assert [e.name for e in result.parameters if e.note] == ["cubic_stiffness"]
    assert result["cubic_stiffness"].note == "not identifiable"
    assert len(result.warnings) == 1


@pytest.mark.exhaustive
def test_thirty_records_give_the_car_damper_back(car, car_runs):
    starts = {
        "data": default_ladder(car_runs, ["besinger_series_spring"])["besinger_series_spring"],
        "half": scaled(car, 0.5),
        "double": scaled(car, 2.0),
    }
    results = {name: fit(start, car_runs) for name, start in starts.items()}
    for result in results.values():
        check_car(result, car)
    values = np.array([[e.value for e in r.parameters] for r in results.values()])
    errors = np.array([e.standard_error for e in results["data"].parameters])
    assert np.all(np.ptp(values, axis=0) < 0.05 * errors)


@pytest.mark.slow
def test_the_discretisation_is_far_below_the_noise(car, car_runs):
    """The law's forces by the fit's steps, against the bench's own, which are 30 times finer."""
    error = np.concatenate([f - r.force for f, r in zip(predict_runs(car, car_runs), car_runs, strict=True)])
    smooth = np.convolve(error, np.ones(100) / 100, mode="valid")  # 20 N of noise become 2 N
    assert np.std(error) == pytest.approx(20.0, rel=0.02)
    assert abs(np.mean(error)) < 0.25 and np.percentile(np.abs(smooth), 99) < 2.6 * 2.0


@pytest.mark.slow
def test_a_lag_is_found_without_noise(maxwell_runs):
    for start in (Lag(Linear(1000.0), 1e-3), Lag(Linear(5000.0), 2e-2)):
        result = fit(start, maxwell_runs)
        assert result.converged
        assert result["law.rate"].value == pytest.approx(2000.0, rel=2e-4)
        assert result["lag_time"].value == pytest.approx(0.004, rel=2e-4)
        assert result.fit_percent > 99.95


def test_every_record_is_led_in_by_its_first_cycle(maxwell_runs):
    law = Lag(Linear(2000.0), 0.004)
    made, places = batches(law, maxwell_runs, [2.0] * 4, 400)
    assert len(made) <= 2
    for place, run in zip(places, maxwell_runs, strict=True):
        batch = made[place.batch]
        assert place.start in (399, 400) and place.stop - place.start == len(run) and place.block == 1
        stroke, weight = (np.asarray(a)[place.row] for a in (batch.stroke, batch.weight))
        assert np.array_equal(stroke[place.start : place.stop], run.stroke)
        assert np.max(np.abs(np.diff(stroke[: place.stop], 2))) < 2.0 * np.max(np.abs(np.diff(run.stroke, 2)))
        used = used_samples(law, run, memoryless=False)
        assert used.start == pytest.approx(200, abs=1)
        assert not weight[: place.start + used.start].any() and not weight[place.stop :].any()
        assert np.all(weight[place.start + used.start : place.stop] == 0.5)
    first = predict_runs(law, maxwell_runs)
    for force, run in zip(first, maxwell_runs, strict=True):
        # the copy of the first cycle makes even the first sample right, in a steady motion
        assert np.max(np.abs(force - run.force)) < 0.01 * np.max(run.force)


def test_slow_records_are_averaged_and_predicted_at_every_sample(maxwell_runs):
    law = Lag(Linear(2000.0), 0.004)
    slow = maxwell_runs[0]
    time = np.linspace(slow.time[0], slow.time[-1], 12_000)
    fine = BenchRun("fine", time, *(np.interp(time, slow.time, a) for a in (slow.stroke, slow.velocity, slow.force)))
    made, (place,) = batches(law, [fine], [1.0], 400)
    assert place.block == 10 and place.stop - place.start == 1200
    assert np.max(np.asarray(made[0].weight)) == pytest.approx(np.sqrt(10.0))
    force = predict_runs(law, [fine])[0]
    assert force.shape == (12_000,)
    assert np.max(np.abs(force - fine.force)) < 2e-3 * np.max(fine.force)


@pytest.mark.slow
def test_measured_damper(mr_runs):
    """The plain laws leave the hysteresis, a lag or a series spring takes most of it."""
    ladder = default_ladder(mr_runs, ["linear", "linear_friction", "linear_friction_lag"])
    results = {name: fit(law, mr_runs) for name, law in ladder.items()}
    assert all(result.converged for result in results.values())
    assert results["linear"].fit_percent == pytest.approx(60.0, abs=1.0)
    assert 87.0 < results["linear_friction_lag"].fit_percent < 91.0
    assert 80.0 < results["linear_friction"].fit_percent < 84.0
    assert results["linear_friction"].rmse > 1.3 * results["linear_friction_lag"].rmse
    assert 1e-3 < results["linear_friction_lag"]["lag_time"].value < 2e-2
