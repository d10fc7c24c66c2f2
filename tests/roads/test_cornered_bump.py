import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

from jaxdamp.roads import half_sine_bump, trapezoid_bump, triangular_bump
from jaxdamp.roads.cornered_bump import rounded_corner


TIME = np.linspace(0.0, 4.0, 4001)


def test_half_sine_closed_form():
    inside = (TIME >= 1.0) & (TIME <= 1.5)
    expected = np.where(inside, 0.1 * np.sin(np.pi * (TIME - 1.0) / 0.5), 0.0)
    np.testing.assert_allclose(half_sine_bump(0.1, length=2.5, speed=5.0).height(TIME)[:, 0], expected, atol=1e-16)


@pytest.mark.parametrize("platform", [0.0, 0.3, 0.9])
def test_trapezoid_equals_straight_lines_between_its_corners(platform):
    ramp = 0.5 * (1 - platform) * 2.0
    expected = np.interp(TIME, [1.0, 1.0 + ramp, 3.0 - ramp, 3.0], [0.0, -0.1, -0.1, 0.0])
    road = trapezoid_bump(-0.1, platform=platform, duration=2.0)
    np.testing.assert_allclose(road.height(TIME)[:, 0], expected, atol=1e-15)


def test_triangle_is_a_trapezoid_without_platform():
    triangle = triangular_bump(0.1, duration=2.0, rounding=0.1)
    trapezoid = trapezoid_bump(0.1, platform=0.0, duration=2.0, rounding=0.1)
    np.testing.assert_array_equal(triangle.height(TIME), trapezoid.height(TIME))
    assert float(triangular_bump(0.1, duration=2.0).height(jnp.array([2.0]))[0, 0]) == pytest.approx(0.1, abs=1e-16)


@pytest.mark.parametrize("s", [-0.4, -0.05, 0.0, 0.1, 0.19, 0.7])
def test_rounded_corner_is_its_curvature_integrated_twice(s):
    reach = 0.2
    lag = np.clip(s, -reach, reach)
    value, _ = integrate.quad(lambda u: (s - u) * (1 + np.cos(np.pi * u / reach)) / (2 * reach), -reach, lag)
    assert float(rounded_corner(jnp.array([s]), jnp.array(reach))[0]) == pytest.approx(value, abs=1e-12)


def test_rounding_reaches_as_far_as_stated_and_no_further():
    sharp, rounded = (trapezoid_bump(0.1, duration=2.0, rounding=r).height(TIME)[:, 0] for r in (0.0, 0.05))
    corners = np.array([1.0, 1.5, 2.5, 3.0])
    away = np.min(np.abs(TIME[:, None] - corners), axis=1) > 0.05 * 2.0 + 1e-9
    np.testing.assert_allclose(rounded[away], sharp[away], atol=1e-16)
    assert np.max(np.abs(rounded - sharp)) == pytest.approx(0.1 / 0.25 * 0.05 * (0.25 - 1 / np.pi**2), rel=1e-12)
    # the kernel of the rounding has unit area and no skew, so that the volume of the bump stays
    assert float(jnp.sum(rounded)) == pytest.approx(
        float(jnp.sum(sharp)), rel=1e-6
    )  # sums for integrals: corners on samples


def test_rounded_half_sine_keeps_its_crest_and_ends_where_stated():
    road = half_sine_bump(0.1, duration=1.0, rounding=0.1)
    assert float(road.height(jnp.array([1.5]))[0, 0]) == pytest.approx(0.1, abs=1e-17)
    ends = np.asarray(road.height(jnp.array([0.899, 0.91, 2.09, 2.101, -50.0, 60.0]))[:, 0])
    np.testing.assert_array_equal(ends == 0.0, [True, False, False, True, True, True])


def test_rounding_lowers_the_crest_of_a_triangle_as_stated():
    crest = float(triangular_bump(0.1, duration=2.0, rounding=0.2).height(jnp.array([2.0]))[0, 0])
    assert crest == pytest.approx(0.1 * (1 - 4 * 0.2 * (0.25 - 1 / np.pi**2)), rel=1e-12)
    assert crest == pytest.approx(0.1 * (1 - 0.595 * 0.2), abs=1e-5)


@pytest.mark.parametrize(
    ("argument", "rounding"), [("height", 0.1), ("platform", 0.1), ("platform", 0.0), ("speed", 0.1), ("start", 0.0)]
)
def test_gradients_equal_differences(argument, rounding, check_gradient):
    given = {"height": 0.1, "platform": 0.4, "length": 3.0, "speed": 2.0, "start": 0.7}

    def energy(value):
        height = trapezoid_bump(**{**given, argument: value}, rounding=rounding).height(TIME[::13])[:, 0]
        return jnp.sum(TIME[::13] * height**2)

    check_gradient(energy, given[argument])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rounding": -0.1}, r"`rounding` must be finite and not negative, but is -0.1.*Use 0 for sharp"),
        ({"rounding": 0.3}, r"`rounding` must be at most 0.25.*is 0.3.*share of the length"),
        ({"platform": 1.0}, r"`platform` must be below 1.*is 1.0.*share of the length"),
        ({"platform": -0.1}, r"`platform` must be finite and not negative, but is -0.1.*Use 0 for a triangle"),
        ({"length": 2.0}, r"`duration` must be given, or `length`.*not both"),
        ({"height": np.nan}, r"`height` must be finite"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        trapezoid_bump(**{"height": 0.1, "duration": 1.0, **arguments})
