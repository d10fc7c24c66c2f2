from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.roads import cosine_bump, delayed, from_profile, iso8608, joined, sine, step


RECORD = from_profile(0.1 * np.arange(100), 0.01 * np.sin(0.2 * np.arange(100)) + 0.3, speed=10.0)


def test_second_road_goes_on_where_the_first_stopped():
    road = joined(step(0.1, start=0.5), RECORD, at=2.0)
    time = np.linspace(0.0, 2.9, 291)
    z = np.asarray(road.height(time)[:, 0])
    np.testing.assert_allclose(z[time <= 2.0], step(0.1, start=0.5).height(time[time <= 2.0])[:, 0], atol=1e-16)
    later = np.asarray(RECORD.height(time[time > 2.0] - 2.0)[:, 0])
    np.testing.assert_allclose(z[time > 2.0], later - 0.3 + 0.1, atol=1e-14)
    assert np.max(np.abs(np.diff(z[195:206]))) < 0.01 * 0.2 * 1.01  # no step at 2 s: the slope of the record
    assert road.duration == pytest.approx(2.99) and road.grid == pytest.approx(0.01)
    assert [float(t) for t in road.span] == pytest.approx([-np.inf, 2.99])


def test_the_end_of_a_record_is_where_the_next_road_begins():
    road = joined(RECORD, sine(0.02, frequency=5.0))
    end = float(RECORD.samples[-1, 0])
    np.testing.assert_allclose(road.height(np.array([0.99, 1.04]))[:, 0], [end, end + 0.02], atol=1e-12)
    assert road.duration is None
    with pytest.raises(ValueError, match=r"`time` must stay within"):
        road.height(np.array([-0.5]))


def test_random_parts_are_drawn_again():
    bump, rough = cosine_bump(0.1, start=0.1, duration=0.5), iso8608("C", 10.0, seed=0)
    road, time = joined(bump, rough, at=1.0), np.linspace(0.0, 3.0, 31)
    other: Any = road.reseeded(3)
    expected = joined(bump, rough.reseeded(3), at=1.0).height(time)
    np.testing.assert_array_equal(other.height(time), expected)
    assert not np.allclose(road.height(time), expected)
    assert joined(bump, RECORD, at=1.0).reseeded(3) is None


def test_three_roads_and_several_axles():
    road = joined(joined(cosine_bump(0.1, start=0.1, duration=0.5), RECORD, at=1.0), step(-0.1, start=0.2), at=1.5)
    car = delayed(road, positions=[0.0, 2.0], speed=10.0)
    time = np.linspace(0.0, 3.0, 301)
    z = np.asarray(car.height(time))
    np.testing.assert_allclose(z[20:, 1], z[:-20, 0], atol=1e-13)


def test_gradient_in_the_place_of_the_joint(check_gradient):
    time = np.linspace(0.0, 3.0, 31)
    check_gradient(
        lambda at: jnp.sum(joined(sine(0.1, frequency=0.3), sine(0.05, frequency=1.1), at=at).height(time) ** 2), 1.234
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: joined(sine(1.0, frequency=1.0), RECORD), r"`at` must be given where `first` has no end of its own"),
        (lambda: joined(RECORD, RECORD, at=1.5), r"`at` must lie within `first`, which ends at 0.99 s, but is 1.5 s"),
        (lambda: joined(RECORD, RECORD, at=-1.0), r"`at` must be finite and not negative, but is -1.0"),
        (
            lambda: joined(RECORD, delayed(iso8608("C", 10.0, seed=0, length=100.0), delays=[0.0, 0.1])),
            r"`second` must have 1 tracks, as `first` has, but is 2.*`delayed` on the result",
        ),
        (
            lambda: joined(delayed(RECORD, delays=[0.0, 0.1]), delayed(RECORD, delays=[0.0, 0.1])),
            r"`first` must not be delayed: its axles would reach `second` at one instant.*use `delayed` on the result",
        ),
    ],
)
def test_errors(make, message):
    with pytest.raises(ValueError, match=message):
        make()
