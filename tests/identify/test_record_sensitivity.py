"""Derivatives of a ride metric by measured forces through the fit: against complete fits of changed records."""

import dataclasses
import json
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from jaxdamp import Ride, bench, dampers, identify, parameters, roads
from jaxdamp.identify.problem import linearised
from jaxdamp.vehicles.presets import quarter_car_000


COMFORT, TYRE = "rms_sprung_acceleration", "rms_dynamic_tyre_load"
BUMP = roads.cosine_bump(0.05, start=0.02, duration=0.15)


def records(truth, *tests):
    dyno = bench.VirtualDyno(truth, sampling_rate=200.0, force_noise=40.0, seed=3)
    return list(dyno.run([bench.SineTest(a, f) for a, f in tests or [(0.02, 2.0), (0.02, 4.0)]]))


def moved(runs, number, gain=0.0, offset=0.0, sample=None):
    """Records of which one has other forces."""
    force = runs[number].force * (1.0 + gain)
    force = force + offset * (1.0 if sample is None else np.eye(len(force))[sample])
    return [dataclasses.replace(run, force=force) if i == number else run for i, run in enumerate(runs)]


def refitted(law, runs, begin, **options):
    """The law at the minimum, to rounding, by SciPy."""
    problem = identify.prepare(law, runs, **options)
    lower, upper = problem.free.limits()

    def both(values, which):
        return np.asarray(linearised(problem.free, jnp.asarray(values), problem.residuals)[which])

    exact: dict[str, Any] = {"xtol": 1e-15, "ftol": None, "gtol": None, "max_nfev": 300, "bounds": (lower, upper)}
    exact |= {"jac": lambda x: both(x, 1), "method": "dogbox", "x_scale": np.maximum(np.abs(begin), 1e-3)}
    answer = least_squares(lambda x: both(x, 0), np.clip(begin, lower, upper), **exact)
    return problem.free.build(jnp.asarray(answer.x))


def check(result, metrics, refit, step, rel):
    """All derivatives against central differences of complete fits."""
    runs, found = result.runs, result.sensitivity_to_records(metrics)
    force = float(np.sqrt(np.mean(runs[0].force ** 2)))
    owned = np.flatnonzero(np.isclose(runs[1].velocity, found.velocity[1][7]))
    sample = int(owned[np.argmin(np.abs(runs[1].stroke[owned] - found.stroke[1][7]))])

    def slope(**change: Any) -> dict[str, float]:
        size = step if "gain" in change else step * force
        size *= 5.0 if "sample" in change else 1.0  # one of hundreds: a refit rounds off what is smaller
        sides = []
        for sign in (1.0, -1.0):
            sizes = {key: sign * size * x if key in ("gain", "offset") else x for key, x in change.items()}
            sides.append({name: float(x) for name, x in metrics(refit(moved(runs, **sizes))).items()})
        return {name: (sides[0][name] - sides[1][name]) / (2.0 * size) for name in sides[0]}

    for name, value in found.values.items():
        least = 1e-7 * abs(value)
        for i in range(len(runs)):
            assert found.by_gain[name][i] == pytest.approx(slope(number=i, gain=1.0)[name], rel, least), (name, i)
            by_offset = slope(number=i, offset=1.0)[name]
            assert found.by_offset[name][i] == pytest.approx(by_offset, rel, least / force), (name, i)
        by_sample = slope(number=1, offset=1.0, sample=sample)[name]
        assert found.by_sample[name][1][7] == pytest.approx(by_sample, 10 * rel, least / force / 100), name
    return found


def ride_with(law, **options):
    ride = Ride(quarter_car_000(law), BUMP, metrics=[COMFORT, TYRE], duration=0.3, dt=2e-3, **options)
    return lambda law: dict(ride.of_vehicle(quarter_car_000(law))())


@pytest.mark.parametrize("weighting", ["samples", pytest.param("runs", marks=pytest.mark.slow)])
def test_a_law_linear_in_its_parameters(weighting):
    runs = records(dampers.Bilinear(2600.0, 1400.0) + dampers.Spring(3000.0))
    result = identify.fit(dampers.Linear(1500.0) + dampers.Spring(2000.0), runs, weighting=weighting)

    def numbers(law):
        return {"rate": law.terms[0].rate, "stiffness": law.terms[1].stiffness}

    found = check(result, numbers, lambda runs: identify.fit(result.law, runs, weighting=weighting).law, 1e-4, 1e-6)
    assert found.values["rate"] == pytest.approx(float(parameters.get(result.law, "terms.0.rate")), rel=1e-12)
    assert found.by_gain["rate"].sum() == pytest.approx(found.values["rate"], rel=1e-9)  # all forces scaled alike
    assert len(found.table().rows) == 2 and json.dumps(found.to_dict(), allow_nan=False)
    assert not found.held and not found.warnings and runs[0].name in repr(found)


def test_the_gradient_of_a_ride_passes_through_the_fit():
    """Bench samples -> least squares -> simulated ride, against complete fits."""
    runs = records(dampers.Bilinear(2600.0, 1400.0))
    result = identify.fit(dampers.Bilinear, runs)
    metrics = ride_with(result.law)
    check(result, metrics, lambda runs: identify.fit(dampers.Bilinear, runs).law, 1e-3, 1e-5)


def test_what_is_no_smooth_minimum_of_squares_is_refused():
    runs = records(dampers.Bilinear(2600.0, 1400.0))
    robust = identify.fit(dampers.Linear, runs, loss="huber")
    with pytest.raises(ValueError, match="`result` must be a fit by plain least squares, but is one by loss huber"):
        robust.sensitivity_to_records(lambda law: law.rate)
    blind = identify.fit(dampers.Linear(1500.0) + dampers.Linear(900.0), runs)
    with pytest.raises(
        ValueError, match=r"determine its free parameters, but is one that does not: terms.0.rate, term"
    ):
        blind.sensitivity_to_records(lambda law: law.terms[0].rate)
    expected = identify.fit(dampers.Linear, runs, priors={"rate": (1500.0, 10.0)})
    with pytest.raises(ValueError, match="is one by priors rate 1500 ± 10"):
        expected.sensitivity_to_records(lambda law: law.rate)
    fine = identify.fit(dampers.Linear, runs)
    with pytest.raises(ValueError, match=r"`function` must give one number as 'value', but is of shape \(2,\)"):
        fine.sensitivity_to_records(lambda law: jnp.stack([law.rate, law.rate]))


@pytest.mark.slow
def test_a_fit_from_periodic_states_is_one_by_plain_least_squares():
    runs = records(dampers.Bilinear(2600.0, 1400.0))
    periodic = identify.fit(dampers.Lag(dampers.Linear(900.0), 0.004), runs, initial_state="periodic")
    assert "periodic" in periodic.criterion
    by_gain = periodic.sensitivity_to_records(lambda law: law.law.rate).by_gain["value"]
    assert by_gain.sum() == pytest.approx(
        float(parameters.get(periodic.law, "law.rate")), rel=1e-3
    )  # all forces grow alike


@pytest.mark.slow
@pytest.mark.parametrize("bounds", [None, {"rebound_rate": (500.0, 6000.0)}])
@pytest.mark.exhaustive_cases("None")
def test_besinger_also_at_a_bound(bounds):
    runs = records(dampers.Besinger(3000.0, 8000.0, 1200.0, 0.15, 0.3), (0.02, 2.0), (0.03, 4.0))
    start = dampers.Besinger(2500.0, 5500.0, 1500.0, 0.2, 0.3)
    result = identify.fit(start, runs, bounds=bounds, freeze=["transition_velocity"])
    begin = np.array([e.value for e in result.parameters])
    found = check(
        result,
        ride_with(result.law),
        lambda runs: refitted(start, runs, begin, bounds=bounds, freeze=["transition_velocity"]),
        2e-6,
        1e-5,
    )
    assert found.held == (("rebound_rate",) if bounds else ())


@pytest.mark.slow
def test_a_law_with_states():
    runs = records(dampers.SeriesSpring(dampers.Bilinear(2600.0, 1400.0), 1.5e5))
    start = dampers.SeriesSpring(dampers.Linear(1700.0), 1e5)
    result = identify.fit(start, runs)
    begin = np.array([e.value for e in result.parameters])
    # complete fits of this law end within some 1e-4 of a difference at this step: shorter ones are rounded off
    check(result, ride_with(result.law), lambda runs: refitted(start, runs, begin), 2e-3, 3e-4)
