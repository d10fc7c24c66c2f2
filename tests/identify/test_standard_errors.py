"""Standard errors count partners as unknown and samples that are alike as few; groups are named."""

import numpy as np
import pytest

from jaxdamp.bench import BenchRun, SineTest, VirtualDyno
from jaxdamp.dampers import Besinger, Bilinear, Linear, LuGre, PiecewiseLinear, Spring
from jaxdamp.identify import default_ladder, estimating, fit, profile
from jaxdamp.identify.estimating import uncertainty, weak_directions
from jaxdamp.identify.noise import Noise, _corrected, autocorrelation, correlation_time


def coloured(rng, count, memory):
    """Noise of standard deviation 1 whose neighbours have this correlation."""
    noise = rng.standard_normal(count)
    for i in range(1, count):
        noise[i] = memory * noise[i - 1] + np.sqrt(1 - memory**2) * noise[i]
    return noise


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_the_correlation_time_is_that_of_the_noise(rng, memory):
    records = [coloured(rng, 6000, memory) for _ in range(4)]
    assert correlation_time(records) == pytest.approx((1 + memory) / (1 - memory), rel=0.2)
    assert correlation_time([np.zeros(50)]) == 1.0


def test_a_constant_error_counts_as_one_sample_a_record():
    assert correlation_time([np.full(400, 3.0)]) == pytest.approx(400.0, rel=0.01)


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_the_autoregression_is_that_of_the_noise(rng, memory):
    alike = autocorrelation(coloured(rng, 6000, memory))
    np.testing.assert_allclose(alike[:40], memory ** np.arange(40) if memory else 1.0, atol=0.1)


def white(count):
    return Noise(np.ones(count), (np.arange(count),), (np.ones(1),), 1.0, 1.0)


def test_correlated_noise_is_carried_by_its_covariance(rng):
    """The product with the Toeplitz matrix, written out."""
    matrix, alike = rng.standard_normal((60, 3)), 0.8 ** np.arange(60)
    noise = white(60)._replace(sigma=np.full(60, 2.0), correlations=(alike,))
    whole = 4.0 * 0.8 ** np.abs(np.subtract.outer(np.arange(60), np.arange(60)))
    np.testing.assert_allclose(noise.covariance_of(matrix), matrix.T @ whole @ matrix, rtol=1e-10)


def record(noise):
    """A linear damper of 2000 N s/m at 3 Hz and slowly beside it, with this noise in its force."""
    time = np.arange(len(noise)) / 400.0
    velocity = 0.2 * np.cos(6 * np.pi * time) + 0.1 * np.cos(1.7 * time)
    stroke = 0.2 / (6 * np.pi) * np.sin(6 * np.pi * time) + 0.1 / 1.7 * np.sin(1.7 * time)
    return BenchRun("record", time, stroke, velocity, 2000.0 * velocity + noise)


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.0, 0.95])
@pytest.mark.exhaustive_cases("0.0")
def test_errors_cover_the_scatter_whether_noise_is_alike_or_not(memory):
    noises = [20.0 * coloured(np.random.default_rng(seed), 4000, memory) for seed in range(60)]
    results = [fit(Linear, record(noise)) for noise in noises]
    z = np.array([(r["rate"].value - 2000.0) / r["rate"].standard_error for r in results])
    assert 0.6 < np.std(z) < 1.3
    if memory:
        assert np.std(z * [r.inflation for r in results]) > 2.0  # without the correction they do not cover
    else:
        assert all(r.inflation == 1.0 for r in results)
    assert not any(r.warnings for r in results)  # noise with a memory is no doubt about the law


def test_a_law_that_misses_something_has_errors_of_that_size(sines):
    """Two halves of the records give two answers, which differ by about what the errors say."""
    truth = Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
    halves = ([(0.02, 2.0), (0.01, 3.0)], [(0.02, 5.0), (0.01, 10.0)])
    one, other = (fit(Bilinear, sines(truth, noise=5.0, tests=tests)) for tests in halves)
    apart = abs(one["compression_rate"].value - other["compression_rate"].value)
    error = np.hypot(one["compression_rate"].standard_error, other["compression_rate"].standard_error)
    assert apart < 4.0 * error
    assert min(one.inflation, other.inflation) > 3.0
    samples = sum(map(len, one.runs)) / one.inflation**2
    assert one._evidence.noise.dof == pytest.approx(samples - 2.0)


def test_partners_count_as_unknown(rng):
    jacobian = rng.standard_normal((500, 3))
    jacobian[:, 2] = jacobian[:, 1] + 0.01 * jacobian[:, 2]
    known = uncertainty(jacobian, np.zeros(500), white(500))
    np.testing.assert_allclose(known.covariance, np.linalg.inv(jacobian.T @ jacobian), rtol=1e-8)


def test_a_weak_direction_names_those_who_take_part(rng):
    jacobian = rng.standard_normal((500, 4)) * [1.0, 1e4, 1e-3, 1.0]
    jacobian[:, 3] = 1e3 * jacobian[:, 2] + 1e-3 * rng.standard_normal(500)
    (direction,) = weak_directions(jacobian, 1.0, np.array([1.0, 1e-4, 1e3, 1.0]), 0.5)
    assert np.flatnonzero(direction).tolist() == [2, 3] and direction[2] * direction[3] < 0
    assert weak_directions(jacobian[:, :3], 1.0, np.array([1.0, 1e-4, 1e3]), 0.5) == []


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_degrees_of_freedom_without_what_the_fit_has_removed(rng, memory):
    """Satterthwaite's, by dense matrices: (tr Σ − tr PΣ) tr Σ / tr Σ², which is N − p for white noise."""
    lags = memory ** np.arange(60.0) if memory else np.ones(1)
    noise = Noise(np.full(60, 2.0), (np.arange(60),), (lags,), 0.0, 1.0)
    basis = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, 60), 5))[0]
    covariance = 4.0 * memory ** np.abs(np.subtract.outer(np.arange(60), np.arange(60)))
    whole, removed = np.trace(covariance), np.trace(basis.T @ covariance @ basis)
    corrected = _corrected(noise, basis)
    assert corrected.dof == pytest.approx((whole - removed) * whole / np.sum(covariance**2))
    if not memory:
        assert corrected.dof == pytest.approx(55.0)
    np.testing.assert_allclose(corrected.sigma, 2.0 * np.sqrt(whole / (whole - removed)))


def test_the_error_of_a_law_that_is_wrong_includes_what_it_misses():
    """Bilinear for a curve whose valves open: the interval holds for the law, the spread for what it misses too."""
    curve = PiecewiseLinear([-0.2, 0.0, 0.2], [600.0, 1200.0, 2600.0, 1000.0])
    tests = [SineTest(0.02, f, cycles=4) for f in (1.0, 3.0, 5.0)]
    runs = VirtualDyno(curve, sampling_rate=250.0, force_noise=5.0).run(tests)
    wrong, right = fit(Bilinear, runs, starts=1), fit(PiecewiseLinear, runs, starts=1)
    rate = wrong["rebound_rate"]
    assert rate.spread is not None and rate.spread > 2.0 * rate.standard_error
    slow = fit(Bilinear, runs[:1], starts=1)["rebound_rate"].value
    assert abs(slow - rate.value) < 4.0 * rate.spread and abs(slow - rate.value) > 4.0 * rate.standard_error
    assert any("hold for this law, not for the damper" in warning for warning in wrong.warnings)
    assert "with what the law misses" in str(wrong.parameters_table())
    assert wrong.to_dict()["parameters"][0]["spread"] == pytest.approx(rate.spread)
    assert all(e.spread is None for e in right.parameters)


def test_a_knot_between_equal_slopes_is_not_identifiable(sines):
    """Its place hardly matters: the records determine a curve without it."""
    truth = PiecewiseLinear([0.12], [1600.0, 900.0])
    start = PiecewiseLinear([-0.15, 0.1, 0.3], [1500.0, 1550.0, 1000.0, 950.0])
    result = fit(start, sines(truth, noise=5.0, seed=2), starts=1)
    notes = [e.note for e in result.parameters if "knots" in e.name]
    assert notes == ["not identifiable", "", "not identifiable"]
    told = [warning for warning in result.warnings if warning.startswith("knots[2] is not identifiable")]
    assert len(told) == 1 and told[0].endswith("the curve hardly bends there. Take one with fewer knots.")


@pytest.mark.slow
def test_all_certain_numbers_are_moved_away(monkeypatch):
    """Of a law with many numbers in doubt, not only the first: each search ends where it gains nothing more."""
    law = LuGre.guess(np.array([-0.3, 0.0, 0.3]), np.array([-600.0, 100.0, 900.0])) + Linear(1500.0) + Spring(2000.0)
    tests = [SineTest(0.02, 1.0, cycles=3), SineTest(0.02, 4.0, cycles=3)]
    runs = VirtualDyno(law, sampling_rate=400.0, force_noise=10.0, seed=2).run(tests)
    plain, moved, certain = profile.Searches.end, set(), []

    def end(searches, values, max_steps, *, held=None):
        moved.update(() if held is None else [held])
        return plain(searches, values, max_steps, held=held)

    def profiled(problem, found, errors, far, chosen, variance):
        certain.extend(np.flatnonzero(chosen & (errors > 0)))
        return profile.profile(problem, found, errors, far, chosen, variance)

    monkeypatch.setattr(profile.Searches, "end", end)
    monkeypatch.setattr(estimating, "profile", profiled)
    fit(default_ladder(runs, ["visco_plastic_spring"])["visco_plastic_spring"], runs, starts=1)
    assert len(certain) > 6 and moved == set(certain)


def test_white_noise_of_records_has_a_level_for_each_where_they_differ():
    """The value of a noisy record alone was called four times too certain."""
    scores = []
    for seed in range(25):
        rng, runs = np.random.default_rng(seed), []
        for i in range(3):
            t = np.arange(800) / 400
            v = 0.02 * 2 * np.pi * np.cos(2 * np.pi * t)
            force = 2000.0 * v + rng.normal(0.0, 5.0 if i else 50.0, t.size)
            runs.append(BenchRun(f"{i}", t, 0.02 * np.sin(2 * np.pi * t), v, force))
        result = fit(Linear, runs, per_record=["rate"])
        scores.append([(e.value - 2000.0) / e.standard_error for e in result.parameters[:3]])
    spread = np.std(scores, axis=0)
    assert np.all((spread > 0.6) & (spread < 1.5)), spread
