"""Triangles by products of columns, and by orthogonal transformations where rounding of the products would be seen."""

import numpy as np
import pytest

from jaxdamp import _triangles
from jaxdamp._triangles import orthonormal, triangle


@pytest.mark.parametrize("left", [1.0, 1e-2, 2e-3, 1e-6, 1e-9])
def test_a_column_that_hardly_differs_from_others_keeps_its_digits(left, rng):
    """Its last number is what the other columns leave of it; by products alone 1e-6 would have four digits."""
    orthogonal, _ = np.linalg.qr(rng.standard_normal((5000, 6)))
    mixed = orthogonal @ rng.standard_normal((6, 6)) @ np.diag(10.0 ** np.arange(-6.0, 6.0, 2.0))
    others, _ = np.linalg.qr(mixed[:, :5])
    apart = rng.standard_normal(5000)
    apart -= others @ (others.T @ apart)
    apart -= others @ (others.T @ apart)
    last = others @ np.ones(5) + left * apart / np.linalg.norm(apart)
    r = triangle(np.column_stack([mixed[:, :5], last]))
    assert abs(r[-1, -1]) == pytest.approx(left, rel=1e-9 + 1e-14 / left)
    np.testing.assert_allclose(np.abs(r), np.abs(np.linalg.qr(np.column_stack([mixed[:, :5], last]))[1]), rtol=1e-6)


def test_most_triangles_take_no_orthogonal_transformations(rng, monkeypatch):
    tall = rng.standard_normal((3000, 12))
    expected = np.abs(np.linalg.qr(tall)[1])
    monkeypatch.setattr(_triangles.np.linalg, "qr", None)
    np.testing.assert_allclose(np.abs(triangle(tall)), expected, rtol=1e-10, atol=1e-10)


def test_no_columns_have_a_triangle_without_rows():
    """As of a fit all of whose numbers ended at bounds."""
    assert triangle(np.zeros((3000, 0))).shape == (0, 0)
    assert orthonormal(np.zeros((3000, 0))).shape == (3000, 0)


@pytest.mark.parametrize("odd", [0.0, np.nan, np.inf])
def test_columns_of_zeros_or_of_no_numbers_are_those_of_a_triangle_too(odd, rng):
    tall = rng.standard_normal((400, 3))
    tall[:, 1] = odd
    with np.errstate(invalid="ignore", over="ignore"):
        r = triangle(tall)
    assert r.shape == (3, 3) and bool(np.isfinite(r).all()) == np.isfinite(odd)
    if np.isfinite(odd):
        np.testing.assert_allclose(r.T @ r, tall.T @ tall, atol=1e-10)
