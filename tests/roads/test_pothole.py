import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.roads import pothole


def test_closed_form():
    time = np.linspace(0.0, 2.0, 2001)
    expected = -0.04 * (np.tanh((time - 0.8) / 0.015) - np.tanh((time - 1.1) / 0.015))
    road = pothole(0.08, start=0.8, length=3.0, speed=10.0, edge=0.05)
    np.testing.assert_allclose(road.height(time)[:, 0], expected, atol=1e-16)


def test_floor_edges_and_slope_are_the_stated_ones():
    road = pothole(0.08, start=1.0, duration=1.0, edge=0.05)
    assert float(road.height(jnp.array([1.5]))[0, 0]) == pytest.approx(-0.08, rel=1e-8)
    assert float(pothole(0.08, duration=1.0, edge=0.25).height(jnp.array([1.5]))[0, 0]) == pytest.approx(
        -0.08 * np.tanh(2.0), rel=1e-12
    )
    np.testing.assert_allclose(road.height(jnp.array([1.0 - 0.055, 1.0 + 0.055]))[:, 0], [-0.008, -0.072], atol=2e-4)
    slope = jax.jit(jax.grad(lambda t: road.height(t[None])[0, 0]))(jnp.array(1.0))
    assert float(slope) == pytest.approx(-0.08 / (2 * 0.05), rel=1e-12)


def test_a_negative_depth_is_a_block():
    time = jnp.linspace(0.0, 3.0, 301)
    np.testing.assert_array_equal(pothole(-1, duration=1).height(time), -pothole(1, duration=1).height(time))


@pytest.mark.parametrize("argument", ["depth", "length", "speed", "edge"])
def test_gradients_equal_differences(argument, check_gradient):
    given = {"depth": 0.1, "length": 3.0, "speed": 2.0, "edge": 0.07}
    time = np.linspace(0.0, 4.0, 201)

    def energy(value):
        return jnp.sum(pothole(**{**given, argument: value}).height(time) ** 2)

    check_gradient(energy, given[argument])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"edge": 0.0}, r"`edge` must be positive and finite, but is 0.0.*no derivative"),
        ({"edge": 0.3}, r"`edge` must be at most 0.25, but is 0.3.*leaves no floor"),
        ({"depth": np.inf}, r"`depth` must be finite, but is inf"),
        ({"length": 1.0}, r"`duration` must be given, or `length`.*not both"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        pothole(**{"depth": 0.1, "duration": 1.0, **arguments})
