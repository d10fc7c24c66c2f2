"""Bands, functions of a fitted law and profiles: closed forms, other methods, and what they refuse."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from jaxdamp import Ride, plots, roads, vehicles
from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import Besinger, Bilinear, Linear, PiecewiseLinear, Saturating, SeriesSpring, Table
from jaxdamp.dampers.besinger import least_rebound
from jaxdamp.identify import FitResult, fit, fit_targets, propagation
from jaxdamp.parameters import free_parameters
from jaxdamp.rig import Rig


@pytest.fixture(scope="module")
def bilinear(sines) -> FitResult:
    return fit(Bilinear, sines(Bilinear(2600.0, 1200.0), noise=20.0))


@pytest.fixture(scope="module")
def curved(sines) -> FitResult:
    """A curve of which the records show little more than the slope: level and slope go together along a banana."""
    law = Saturating(900.0, 2000.0, 900.0, 2000.0)
    runs = sines(law, noise=120.0, tests=[(0.01, 2.0), (0.01, 3.0), (0.01, 5.0)])
    ties = {"compression_force": "rebound_force", "compression_rate": "rebound_rate"}
    return fit(law, runs, freeze=["*high_rate"], tie=ties)


def test_the_band_of_two_slopes(bilinear):
    velocities = np.array([-0.4, -0.1, 0.0, 0.2])
    band = bilinear.band(velocities)
    half = [0.5 * np.ptp(bilinear[name].interval) for name in ("compression_rate", "rebound_rate")]
    np.testing.assert_allclose(band.upper - band.lower, 2.0 * np.abs(velocities) * np.array(half)[[0, 0, 0, 1]])
    np.testing.assert_allclose(band.force, [bilinear.law.force_velocity(v) for v in velocities])
    assert band.plot().axes[0].get_legend_handles_labels()[1][-1].endswith("95 %")
    with pytest.raises(ValueError, match="bands"):
        plots.force_velocity({"bilinear": bilinear.law}, bands={"linear": band})


def test_any_function_by_derivatives_and_by_samples(bilinear):
    def ratio(law):
        return law.rebound_rate / law.compression_rate

    by_slopes, by_samples = bilinear.propagate(ratio), bilinear.propagate(ratio, samples=4000, seed=1)
    value, error = float(by_slopes.value), float(by_slopes.standard_error)
    shares = [e.standard_error / e.value for e in bilinear.parameters]
    assert error == pytest.approx(value * np.hypot(*shares), rel=1e-6)  # independent errors
    assert float(by_samples.standard_error) == pytest.approx(error, rel=0.05)
    np.testing.assert_allclose(
        [by_samples.lower, by_samples.upper], [by_slopes.lower, by_slopes.upper], atol=0.15 * error
    )
    with pytest.raises(ValueError, match="`samples` must be 2 or more"):
        bilinear.propagate(ratio, samples=1)
    for how in (lambda seed: bilinear.propagate(ratio, samples=2, seed=seed), lambda s: bilinear.posterior(seed=s)):
        with pytest.raises(ValueError, match="`seed` must be a whole number, 0 or more, but is the number -1"):
            how(-1)


@pytest.mark.parametrize("samples", [None, 50])
def test_results_have_the_structure_that_the_function_returns(bilinear, samples):
    def both(law):
        return {"rates": (law.rebound_rate, law.compression_rate), "law": law, "curve": law.rebound_rate * jnp.ones(3)}

    found = bilinear.propagate(both, samples=samples)
    error = found.standard_error
    assert error["rates"][0] == error["law"].rebound_rate > 0 and error["curve"].shape == (3,)
    assert np.all(found.lower["curve"] < found.value["curve"]) and found.upper["rates"][1] > found.value["rates"][1]
    assert samples is None or found.samples["curve"].shape == (50, 3)
    for wrong in (lambda law: {"words": "none", "rate": law.rebound_rate}, lambda law: None):
        with pytest.raises(ValueError, match="`function` must return real numbers"):
            bilinear.propagate(wrong, samples=samples)


def test_truths_and_counts_have_no_derivatives_but_samples(bilinear):
    """Their errors were zero."""
    rate = bilinear["rebound_rate"].value
    for kind, of in (
        ("bool", lambda law: law.rebound_rate > rate),
        ("int", lambda law: jnp.round(law.rebound_rate).astype(int)),
    ):
        with pytest.raises(ValueError, match=f"derivatives, but is one that returns {kind}.*`samples=1000`"):
            bilinear.propagate(of)
        assert bilinear.propagate(of, samples=50).standard_error > 0.0


@pytest.mark.parametrize("samples", [None, 20])
def test_whole_numbers_that_depend_on_nothing_are_results_without_error(bilinear, samples):
    """JAX traces them too, if `jnp` makes them."""
    found = bilinear.propagate(lambda law: (law.rebound_rate, jnp.arange(3), jnp.asarray(True), 7), samples=samples)
    assert found.standard_error[0] > 0.0 and found.value[1].tolist() == [0, 1, 2] and found.value[2:] == (1, 7)
    assert not np.any(found.standard_error[1]) and found.standard_error[2] == 0.0


def test_samples_of_knots_are_in_their_order(bilinear):
    """Of the normal distribution, six in ten are not."""
    law = PiecewiseLinear(np.array([-0.05, -0.02, 0.02, 0.05]), np.array([800.0, 2500.0, 4000.0, 1500.0, 900.0]))
    free = free_parameters(law, over=["knots"])
    problem = bilinear._evidence.problem._replace(free=free)
    minimum = bilinear._evidence.minimum._replace(values=np.asarray(free.values, float))
    evidence = bilinear._evidence._replace(problem=problem, minimum=minimum, covariance=0.03**2 * np.eye(4))
    drawn = np.asarray(propagation.propagate(evidence, lambda law: law.knots, samples=200).samples)
    assert drawn.shape == (200, 4) and np.all(np.diff(drawn, axis=1) > 0)


@pytest.mark.slow
def test_a_ride_metric(sines):
    result = fit(Linear, sines(Linear(1500.0), noise=200.0))
    car = vehicles.presets.quarter_car_000(Linear(1500.0))
    ride = Ride(car, roads.white("C", 20.0), metrics=["rms_sprung_acceleration"])
    found = result.propagate(lambda law: ride({"damper.rate": law.rate})["rms_sprung_acceleration"])
    rate, step = result["rate"], 1.0
    near = [float(ride({"damper.rate": rate.value + way})["rms_sprung_acceleration"]) for way in (-step, step)]
    assert float(found.standard_error) == pytest.approx(rate.standard_error * abs(near[1] - near[0]) / 2.0, rel=1e-4)


@pytest.mark.slow
def test_laws_with_states_rigs_and_records_of_their_own(maxwell_runs):
    rng = np.random.default_rng(0)
    runs = [dataclasses.replace(r, force=r.force + 2.0 * rng.standard_normal(len(r))) for r in maxwell_runs[:2]]
    start = SeriesSpring(Linear(1500.0), 4e5)
    result = fit(start, runs, rig=Rig(force_offset=1.0), freeze=["cubic_stiffness"], per_record=["force_offset"])
    band = result.band(np.array([-0.1, 0.1]))
    width = 0.1 * np.ptp(result["law.law.rate"].interval)
    np.testing.assert_allclose(band.upper - band.lower, width, rtol=1e-3)


def test_what_nothing_shows_is_infinite(bilinear, sines):
    table = Table(np.array([-0.7, 0.0, 0.7, 9.0, 10.0]), np.zeros(5))
    blind = fit(table, sines(Linear(2000.0), noise=5.0))
    errors = blind.propagate(lambda law: law.force_points).standard_error
    assert np.all(np.isfinite(errors[:3])) and np.isinf(errors[4])
    with pytest.raises(ValueError, match="finite standard errors"):
        blind.propagate(lambda law: law.force_points, samples=10)
    name = "force_points[4]"
    curve = blind.profile(name)
    assert curve.interval == (-np.inf, np.inf) and curve.warnings == (
        f"The records do not bound {name} on both sides.",
    )
    bounded = fit(table, blind.runs, bounds={"force_points": (-1e7, 1e7)}).profile(name)
    assert bounded.interval == (-1e7, 1e7) and not bounded.warnings
    with pytest.raises(ValueError, match="evidence"):
        dataclasses.replace(bilinear, evidence=None).band(np.array([0.1]))


def test_the_profile_of_a_linear_law_is_its_parabola(bilinear):
    rate, curve = bilinear["rebound_rate"], bilinear.profile("rebound_rate")
    np.testing.assert_allclose(curve.cost, ((curve.values - rate.value) / rate.standard_error) ** 2, atol=1e-6)
    ends, expected = (np.array(interval) - rate.value for interval in (curve.interval, rate.interval))
    np.testing.assert_allclose(ends, expected, rtol=1e-4)  # Student's t, not 1.96
    assert len(curve.plot().axes[0].get_lines()) >= 4
    with pytest.raises(KeyError, match="rebound_rat"):
        bilinear.profile("rebound_rat")


def test_a_profile_counts_noise_with_a_memory_as_the_standard_error_does(sines):
    """It is greater for an offset than for what goes to and fro."""
    rng = np.random.default_rng(0)
    runs = [
        dataclasses.replace(run, force=run.force + lfilter([1.0], [1.0, -0.98], rng.standard_normal(len(run))))
        for run in sines(Linear(2000.0))
    ]
    result = fit(Linear, runs, rig="offset")
    assert result.inflation > 3.0
    for one in result.parameters:
        ends = np.array(result.profile(one.name).interval) - one.value
        np.testing.assert_allclose(ends, np.array(one.interval) - one.value, rtol=1e-3)


def test_the_profile_of_a_banana(curved):
    """The ends are where the least squares over the other parameter, by another method, have risen by the level."""
    level, curve = curved["rebound_force"], curved.profile("rebound_force")
    low, high = curve.interval
    assert high - level.value > 1.3 * (level.value - low)  # the standard error has both sides alike
    v, force = (np.concatenate([getattr(r, name) for r in curved.runs]) for name in ("velocity", "force"))

    def squares(rate, at):
        return float(np.sum((at * np.tanh(rate * v / at) - force) ** 2))

    least = squares(curved["rebound_rate"].value, level.value)
    variance = least / (v.size - 2)
    for end in curve.interval:
        other = minimize_scalar(squares, bounds=(500.0, 5000.0), args=(end,), method="bounded", options={"xatol": 1e-6})
        assert (other.fun - least) / variance == pytest.approx(curve.level, rel=0.03)


def test_a_profile_goes_on_along_a_condition_of_the_law():
    """At a minimum on the condition between two rates, one can only move if the other follows it."""
    law = Besinger(4000.0, 900.0, 400.0, limit_velocity=0.3, transition_velocity=0.02)
    runs = VirtualDyno(law, force_noise=400.0, sampling_rate=500.0).run([SineTest(0.02, 2.0)])
    held = ["limit_velocity", "transition_velocity", "blow_off_rate"]
    result = fit(law, runs, starts=1, freeze=held)
    compression, curve = result["compression_rate"], result.profile("compression_rate")
    low, high = curve.interval
    assert low < compression.value < 4000.0 < high  # where the interval once ended at the value
    share, v = float(least_rebound(law.limit_velocity, law.transition_velocity)), runs[0].velocity
    rates = [(a, b, c, 0.3, 0.02) for a, b, c in (1.0 + np.eye(4, 3, -1)).tolist()]
    ones, *twice = (jax.vmap(Besinger(*each).force_velocity)(jnp.asarray(v)) for each in rates)
    unit = [np.asarray(other - ones) for other in twice]
    left = runs[0].force - 400.0 * unit[2]

    def squares(rate: float) -> float:
        """The least by the other rate, of which the force is linear, where the condition holds."""
        other = max(float(unit[1] @ (left - rate * unit[0]) / (unit[1] @ unit[1])), share * rate)
        return float(np.sum((left - rate * unit[0] - other * unit[1]) ** 2))

    rises = np.array([squares(rate) for rate in curve.values]) - squares(compression.value)
    np.testing.assert_allclose(curve.cost, rises / result.rmse**2, rtol=0.02, atol=0.02)


@pytest.mark.parametrize("rig", [None, pytest.param("offset", marks=pytest.mark.slow)])
def test_a_band_from_the_printed_program_is_that_of_jax(sines, rig):
    runs = sines(SeriesSpring(Bilinear(2000.0, 1200.0), 3e5), noise=5.0, tests=[(0.02, 0.5), (0.02, 3.0)])
    result = fit(SeriesSpring(Bilinear(1500.0, 1500.0), 2e5), runs, rig=rig)
    velocity, evidence = np.array([-0.3, 0.1, 0.3]), result._evidence
    assert propagation._printed_slopes(evidence, velocity, 2000) is not None
    expected = propagation.propagate(evidence, partial(propagation._held, velocity=velocity, steps=2000))
    band = result.band(velocity)
    width = 2.0 * evidence.quantile * expected.standard_error
    np.testing.assert_allclose(band.upper - band.lower, width, rtol=1e-10)


def test_samples_of_a_fit_to_targets_are_normal_since_their_tolerances_are_known():
    def numbers(law):
        return {"sum": law.rebound_rate + law.compression_rate, "ratio": law.rebound_rate / law.compression_rate}

    result = fit_targets(numbers, Bilinear(2000.0, 1000.0), {"sum": (3800.0, 50.0), "ratio": (2.2, 0.1)}, starts=1)
    drawn = result.propagate(lambda law: law.force_velocity(0.5), samples=2000, seed=2)
    assert float(drawn.standard_error) == pytest.approx(0.5 * 50.584, rel=0.05)  # of (JᵀJ)⁻¹ of the targets
    assert float(drawn.upper - drawn.lower) == pytest.approx(1.96 * 50.584, rel=0.05)
