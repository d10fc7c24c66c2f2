"""The posterior by sampling, beside the covariance of a linear law and an integral for a banana."""

import dataclasses
import sys

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal

from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import Besinger, Bilinear, Linear, Saturating
from jaxdamp.dampers.besinger import least_rebound
from jaxdamp.identify import fit, fit_targets


@pytest.mark.slow
def test_the_posterior_of_a_linear_law_has_the_covariance_of_the_fit(sines):
    pytest.importorskip("numpyro")
    result = fit(Bilinear, sines(Bilinear(2600.0, 1200.0), noise=20.0))
    posterior = result.posterior(samples=1500, warm_up=300, seed=1)
    for estimate in result.parameters:
        row = posterior[estimate.name]
        assert row.mean == pytest.approx(estimate.value, abs=0.15 * estimate.standard_error)
        assert row.standard_deviation == pytest.approx(estimate.standard_error, rel=0.1)
        np.testing.assert_allclose(row.interval, estimate.interval, atol=0.25 * estimate.standard_error)
        assert row.r_hat < 1.02 and row.effective > 500
    assert posterior.divergences == 0
    ratio = posterior.propagate(lambda law: law.rebound_rate / law.compression_rate)
    assert float(ratio.standard_error) == pytest.approx(
        float(result.propagate(lambda law: law.rebound_rate / law.compression_rate).standard_error), rel=0.1
    )
    assert len(posterior.table().rows) == 2


@pytest.mark.slow
def test_the_posterior_of_a_banana_is_that_of_an_integral_over_a_grid(sines):
    pytest.importorskip("numpyro")
    law = Saturating(900.0, 2000.0, 900.0, 2000.0)
    runs = sines(law, noise=120.0, tests=[(0.01, 2.0), (0.01, 3.0), (0.01, 5.0)])
    ties = {"compression_force": "rebound_force", "compression_rate": "rebound_rate"}
    result = fit(law, runs, freeze=["*high_rate"], tie=ties)
    drawn = result.posterior(samples=1500, warm_up=400, seed=2).samples[:, 0]
    v, force = (np.concatenate([getattr(r, name) for r in result.runs]) for name in ("velocity", "force"))
    levels, rates = np.linspace(600.0, 1500.0, 181), np.linspace(1700.0, 2300.0, 121)
    squares = np.array([[np.sum((a * np.tanh(c * v / a) - force) ** 2) for c in rates] for a in levels])
    density = np.exp(-0.5 * v.size * np.log(squares / squares.min())).sum(axis=1)  # flat prior, unknown noise
    below = np.cumsum(density) / density.sum()
    for share in (0.025, 0.25, 0.5, 0.75, 0.975):
        assert np.mean(drawn < np.interp(share, below, levels)) == pytest.approx(share, abs=0.04)


def test_without_the_package_the_error_says_what_to_install(sines, monkeypatch):
    result = fit(Bilinear, sines(Bilinear(2600.0, 1200.0), noise=20.0))
    for name in ("numpyro", "numpyro.infer"):  # the second, as another test may have imported it
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError, match=r"pip install 'jaxdamp\[bayes\]'"):
        result.posterior()


@pytest.mark.slow
def test_priors_losses_and_the_machine_count_as_in_a_linear_fit(sines):
    pytest.importorskip("numpyro")
    runs = sines(Bilinear(2600.0, 1200.0), noise=20.0)
    spiked = [dataclasses.replace(r, force=r.force + 3e3 * (np.arange(len(r)) % 97 == 5) - 60.0) for r in runs]
    known = {"gas_force": (-61.0, 0.3), "rebound_rate": (2610.0, 4.0)}
    result = fit(Bilinear, spiked, rig="gas", loss="student_t", priors=known)
    drawn = result.posterior(samples=1000, warm_up=300, seed=3)
    for estimate in result.parameters:
        row = drawn[estimate.name]
        assert row.mean == pytest.approx(estimate.value, abs=0.15 * estimate.standard_error)
        assert row.standard_deviation == pytest.approx(estimate.standard_error, rel=0.1)


@pytest.mark.slow
def test_the_posterior_of_targets_is_normal_since_their_tolerances_are_known():
    pytest.importorskip("numpyro")

    def numbers(law):
        return {"sum": law.rebound_rate + law.compression_rate, "ratio": law.rebound_rate / law.compression_rate}

    result = fit_targets(numbers, Bilinear(2000.0, 1000.0), {"sum": (3800.0, 50.0), "ratio": (2.2, 0.1)})
    drawn = result.posterior(samples=800, warm_up=200, seed=1)
    jacobian = np.array([[1.0, 1.0], [1.0 / 1187.5, -2612.5 / 1187.5**2]]) / np.array([[50.0], [0.1]])
    errors = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    for row, value, error in zip(drawn.parameters, (2612.5, 1187.5), errors, strict=True):
        assert row.mean == pytest.approx(value, abs=0.15 * error)
        assert row.standard_deviation == pytest.approx(error, rel=0.12) and row.r_hat < 1.03


@pytest.mark.slow
def test_a_posterior_without_finite_numbers_about_the_fit_is_refused():
    pytest.importorskip("numpyro")

    def numbers(p):
        return {"a": jnp.where(jnp.abs(p["x"] - 1.5) < 1e-9, 2.0 * p["x"], jnp.nan)}

    result = fit_targets(numbers, {"x": 1.5}, {"a": (3.0, 0.1)}, starts=1)
    with pytest.raises(ValueError, match="one without any at the starts of the chains"):
        result.posterior(samples=10, warm_up=10)


@pytest.mark.slow
def test_no_sample_breaks_a_condition_of_the_law():
    pytest.importorskip("numpyro")
    law = Besinger(4000.0, 900.0, 400.0, limit_velocity=0.3, transition_velocity=0.02)
    runs = VirtualDyno(law, force_noise=400.0, sampling_rate=500.0).run([SineTest(0.02, 2.0)])
    result = fit(law, runs, starts=1, freeze=["limit_velocity", "transition_velocity", "blow_off_rate"])
    drawn = result.posterior(samples=300, warm_up=300, seed=1).samples
    share = float(least_rebound(law.limit_velocity, law.transition_velocity))
    assert len(drawn) > 150 and np.all(drawn[:, 1] > share * drawn[:, 0])
    assert np.min(drawn[:, 1] / drawn[:, 0]) < 1.02 * share  # up to the condition


@pytest.mark.exhaustive
def test_noise_with_a_memory_widens_the_posterior_but_not_the_priors(sines):
    pytest.importorskip("numpyro")
    runs, rng = sines(Linear(2000.0), noise=0.0), np.random.default_rng(4)
    memory = [scipy.signal.lfilter([1.0], [1.0, -0.9], 10.0 * rng.standard_normal(len(r))) for r in runs]
    noisy = [dataclasses.replace(r, force=r.force + n) for r, n in zip(runs, memory, strict=True)]
    flat = fit(Linear, noisy)
    own = flat["rate"]
    assert flat.inflation > 2.0
    mean, deviation = own.value + own.standard_error, 0.5 * own.standard_error
    drawn = fit(Linear, noisy, priors={"rate": (mean, deviation)}).posterior(samples=1500, warm_up=300, seed=5)["rate"]
    precision = own.standard_error**-2.0 + deviation**-2.0
    expected = (own.value * own.standard_error**-2.0 + mean * deviation**-2.0) / precision
    assert drawn.standard_deviation == pytest.approx(precision**-0.5, rel=0.15)
    assert drawn.mean == pytest.approx(expected, abs=0.3 * precision**-0.5)
