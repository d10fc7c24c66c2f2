"""The coordinates of searches."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.dampers import (
    PiecewiseLinear,
    PowerLaw,
    SegmentedPolynomial,
)
from jaxdamp.parameters import (
    Coordinates,
    checked,
    free_parameters,
)

from .laws import composed


SMOOTH = ("none", "ordered", "all")


@pytest.mark.parametrize("smooth", SMOOTH)
def test_coordinates_lead_to_the_values_and_back(smooth):
    free = free_parameters(composed(), bounds={"lag_time": (0.001, 0.01)})
    coordinates = Coordinates(free, smooth)
    np.testing.assert_allclose(coordinates.to_physical(coordinates.start), free.values, rtol=1e-12)
    other = free.values * 1.2
    np.testing.assert_allclose(coordinates.to_physical(coordinates.from_physical(other)), other, rtol=1e-9)


@pytest.mark.parametrize("smooth", SMOOTH)
def test_coordinates_within_bounds_and_order_are_values_within_their_domains(smooth, rng):
    law = PiecewiseLinear([-0.1, 0.2, 0.25], [500.0, 2000.0, 800.0, 700.0])
    coordinates = Coordinates(free_parameters(law, bounds={"slopes": (100.0, 3000.0)}), smooth)
    (lower, upper), (rows, gaps) = coordinates.bounds(), coordinates.order()
    assert rows.shape == ((2, 7) if smooth == "none" else (0, 7))
    inside = 0
    for _ in range(20):
        y = np.clip(np.asarray(coordinates.start) + 0.3 * rng.standard_normal(7), lower, upper)
        if np.all(rows @ y >= gaps):
            checked(coordinates.free.build(coordinates.to_physical(jnp.asarray(y))))
            slopes = coordinates.to_physical(jnp.asarray(y))[3:]
            assert np.all((slopes >= 100.0) & (slopes <= 3000.0))
            inside += 1
    assert inside > 5


def test_ends_that_do_not_belong_to_a_domain_are_not_reached():
    law = SegmentedPolynomial([-1.0, -0.01], 0.2, [1.0] * 4, [1.0] * 2, [1.0] * 4, [1.0] * 2, [1.0] * 4)
    coordinates = Coordinates(free_parameters(law, over=["compression_knots", "rebound_knot"]), "none")
    lower, upper = (np.asarray(coordinates.to_physical(side)) for side in map(np.asarray, coordinates.bounds()))
    assert np.all(upper[:2] < 0.0) and lower[2] > 0.0


def test_rows_of_order_say_when_knots_meet():
    coordinates = Coordinates(free_parameters(PiecewiseLinear([-0.1, 0.2], [5.0, 6.0, 7.0]), over=["knots"]), "none")
    rows, gaps = coordinates.order()
    y = coordinates.from_physical(jnp.array([0.1, 0.3]))
    np.testing.assert_allclose(rows @ np.asarray(y), [0.2], rtol=1e-12)
    assert 0.0 < gaps[0] < 1e-6


def test_a_raw_step_of_one_is_of_the_size_of_the_parameter():
    law = SegmentedPolynomial([-1.0, -0.01], 0.2, [1.0] * 4, [1.0] * 2, [1.0] * 4, [1.0] * 2, [1.0] * 4)
    coordinates = Coordinates(free_parameters(law, over=["compression_knots"]), "ordered")
    slope = jax.jacfwd(coordinates.to_physical)(coordinates.start)
    np.testing.assert_allclose(np.abs(slope[1, 1]), 0.01, rtol=0.5)
    np.testing.assert_allclose(np.abs(slope[0, 0]), 0.99, rtol=0.5)


def test_a_zero_starts_inside_its_domain_where_the_map_is_smooth():
    coordinates = Coordinates(free_parameters(PowerLaw(1800.0, 0.5, 900.0, 0.5), over=["rebound_offset"]), "all")
    np.testing.assert_allclose(coordinates.to_physical(coordinates.start), [0.01], rtol=1e-6)


def test_vectors_without_numbers():
    free = free_parameters(PiecewiseLinear([], [1500.0]))
    assert free.names == ["slopes[0]"] and free.values.shape == free.limits()[0].shape == (1,)
    for smooth in SMOOTH:
        assert Coordinates(free, smooth).start.shape == (1,)


def test_ends_of_ranges_and_neighbours():
    law = PiecewiseLinear([-0.1, 0.2], [500.0, 2000.0, 800.0])
    coordinates = Coordinates(free_parameters(law, bounds={"slopes": (100.0, 3000.0)}), "ordered")
    ends = coordinates.at_ends(np.array([0.2 - 1e-7, 0.2, 100.0, 3000.0, 800.0]))
    np.testing.assert_array_equal(ends, [1.0, -1.0, -1.0, 1.0, 0.0])
