from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.dampers import Polynomial, SegmentedPolynomial


def test_polynomial_inside_and_along_its_tangent_beyond():
    law = Polynomial([2000.0, -300.0, 150.0], (-1.0, 0.8))
    inside = np.linspace(-1.0, 0.8, 7)
    expected = np.polynomial.polynomial.polyval(inside, [0.0, 2000.0, -300.0, 150.0])
    np.testing.assert_allclose([law.force_velocity(v) for v in inside], expected, rtol=1e-12)
    slope = 2000.0 - 600.0 * 0.8 + 450.0 * 0.64
    np.testing.assert_allclose(law.force_velocity(2.0) - law.force_velocity(0.8), slope * 1.2, rtol=1e-12)


def test_polynomial_guess_finds_a_polynomial():
    v = np.linspace(-1.2, 1.0, 200)
    law = Polynomial.guess(v, 1800.0 * v - 250.0 * v**3, degree=3)
    np.testing.assert_allclose(law.coefficients, [1800.0, 0.0, -250.0], atol=1e-8)


def test_polynomial_guess_of_one_side_still_is_zero_at_rest():
    v = np.linspace(0.1, 1.0, 50)
    np.testing.assert_allclose(Polynomial.guess(v, 1000.0 * v, degree=2).force_velocity(0.0), 0.0, atol=1e-9)


def test_polynomial_range_must_hold_zero():
    with pytest.raises(ValueError, match=r"Polynomial\.velocity_range` must be a low and a high end with zero between"):
        Polynomial([1000.0], (0.1, 1.0))


def random_law(rng):
    shares = [rng.normal(size=n) * 500.0 for n in (4, 2, 4, 2, 4)]
    return SegmentedPolynomial([-0.6, -0.15], 0.2, *shares, velocity_range=(-1.5, 1.2))


def segment_of(v):
    return int(np.searchsorted([-0.6, -0.15, 0.0, 0.2], v))


@pytest.mark.slow
def test_the_21_coefficients_of_the_paper(rng):
    for _ in range(3):
        law = random_law(rng)
        pieces = list(law.coefficients().values())
        assert [len(p) for p in pieces] == [5, 3, 5, 3, 5]
        for v in np.linspace(-1.5, 1.2, 109):
            expected = np.polynomial.polynomial.polyval(v, pieces[segment_of(v)])
            np.testing.assert_allclose(law.force_velocity(v), expected, rtol=1e-9, atol=1e-8)


def test_the_coefficients_of_a_law_without_high_powers():
    shares = [100.0, 0.0, 0.0, 0.0]
    law = SegmentedPolynomial([-0.6, -0.15], 0.2, shares, [50.0, 0.0], shares, [200.0, 0.0], shares)
    pieces = law.coefficients()
    np.testing.assert_allclose(pieces["3: v2 < v <= 0"], [0.0, 100.0 / 0.15, 0.0, 0.0, 0.0], rtol=1e-12)
    np.testing.assert_allclose(pieces["5: v > v4"], [100.0, 500.0, 0.0, 0.0, 0.0], atol=1e-9)


def test_no_jump_at_the_joints_and_zero_at_rest(rng):
    law = random_law(rng)
    pieces = list(law.coefficients().values())
    for joint, (below, above) in zip((-0.6, -0.15, 0.0, 0.2), pairwise(pieces), strict=True):
        values = [np.polynomial.polynomial.polyval(joint, p) for p in (below, above)]
        np.testing.assert_allclose(values[0], values[1], rtol=1e-9, atol=1e-8)
        around = [float(law.force_velocity(v)) for v in (np.nextafter(joint, -1.0), np.nextafter(joint, 1.0))]
        np.testing.assert_allclose(around, values[0], rtol=1e-9, atol=1e-8)
    assert law.force_velocity(0.0) == 0.0


def test_segments_go_on_along_their_tangents(rng):
    law = random_law(rng)
    slope = jax.jit(jax.grad(law.force_velocity))
    for end, side in ((-1.5, -1.0), (1.2, 1.0)):
        np.testing.assert_allclose(slope(end + 0.5 * side), slope(end - 1e-9 * side), rtol=1e-6)
        rise = law.force_velocity(end + 2.0 * side) - law.force_velocity(end)
        np.testing.assert_allclose(rise, 2.0 * side * slope(end + 0.5 * side), rtol=1e-9)


@pytest.mark.parametrize("low", [-1.2, 0.02])
def test_segmented_guess_fits_its_data(low):
    v = np.linspace(low, 1.1, 400)
    force = 800.0 * np.tanh(3.0 * v) + 600.0 * v
    law = SegmentedPolynomial.guess(v, force)
    found = jax.vmap(law.force_velocity)(jnp.asarray(v))
    assert np.sqrt(np.mean((found - force) ** 2)) < 5.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"compression_knots": [-0.1, -0.5]}, r"compression_knots` must be strictly increasing and negative \[m/s\]"),
        ({"shares_low_rebound": [1.0]}, r"`shares_low_rebound` must hold 2 numbers, but is of shape \(1,\)"),
        ({"velocity_range": (-0.4, 1.0)}, r"`velocity_range` must hold the knots \[-0\.5 -0\.1\] and 0\.2 m/s"),
        ({"rebound_knot": -0.2}, r"rebound_knot` must be positive"),
    ],
)
def test_segmented_refusals(change, message):
    arguments = dict(
        compression_knots=[-0.5, -0.1],
        rebound_knot=0.2,
        shares_low_compression=[1.0] * 4,
        shares_mid_compression=[1.0] * 2,
        shares_high_compression=[1.0] * 4,
        shares_low_rebound=[1.0] * 2,
        shares_high_rebound=[1.0] * 4,
    )
    with pytest.raises(ValueError, match=message):
        SegmentedPolynomial(**(arguments | change))
