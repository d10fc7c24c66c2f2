import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.roads import step


def test_closed_form():
    time = np.linspace(0.0, 2.0, 2001)
    expected = 0.05 * 0.5 * (1 - np.cos(np.pi * np.clip((time - 0.8) / 0.3, 0, 1)))
    np.testing.assert_allclose(step(0.05, start=0.8, ramp=0.3).height(time)[:, 0], expected, atol=1e-15)


def test_level_before_and_after():
    height = step(-0.05, start=1.0, ramp=0.02).height(jnp.array([0.0, 1.0, 1.02, 50.0]))[:, 0]
    np.testing.assert_allclose(height, [0.0, 0.0, -0.05, -0.05], atol=1e-17)


def test_smooth_is_the_quintic():
    time = np.linspace(0.0, 2.0, 2001)
    s = np.clip((time - 0.8) / 0.3, 0, 1)
    expected = 0.05 * (6 * s**5 - 15 * s**4 + 10 * s**3)
    np.testing.assert_allclose(step(0.05, start=0.8, ramp=0.3, smooth=True).height(time)[:, 0], expected, atol=1e-16)


def test_a_formula_has_neither_grid_nor_end():
    assert step(0.05).grid is None
    assert step(0.05).duration is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"ramp": 0.0}, r"`ramp` must be positive and finite, but is 0.0.*give the rise a few milliseconds"),
        ({"height": np.nan}, r"`height` must be finite, but is nan"),
        ({"start": np.nan}, r"`start` must be finite, but is nan"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        step(**{"height": 0.05, **arguments})
