import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.roads import cosine_bump, half_sine_bump, pothole, step, trapezoid_bump, triangular_bump


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
    slope = jax.jit(
        jax.grad(lambda v: cosine_bump(0.06, start=1.0, length=length, speed=v).height(jnp.array([t]))[0, 0])
    )(speed)
    s = (t - 1.0) * speed / length
    assert slope == pytest.approx(0.03 * 2 * np.pi * np.sin(2 * np.pi * s) * (t - 1.0) / length, rel=1e-12)


def test_gradient_in_start_is_minus_the_slope_in_time():
    time = jnp.array([0.9, 1.05, 1.2, 1.5])
    by_start = jax.jit(jax.jacfwd(lambda t0: cosine_bump(0.06, start=t0, duration=0.25).height(time)[:, 0]))(1.0)
    bump = cosine_bump(0.06, start=1.0, duration=0.25)
    by_time = jax.jit(jax.vmap(jax.grad(lambda t: bump.height(t[None])[0, 0])))(time)
    np.testing.assert_allclose(by_start, -by_time, atol=1e-14)
    assert abs(by_start[1]) > 0.1 and by_start[0] == 0.0 and by_start[3] == 0.0


def test_a_formula_has_neither_grid_nor_end():
    bump = cosine_bump(0.06, duration=0.25)
    assert bump.grid is None
    assert bump.duration is None


def curvature_jump(road, spacing):
    """The greatest change of the second difference quotient between neighbours `spacing` [s] apart."""
    z = np.asarray(road.height(np.arange(0.5, 2.5, spacing))[:, 0])
    return np.max(np.abs(np.diff(z, 3))) / spacing**2


# The change of curvature over h falls like h where the curvature is continuous (ratio 1/4 for a quarter of h), stays
# where it jumps, and grows like 1/h where the slope jumps. Third derivatives of 1e5 H/T^3 leave h = 2e-4 T far inside.
@pytest.mark.parametrize(
    ("road", "low", "high"),
    [
        (cosine_bump(0.06, duration=1.0, smooth=True), 0.2, 0.3),
        (half_sine_bump(0.06, duration=1.0, rounding=0.1), 0.2, 0.3),
        (trapezoid_bump(0.06, duration=1.0, rounding=0.1), 0.2, 0.3),
        (triangular_bump(0.06, duration=1.0, rounding=0.2), 0.2, 0.3),
        (pothole(0.06, duration=1.0, edge=0.1), 0.2, 0.3),
        (step(0.06, ramp=0.5, smooth=True), 0.2, 0.3),
        (cosine_bump(0.06, duration=1.0), 0.9, 1.1),
        (step(0.06, ramp=0.5), 0.9, 1.1),
        (half_sine_bump(0.06, duration=1.0), 3.0, 5.0),
        (trapezoid_bump(0.06, duration=1.0), 3.0, 5.0),
        (triangular_bump(0.06, duration=1.0), 3.0, 5.0),
    ],
)
def test_curvature_is_continuous_where_stated(road, low, high):
    ratio = curvature_jump(road, 2e-4) / curvature_jump(road, 8e-4)
    assert low < ratio < high


def test_smooth_cosine_has_the_same_crest_and_ends_and_stated_acceleration():
    bump = cosine_bump(0.06, start=1.0, duration=0.25, smooth=True)
    np.testing.assert_allclose(bump.height(jnp.array([1.0, 1.0625, 1.125, 1.25]))[:, 0], [0, 0.03, 0.06, 0], atol=1e-16)
    z = np.asarray(bump.height(np.arange(0.9, 1.4, 1e-5))[:, 0])
    acceleration = np.diff(z, 2) / 1e-10
    assert acceleration.max() == pytest.approx(40 * 0.06 / (np.sqrt(3) * 0.25**2), rel=1e-4)  # rounding 1e-17/1e-10


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
