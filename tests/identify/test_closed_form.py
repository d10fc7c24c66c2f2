"""Laws that are linear in their parameters: the minimum of `fit` is that of `numpy.linalg.lstsq`."""

from itertools import pairwise

import numpy as np
import pytest

from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import (
    AbstractDamper,
    AbstractStateless,
    Besinger,
    Bilinear,
    ForceSurface,
    FrequencySelective,
    Linear,
    PiecewiseLinear,
    Polynomial,
    StrokeDependent,
    Table,
)
from jaxdamp.identify import fit
from jaxdamp.parameters import get


TRUTH = Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)


def channels(runs):
    return np.concatenate([r.velocity for r in runs]), np.concatenate([r.force for r in runs])


def hinge(v, knots):
    """Columns of the slopes of a piecewise-linear curve through the origin."""
    edges = np.concatenate([[-np.inf], knots, [np.inf]])
    columns = [np.clip(v, low, high) - np.clip(0.0, low, high) for low, high in pairwise(edges)]
    return np.stack(columns, axis=1)


def polynomial(v):
    return np.stack([v**j for j in range(1, 6)], axis=1)


def sides(v):
    return np.stack([np.maximum(v, 0.0), np.minimum(v, 0.0)], axis=1)


KNOTS = np.array([-0.3, 0.0, 0.15, 0.4])
GRID = np.array([-0.7, -0.3, 0.0, 0.1, 0.3, 0.7])


@pytest.mark.parametrize(
    ("start", "freeze", "columns"),
    [
        (Linear, (), lambda v: v[:, None]),
        (Bilinear, (), sides),
        (Polynomial, (), polynomial),
        (Table(GRID, np.zeros(6)), (), lambda v: np.stack([np.interp(v, GRID, e) for e in np.eye(6)], axis=1)),
        (PiecewiseLinear(KNOTS, np.ones(5)), ("knots",), lambda v: hinge(v, KNOTS)),
        (Linear(1.0) + PiecewiseLinear(KNOTS, np.ones(5)) * 2.0, ("knots", "*rate", "factor"), None),
    ],
    ids=["linear", "bilinear", "polynomial", "table", "piecewise", "sum"],
)
def test_equals_lstsq(sines, start, freeze, columns):
    runs = sines(TRUTH, noise=20.0)
    v, force = channels(runs)
    result = fit(start, runs, freeze=freeze)
    matrix = (columns or (lambda v: 2.0 * hinge(v, KNOTS)))(v)
    target = force if columns else force - v
    expected, squares, *_ = np.linalg.lstsq(matrix, target, rcond=None)
    assert result.converged and result.steps == 0
    assert np.allclose([e.value for e in result.parameters], expected, rtol=1e-8)
    covariance = 400.0 * np.linalg.inv(matrix.T @ matrix)
    known = fit(start, runs, freeze=freeze, force_noise=20.0)
    assert np.allclose(known.covariance, covariance, rtol=1e-6, atol=1e-9 * covariance.max())
    assert np.allclose([e.standard_error for e in known.parameters], np.sqrt(np.diag(covariance)), rtol=1e-6)
    assert result.rmse == pytest.approx(np.sqrt(squares[0] / force.size), rel=1e-9)


def test_explicit_standard_deviations(sines):
    runs = sines(TRUTH, noise=20.0)
    sigma = np.array([5.0, 20.0, 80.0])
    result = fit(Bilinear, runs, weighting=sigma.tolist())
    v, force = channels(runs)
    weight = 1.0 / np.repeat(sigma, 800)
    matrix = sides(v) * weight[:, None]
    expected, squares, *_ = np.linalg.lstsq(matrix, force * weight, rcond=None)
    assert np.allclose([e.value for e in result.parameters], expected, rtol=1e-9)
    covariance = squares[0] / (v.size - 2) * np.linalg.inv(matrix.T @ matrix) * result.inflation**2
    assert np.allclose(result.covariance, covariance, rtol=1e-7)
    known = fit(Bilinear, runs, weighting=sigma.tolist(), force_noise=20.0)
    inverse = np.linalg.inv(matrix.T @ matrix)
    noisy = matrix * (20.0 * weight)[:, None]
    assert np.allclose(known.covariance, inverse @ noisy.T @ noisy @ inverse, rtol=1e-7)


def test_weighting_by_runs_counts_every_record_relative_to_its_force(sines):
    runs = sines(TRUTH, noise=20.0)
    result = fit(Bilinear, runs, weighting="runs")
    v, force = channels(runs)
    sigma = np.array([np.sqrt(np.mean(r.force**2) * len(r)) for r in runs])
    weight = 1.0 / np.repeat(sigma, 800)
    matrix = sides(v) * weight[:, None]
    expected = np.linalg.lstsq(matrix, force * weight, rcond=None)[0]
    assert np.allclose([e.value for e in result.parameters], expected, rtol=1e-9)
    left = (matrix @ expected - force * weight).reshape(3, 800)
    spread = np.repeat(np.sqrt(np.mean(left**2, axis=1) * v.size / (v.size - 2)), 800)
    inverse = np.linalg.inv(matrix.T @ matrix)
    noisy = matrix * spread[:, None] * result.inflation
    assert np.allclose(result.covariance, inverse @ noisy.T @ noisy @ inverse, rtol=1e-7)


def test_bounds_hold_and_are_flagged(sines):
    runs = sines(Bilinear(2600.0, 1200.0), noise=20.0)
    result = fit(Bilinear(1500.0, 1000.0), runs, bounds={"rebound_rate": (500.0, 2000.0)})
    rebound, compression = result.parameters
    assert 1999.0 < rebound.value < 2000.0
    assert rebound.note == "at a bound" and compression.note == ""
    assert any("rebound_rate = 2000 N s/m is at a bound" in w for w in result.warnings)
    v, force = channels(runs)
    matrix = np.minimum(v, 0.0)[:, None]
    expected, *_ = np.linalg.lstsq(matrix, force - rebound.value * np.maximum(v, 0.0), rcond=None)
    assert compression.value == pytest.approx(expected[0], rel=1e-9)
    frozen = fit(Bilinear(rebound.value, 1000.0), runs, freeze=["rebound_rate"])
    # the residual has one degree of freedom less where the bound counts as a parameter
    assert compression.standard_error == pytest.approx(frozen["compression_rate"].standard_error, rel=1e-3)


def test_frozen_parameters_stay(sines):
    runs = sines(Bilinear(2600.0, 1200.0), noise=20.0)
    result = fit(Bilinear(2000.0, 1000.0), runs, freeze=["rebound_rate"])
    assert [e.name for e in result.parameters] == ["compression_rate"]
    assert float(get(result.law, "rebound_rate")) == 2000.0
    assert result.covariance.shape == (1, 1)


def test_a_table_point_without_data_is_not_identifiable(sines):
    runs = sines(TRUTH, noise=20.0)
    result = fit(Table([-0.7, 0.0, 0.7, 2.0, 3.0], np.zeros(5)), runs, force_noise=150.0)
    assert [e.note for e in result.parameters] == ["", "", "", "not identifiable", "not identifiable"]
    assert np.isinf(result.parameters[-1].standard_error)
    assert np.all(np.isfinite(result.covariance[:3, :3])) and result.parameters[0].standard_error < 10.0


# ---- laws of the stroke and laws whose states no free parameter moves


def reference(columns, force):
    return np.linalg.lstsq(columns, force, rcond=None)[0]


def test_a_table_over_stroke_and_velocity_equals_lstsq(sines):
    runs = sines(TRUTH, noise=20.0)
    stroke, (v, force) = np.concatenate([r.stroke for r in runs]), channels(runs)
    result = fit(StrokeDependent.from_grid([-0.01, 0.01], GRID, np.zeros((2, 6))), runs)
    hats = np.stack([np.interp(v, GRID, e) for e in np.eye(6)], axis=1)
    upper = np.clip((stroke + 0.01) / 0.02, 0.0, 1.0)[:, None]
    expected = reference(np.concatenate([(1 - upper) * hats, upper * hats], axis=1), force)
    assert result.converged and result.steps == 0
    assert np.allclose([e.value for e in result.parameters], expected, rtol=1e-7, atol=1e-6)


def test_a_force_surface_starts_from_stroke_and_velocity_and_equals_lstsq(sines):
    runs = sines(TRUTH, noise=20.0)
    stroke, (v, force) = np.concatenate([r.stroke for r in runs]), channels(runs)
    result = fit(ForceSurface, runs)
    law = result.law
    ranges = np.array([get(law, "stroke_range"), get(law, "velocity_range")])
    u, w = ((2 * a - r.sum()) / np.ptp(r) for a, r in zip((stroke, v), ranges, strict=True))
    expected = reference(np.polynomial.chebyshev.chebvander2d(u, w, (3, 7)), force)
    assert result.converged and result.steps == 0
    assert np.allclose([e.value for e in result.parameters], expected, rtol=1e-6, atol=1e-5)


def test_a_single_sine_leaves_a_surface_open_and_the_fit_says_so(sines):
    runs = sines(TRUTH, noise=20.0, tests=[(0.02, 3.0)])
    result = fit(ForceSurface, runs)
    assert any("not identifiable" in w for w in result.warnings)
    assert result.rmse < 30.0
    assert np.max(np.abs([e.value for e in result.parameters])) < 10 * np.max(np.abs(runs[0].force))


@pytest.mark.slow
def test_a_law_with_states_that_are_frozen_needs_no_search(sines):
    truth = FrequencySelective(Linear(900.0), Linear(2000.0), 0.03, 0.002)
    runs = VirtualDyno(truth, force_noise=5.0).run([SineTest(0.02, f) for f in (0.5, 2.0, 6.0)])
    start = FrequencySelective(Linear(100.0), Linear(100.0), 0.03, 0.002)
    found = fit(start, runs, freeze=["*_time"])
    assert found.steps == 0
    for estimate, expected in zip(found.parameters, (900.0, 2000.0), strict=True):
        assert abs(estimate.value - expected) < 4 * estimate.standard_error + 0.5
    searched = fit(start, runs)
    assert searched.converged and searched.steps > 0
    assert searched["filter_time"].value == pytest.approx(0.03, rel=0.01)


class _Squared(AbstractStateless):
    law: AbstractDamper

    def force_stroke_velocity(self, x, v):
        force = self.law.force(x, v, self.law.initial_state())
        return force * abs(force)


def test_a_wrapper_that_says_nothing_is_searched(sines):
    result = fit(_Squared(Linear(40.0)), sines(Linear(1000.0), noise=5.0))
    assert result.steps > 0


def test_a_start_is_given_the_channels_that_it_asks_for(sines):
    runs = sines(TRUTH, noise=20.0)
    seen = {}

    def start(velocity, force, time, stroke):
        seen.update(velocity=velocity, force=force, time=time, stroke=stroke)
        return Linear(1000.0)

    fit(start, runs)
    for name, values in seen.items():
        assert np.array_equal(values, np.concatenate([getattr(run, name) for run in runs]))
