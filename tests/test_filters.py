"""Filters that need no `scipy.signal`: the numbers are SciPy's."""

import numpy as np
import pytest
import scipy.interpolate
import scipy.signal

from jaxdamp import _filters


VALUES = np.cumsum(np.random.default_rng(0).standard_normal(600))


@pytest.mark.parametrize(("window", "order", "derivative"), [(7, 4, 0), (21, 3, 1), (173, 5, 1)])
def test_smoothing_is_that_of_scipy(window: int, order: int, derivative: int) -> None:
    """But for the last bits, in which versions of SciPy differ."""
    expected = np.asarray(scipy.signal.savgol_filter(VALUES, window, order, deriv=derivative, delta=5e-3))
    smoothed = _filters.smoothed(VALUES, window, order, derivative, 5e-3)
    assert np.allclose(smoothed, expected, rtol=0.0, atol=1e-11 * np.max(np.abs(expected)))
    weights = scipy.signal.savgol_coeffs(window, order, deriv=derivative, use="dot")
    assert np.allclose(_filters.smoothing_weights(window, order, derivative), weights, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("decay", [0.0, 0.3, 0.999])
def test_a_decay_is_that_of_scipy(decay: float) -> None:
    """In each column."""
    values = np.stack([VALUES, VALUES[::-1]], axis=1)
    expected = scipy.signal.lfilter([1.0], [1.0, -decay], values, axis=0)
    assert np.allclose(_filters.decaying(values, decay), expected, rtol=1e-13, atol=1e-13)


def test_a_spline_is_that_of_scipy() -> None:
    """At its knots, between them, and at both ends."""
    places = np.array([0.0, 0.25, 1.0, 300.6, 597.9, 598.5, 599.0])
    expected = scipy.interpolate.CubicSpline(np.arange(600.0), VALUES)(places)
    assert np.allclose(_filters.spline(VALUES, places), expected, rtol=1e-13, atol=1e-12)
