import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.roads import cosine_bump


def test_closed_form_of_the_paper():
    time = np.linspace(0.0, 3.0, 3001)
    inside = (time >= 1.0) & (time <= 1.25)
    expected = np.where(inside, 0.06 / 2 * (1 - np.cos(8 * np.pi * time)), 0.0)
    np.testing.assert_allclose(cosine_bump(0.06, start=1.0, duration=0.25).height(time)[:, 0], expected, atol=1e-15)


def test_length_and_speed_are_a_duration():
    time = jnp.linspace(0.0, 2.0, 500)
    by_length = cosine_bump(0.06, start=1.0, length=2.5, speed=10.0).height(time)
    np.testing.assert_allclose(by_length, cosine_bump(0.06, start=1.0, duration=0.25).height(time), atol=1e-15)


def test_gradient_in_speed_equals_closed_form():
    length, speed, t = 2.5, 10.0, 1.1
    slope = jax.grad(lambda v: cosine_bump(0.06, start=1.0, length=length, speed=v).height(jnp.array([t]))[0, 0])(speed)
    s = (t - 1.0) * speed / length
    assert slope == pytest.approx(0.03 * 2 * np.pi * np.sin(2 * np.pi * s) * (t - 1.0) / length, rel=1e-12)


def test_gradient_in_start_is_minus_the_slope_in_time():
    time = jnp.array([0.9, 1.05, 1.2, 1.5])
    by_start = jax.jacfwd(lambda t0: cosine_bump(0.06, start=t0, duration=0.25).height(time)[:, 0])(1.0)
    bump = cosine_bump(0.06, start=1.0, duration=0.25)
    by_time = jax.vmap(jax.grad(lambda t: bump.height(t[None])[0, 0]))(time)
    np.testing.assert_allclose(by_start, -by_time, atol=1e-14)
    assert abs(by_start[1]) > 0.1 and by_start[0] == 0.0 and by_start[3] == 0.0


def test_a_formula_has_neither_grid_nor_end():
    bump = cosine_bump(0.06, duration=0.25)
    assert bump.grid is None
    assert bump.duration is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, r"`duration` must be given, or `length` with `speed`.*neither was given.*Give exactly one"),
        (
            {"duration": 0.25, "length": 2.5},
            r"`duration` must be.*not both, but is 0.25 s, and length 2.5 m.*exactly one",
        ),
        ({"length": 2.5}, r"`speed` must be given with `length`, but is None.*Give the speed of the vehicle in m/s"),
        ({"duration": 0.25, "speed": 10.0}, r"`speed` must be left out.*is 10.0.*Give `length` and `speed` instead"),
        ({"length": 2.5, "speed": -10.0}, r"`speed` must be positive and finite, but is -10.0.*driven forwards"),
        ({"length": -2.5, "speed": 10.0}, r"`length` must be positive and finite, but is -2.5"),
        ({"duration": 0.0}, r"`duration` must be positive and finite, but is 0.0"),
        ({"height": np.nan, "duration": 0.25}, r"`height` must be finite, but is nan"),
        ({"start": np.inf, "duration": 0.25}, r"`start` must be finite, but is inf"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        cosine_bump(**{"height": 0.06, **arguments})
