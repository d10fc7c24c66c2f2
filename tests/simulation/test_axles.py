"""How a road reaches the axles of a vehicle: one after the other, unless asked otherwise."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, roads, simulate
from jaxdamp._display import Display, shown_in
from jaxdamp.parameters import free_parameters, replace
from jaxdamp.simulation.wheels import axle_timing, heights_under_wheels
from jaxdamp.tune.measuring import Measurement
from jaxdamp.tune.objective import objective_of
from jaxdamp.vehicles import RollCar, frequency_response, spectral_rms, stationary_rms
from jaxdamp.vehicles.presets import full_car_jazar, half_car_002, m113_003, quarter_car_000, truck_001


HALF, FULL, SPEED = half_car_002(), full_car_jazar(), 20.0
GROUND = roads.iso8608("C", SPEED, seed=1, length=200.0)
PLATFORM = roads.from_profile(0.01 * np.arange(200), 0.01 * np.sin(0.3 * np.arange(200)))
TIME = jnp.asarray(np.arange(0.0, 1.0, 0.004), float)
LATER = {"half": HALF, "full": FULL, "truck": truck_001(), "hull": m113_003()}


@pytest.mark.parametrize("name", LATER)
def test_one_track_reaches_each_axle_by_its_distance_and_the_speed(name):
    vehicle = LATER[name]
    heights = np.asarray(heights_under_wheels(vehicle, GROUND, TIME))
    for column, wheel in enumerate(vehicle.frame().wheels):
        expected = GROUND.height(TIME - wheel.behind / SPEED)[:, 0]
        np.testing.assert_allclose(heights[:, column], expected, atol=1e-15)
    assert np.ptp(heights, axis=1).max() > 1e-3


def test_two_tracks_go_left_and_right_under_every_axle():
    both = roads.two_track(GROUND, track_width=1.4, seed=2)
    left, right = np.asarray(both.height(TIME)).T
    rear_left, rear_right = np.asarray(both.height(TIME - float(FULL.axle_positions[1]) / SPEED)).T
    found = np.asarray(heights_under_wheels(FULL, both, TIME))
    np.testing.assert_allclose(found, np.stack([left, right, rear_left, rear_right], 1), atol=1e-15)
    across = RollCar(420.0, 410.0, FULL.front)
    np.testing.assert_array_equal(heights_under_wheels(across, both, TIME), both.height(TIME))
    np.testing.assert_array_equal(heights_under_wheels(across, GROUND, TIME), GROUND.height(TIME)[:, [0, 0]])
    together = heights_under_wheels(FULL, roads.in_phase(both), TIME)
    np.testing.assert_array_equal(together, both.height(TIME)[:, [0, 1, 0, 1]])


def test_delays_of_its_own_and_motions_by_wheel_stay_as_they_are():
    other = roads.delayed(GROUND, delays=[0.0, 0.5])
    np.testing.assert_array_equal(heights_under_wheels(FULL, other, TIME), other.height(TIME)[:, [0, 0, 1, 1]])
    moved = roads.from_profile(0.01 * np.arange(200), 0.01 * np.sin(np.outer(np.arange(200), [0.1, 0.2, 0.3, 0.4])))
    np.testing.assert_array_equal(heights_under_wheels(FULL, moved, TIME), moved.height(TIME))
    left_right = roads.from_profile(0.01 * np.arange(200), 0.01 * np.sin(np.outer(np.arange(200), [0.1, 0.2])))
    np.testing.assert_array_equal(
        heights_under_wheels(FULL, roads.in_phase(left_right), TIME), left_right.height(TIME)[:, [0, 1, 0, 1]]
    )
    later = roads.delayed(left_right, positions=FULL.axle_positions, speed=10.0)
    np.testing.assert_array_equal(heights_under_wheels(FULL, later, TIME), later.height(TIME))


def test_the_response_says_when_each_axle_met_the_road():
    said = {
        "rear axle 0.125 s behind the front (2.5 m at 20 m/s)": GROUND,
        "rear axle 0.25 s behind the front (2.5 m at 10 m/s)": roads.delayed(
            PLATFORM, positions=HALF.axle_positions, speed=10.0
        ),
        "rear axle 0.3 s behind the front": roads.delayed(PLATFORM, delays=[0.0, 0.3]),
        "all axles in phase, as asked": roads.in_phase(GROUND),
    }
    for sentence, road in said.items():
        assert str(axle_timing(HALF, road)) == sentence
    assert str(axle_timing(m113_003(), GROUND)).startswith("axles 0, 0.0334, 0.0667, 0.1, 0.133 s behind the front of")
    assert str(axle_timing(FULL, GROUND)) == "rear axle 0.144 s behind the front (2.87 m at 20 m/s)"
    assert str(axle_timing(quarter_car_000(), GROUND)) == "one axle"
    with shown_in(Display("imperial")):
        assert str(axle_timing(HALF, GROUND)).endswith("(2.5 m at 44.7 mph)")
    response = simulate(HALF, GROUND, duration=0.5, dt=0.002)
    sentence = next(iter(said))
    assert repr(response).endswith(f"; {sentence}") and response.to_xarray().attrs["axles"] == sentence


REFUSED = {
    "no speed": (
        HALF,
        PLATFORM,
        r"`road` must have one speed .* 2 axles.*`roads.delayed\(road, positions=vehicle.axle_p",
    ),
    "two speeds": (
        HALF,
        roads.joined(GROUND, roads.iso8608("C", 10.0, seed=1, length=200.0), at=1.0),
        r"made for several speeds.*`roads.in_phase\(road\)`",
    ),
    "left and right under wheels for both": (
        HALF,
        roads.two_track(GROUND, GROUND),
        r"2 wheel\(s\) \(front, rear\) on 2 axle\(s\), but is two tracks side by side \(left, right\)",
    ),
    "left and right over time": (
        FULL,
        roads.from_profile(0.01 * np.arange(200), np.zeros((200, 2))),
        r"each of 4 wheel\(s\) \(front_left, .*, but is 2 columns over time without a speed, one for each wheel",
    ),
    "three axles": (HALF, roads.delayed(GROUND, positions=[0.0, 1.0, 2.0]), r"2 axle\(s\).* for each of 3 axles"),
    "two axles under one": (
        RollCar(420.0, 410.0, FULL.front),
        roads.delayed(GROUND, delays=[0.0, 0.1]),
        r"1 axle\(s\) \(left, right\), but is one track for each of 2 axles",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_meant_is_refused_with_what_to_write(case):
    vehicle, road, message = REFUSED[case]
    for drive in (simulate, Ride):
        with pytest.raises(ValueError, match=message):
            drive(vehicle, road, duration=1.0)


def test_delays_and_in_phase_exclude_each_other():
    with pytest.raises(ValueError, match="`road` must not be delayed"):
        roads.in_phase(roads.delayed(GROUND, delays=[0.0, 0.1]))
    with pytest.raises(ValueError, match="`road` must not be in phase"):
        roads.delayed(roads.in_phase(GROUND), delays=[0.0, 0.1])


NAMES = ["rms_sprung_acceleration", "rms_pitch_acceleration"]


def test_ride_means_the_same_and_follows_axles_that_move():
    ride = Ride(HALF, GROUND, metrics=NAMES, duration=0.5, dt=0.002)
    for point in ({}, {"front_distance": 1.5, "front.damper.rate": 900.0}):
        expected = simulate(replace(HALF, point), GROUND, duration=0.5, dt=0.002).metrics(NAMES)
        for name, value in ride(point).items():
            assert float(value) == pytest.approx(float(expected[name]), rel=1e-9), (point, name)
    fixed = Ride(HALF, roads.delayed(GROUND, positions=HALF.axle_positions), metrics=NAMES, duration=0.5, dt=0.002)
    np.testing.assert_array_equal(fixed.heights, ride.heights)
    np.testing.assert_array_equal(fixed.of_vehicle(replace(HALF, {"rear_distance": 2.4})).heights, ride.heights)


def test_a_tuning_follows_axles_that_move():
    free = free_parameters(HALF, over=["rear_distance"])
    objective = objective_of([NAMES[0]], HALF, NAMES[1:], [], white=False)
    measured = Measurement(HALF, GROUND, objective, free, run={"duration": 0.5, "dt": 0.002})
    moved = free.build(jnp.array([2.4]))
    expected = simulate(moved, GROUND, duration=0.5, dt=0.002).metrics(NAMES)
    values = measured(moved)
    for name in NAMES:
        assert float(values[name]) == pytest.approx(float(expected[name]), rel=1e-9)


def test_the_speed_can_be_differentiated_through_the_delay():
    def rear(speed):
        road = roads.iso8608("C", speed, seed=1, length=200.0, ramp=0.0)
        return jnp.sum(heights_under_wheels(HALF, road, TIME)[:, 1] ** 2)

    step = 1e-4
    difference = (rear(SPEED + step) - rear(SPEED - step)) / (2 * step)
    assert float(jax.jit(jax.grad(rear))(SPEED)) == pytest.approx(float(difference), rel=1e-5)


def test_frequency_responses_need_a_speed_or_in_phase_too():
    frequency, level = np.array([0.5, 1.0]), np.ones(2)
    for call in (
        lambda **more: frequency_response(HALF, frequency, **more),
        lambda **more: spectral_rms(HALF, frequency, level, **more),
        lambda **more: stationary_rms(HALF, **more),
    ):
        with pytest.raises(ValueError, match=r"`speed` must be given for a vehicle of 2 axles.*`in_phase=True`"):
            call()
        with pytest.raises(ValueError, match=r"`speed` must be left out with `in_phase`"):
            call(speed=20.0, in_phase=True)
        apart, together = call(speed=20.0)["pitch"], call(in_phase=True)["pitch"]
        assert not np.allclose(np.abs(apart), np.abs(together), rtol=0.02)
