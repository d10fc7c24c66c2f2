import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.roads import cosine_bump, delayed, from_profile, iso8608, sine, two_track


POSITION = 0.1 * np.arange(200)
HEIGHTS = 0.02 + 0.01 * np.sin(0.3 * np.arange(200) ** 1.1)


@pytest.mark.parametrize("ramp", [0.0, 0.5])
def test_rear_axle_is_the_front_axle_later(ramp):
    road = delayed(iso8608("C", 20.0, seed=1, ramp=ramp), positions=[0.0, 3.0], speed=20.0)
    time = 0.001 * np.arange(3001)
    z = road.height(time)
    # 3 m at 20 m/s are 150 samples; the phase 2 pi n x reaches 1e3, of which a double leaves 1e-13, times 0.02 m
    np.testing.assert_allclose(z[150:, 1], z[:-150, 0], atol=1e-14)
    assert abs(float(z[150, 1] - z[149, 1])) <= np.max(np.abs(np.diff(z[:, 0]))) * 1.5


def test_axles_start_on_the_piece_of_road_behind():
    # a road that fades in is level there, a formula goes on, a closed lap repeats, a record is level at its start
    time = np.array([0.0, 0.05, 0.1])
    faded = delayed(iso8608("C", 20.0, seed=1), delays=[0.0, 0.1]).height(time)
    np.testing.assert_array_equal(faded[:, 1], 0.0)
    wave = delayed(sine(0.01, frequency=1.0), delays=[0.0, 0.1]).height(time)
    np.testing.assert_allclose(wave[:, 1], 0.01 * np.sin(2 * np.pi * (time - 0.1)), atol=1e-17)
    lap = delayed(from_profile(POSITION, HEIGHTS, speed=10.0, periodic=True), positions=[0.0, 1.0]).height(time)
    np.testing.assert_allclose(lap[:, 1], [HEIGHTS[190], HEIGHTS[195], HEIGHTS[0]], atol=1e-13)
    record = delayed(from_profile(POSITION, HEIGHTS, speed=10.0), positions=[0.0, 1.0])
    np.testing.assert_allclose(record.height(time)[:, 1], HEIGHTS[0], atol=1e-15)
    later = record.height(np.array([0.1, 0.11, 0.12]))[:, 1]
    np.testing.assert_allclose(later, HEIGHTS[:3], atol=1e-13)


def test_order_of_the_wheels_of_a_car():
    left, right = cosine_bump(0.06, start=1.0, duration=0.2), cosine_bump(0.03, start=1.0, duration=0.2)
    road = delayed(two_track(left, right), positions=[0.0, 2.0], speed=10.0)
    assert road.wheels == 4
    z = road.height(np.array([1.1, 1.3]))
    np.testing.assert_allclose(z, [[0.06, 0.03, 0.0, 0.0], [0.0, 0.0, 0.06, 0.03]], atol=1e-15)


def test_positions_and_speed_are_delays_and_the_speed_may_be_that_of_the_road():
    road = iso8608("C", 20.0, seed=1, length=200.0)
    time = np.linspace(0.0, 2.0, 50)
    by_delay = delayed(road, delays=[0.0, 0.135]).height(time)
    np.testing.assert_allclose(delayed(road, positions=[0.0, 2.7], speed=20.0).height(time), by_delay, atol=1e-15)
    np.testing.assert_allclose(delayed(road, positions=[0.0, 2.7]).height(time), by_delay, atol=1e-15)


@pytest.mark.parametrize("kind", ["iso8608", "profile"])
def test_gradient_in_speed_equals_difference(kind, check_gradient):
    time = jnp.linspace(0.0, 1.5, 37)

    def energy(speed):
        if kind == "iso8608":
            road = iso8608("C", speed, seed=3, length=100.0)
        else:
            road = from_profile(POSITION, HEIGHTS, speed=speed)
        return jnp.sum((delayed(road, positions=[0.0, 1.03, 2.7], speed=speed).height(time) * 100) ** 2)

    check_gradient(energy, 11.37)  # no wheel is on a sample at any of the times


@pytest.mark.parametrize("name", ["delays", "positions"])
def test_gradient_in_delays_and_positions_is_minus_the_slope(name):
    bump = cosine_bump(0.06, start=1.0, duration=0.5)
    speed = 8.0 if name == "positions" else None

    def height(value):
        road = delayed(bump, positions=value, speed=speed) if speed else delayed(bump, delays=value)
        return road.height(jnp.array([1.3]))[0]

    slopes = jax.jit(jax.jacrev(height))(jnp.array([0.0, 1.6 if speed else 0.2]))
    angle = 2 * np.pi * np.array([0.3, 0.1]) / 0.5
    expected = -0.03 * 2 * np.pi / 0.5 * np.sin(angle) / (speed or 1.0)
    np.testing.assert_allclose(slopes, np.diag(expected), atol=1e-14)


def test_grid_duration_and_span_are_those_of_the_road():
    record = from_profile(POSITION, HEIGHTS, speed=10.0)
    road = delayed(record, delays=[0.0, 0.3])
    assert (road.grid, road.duration) == (record.grid, record.duration)
    assert [float(t) for t in road.span] == pytest.approx([0.0, 1.99])


def test_times_beyond_a_record_are_still_refused():
    road = delayed(from_profile(POSITION, HEIGHTS, speed=10.0), delays=[0.0, 0.3])
    with pytest.raises(ValueError, match=r"`time` must stay within this road"):
        road.height(np.array([0.0, 2.5]))
    with pytest.raises(ValueError, match=r"`time` must stay within this road"):
        road.height(np.array([-0.5, 1.0]))
    traced = eqx.filter_jit(road.height)(jnp.array([-0.5, 1.0, 2.1]))
    np.testing.assert_array_equal(np.isnan(traced), [[True, True], [False, False], [True, False]])


ROAD = iso8608("C", 20.0, seed=3, length=100.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, r"`delays` must be given, or `positions` with `speed`.*neither was given.*exactly one"),
        ({"delays": [0.0], "positions": [0.0]}, r"`delays` must be.*not both, but is \[0.0\] s, and positions"),
        ({"delays": [0.0, -0.1]}, r"`delays` must be finite and not negative.*foremost axle"),
        ({"positions": [-1.0, 0.0]}, r"`positions` must be finite and not negative"),
        ({"delays": []}, r"`delays` must hold one number for each axle.*\[0.0, 2.7\]"),
        ({"delays": [0.0], "speed": 20.0}, r"`speed` must be left out when `delays` is given"),
        ({"positions": [0.0, 2.7], "speed": 0.0}, r"`speed` must be positive and finite"),
        ({"positions": [0.0, 2.7], "speed": 25.0}, r"`speed` must be that of the road, 20.0 m/s, but is 25.0 m/s"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        delayed(ROAD, **arguments)


def test_a_road_without_a_speed_needs_one():
    with pytest.raises(ValueError, match=r"`speed` must be given with `positions`, but is None"):
        delayed(sine(0.1, frequency=1.0), positions=[0.0, 2.7])
