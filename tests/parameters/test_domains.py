"""Domains: their maps from raw numbers and back, and what they contain."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from jaxdamp.parameters import (
    Domain,
    increasing,
    increasing_negative,
    interval,
    nonnegative,
    ordered_interval,
    positive,
    real,
)


DOMAINS = [
    real,
    positive,
    nonnegative,
    increasing,
    increasing_negative,
    interval(-3.0, 0.5),
    ordered_interval(-2.0, 1.0),
]
RAW = arrays(np.float64, 4, elements=st.floats(-8.0, 8.0))
SCALE = arrays(np.float64, 4, elements=st.floats(1e-3, 1e6))


@pytest.mark.parametrize("domain", DOMAINS, ids=lambda d: d.name)
@settings(max_examples=40, deadline=None)
@given(raw=RAW, scale=SCALE)
def test_from_raw_lands_in_the_domain_and_to_raw_leads_back(domain: Domain, raw, scale):
    value = domain.from_raw(jnp.asarray(raw), jnp.asarray(scale))
    array = np.asarray(value)
    assert np.all(np.isfinite(array)) and np.all(array >= domain.lower) and np.all(array <= domain.upper)
    ordered = domain.steps is not None
    if not ordered or np.all(np.diff(array) > 1e-12 * np.abs(array).max()):
        assert domain.contains(array)
    if domain is nonnegative:
        raw = np.maximum(np.abs(raw), 0.1)  # a search starts at a hundredth of the scale
    # a difference of large numbers cannot tell steps that are smaller than their rounding
    if ordered and np.min(np.abs(np.diff(array))) < 1e-4 * np.abs(array).max():
        return
    np.testing.assert_allclose(domain.to_raw(value, jnp.asarray(scale)), raw, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("domain", "values"),
    [
        (real, [-2.0, 0.0, 5e3]),
        (positive, [1e-6, 1.0, 5e3]),
        (nonnegative, [0.5, 1.0, 5e3]),
        (increasing, [-2.0, 0.0, 5.0]),
        (increasing_negative, [-2.0, -0.5, -0.001]),
        (interval(-3.0, 6000.0), [-2.0, 0.0, 5e3]),
        (ordered_interval(-3.0, 1.0), [-2.0, 0.0, 0.9]),
    ],
    ids=lambda a: getattr(a, "name", ""),
)
def test_values_to_raw_and_back(domain, values):
    value, scale = jnp.array(values), jnp.array([2.0, 3.0, 4.0])
    assert domain.contains(np.asarray(value))
    np.testing.assert_allclose(domain.from_raw(domain.to_raw(value, scale), scale), value, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("domain", "values"),
    [
        (positive, [1.0, 0.0]),
        (nonnegative, [1.0, -1e-300]),
        (increasing, [0.0, 0.0]),
        (increasing_negative, [-1.0, 0.0]),
        (interval(0.0, 1.0), [0.5, 1.5]),
        (ordered_interval(0.0, 1.0), [0.7, 0.5]),
        (ordered_interval(0.0, 1.0), [0.5, 1.5]),
    ],
    ids=lambda a: getattr(a, "name", ""),
)
def test_domains_do_not_contain(domain, values):
    assert not domain.contains(np.array(values))


@pytest.mark.parametrize("make", [interval, ordered_interval])
@pytest.mark.parametrize("pair", [(1.0, 0.0), (0.0, np.inf), (np.nan, 1.0)])
def test_intervals_need_two_finite_numbers_in_order(make, pair):
    with pytest.raises(ValueError, match="Bounds must be two finite numbers in increasing order"):
        make(*pair)
