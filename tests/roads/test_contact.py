import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.roads import contact_patch, from_profile, rolling_disc, sine, step, superposed, two_track


TIME = np.linspace(0.5, 1.5, 201)


@pytest.mark.parametrize("spatial_frequency", [0.5, 2.83, 9.0])
def test_patch_reduces_a_wave_by_sinc(spatial_frequency):
    waves = sine(0.01, wavelength=1 / spatial_frequency, speed=10.0)
    mean = contact_patch(waves, length=0.2, speed=10.0).height(TIME)
    np.testing.assert_allclose(mean, 0.01 * np.sinc(0.2 * spatial_frequency) * waves.height(TIME) / 0.01, atol=1e-8)


def test_patch_of_a_record_is_the_mean_and_level_beyond_its_ends():
    place, height = 0.1 * np.arange(100), np.linspace(1.0, 2.0, 100) ** 2
    record = from_profile(place, height, speed=10.0)
    mean = np.asarray(contact_patch(record, length=0.6, speed=10.0).height(np.array([0.0, 0.5, 0.99]))[:, 0])
    fine = np.linspace(-0.3, 0.3, 60_001)
    expected = [np.mean(np.interp(x + fine, place, height)) for x in (0.0, 5.0, 9.9)]
    # Gauss-Legendre over straight pieces: good while they bend little, 0.3 % of the rise over the patch at a corner
    np.testing.assert_allclose(mean[1], expected[1], atol=1e-5)
    np.testing.assert_allclose(mean, expected, atol=3e-3 * 0.24)
    with pytest.raises(ValueError, match=r"`time` must stay within"):
        contact_patch(record, length=0.6, speed=10.0).height(np.array([0.0, 1.2]))


@pytest.mark.parametrize("points", [9, 25])
def test_patch_over_a_steep_flank_errs_by_no_more_than_the_docstring_says(points):
    kerb = contact_patch(step(0.08, start=1.0, ramp=1e-6), length=0.15, speed=10.0, points=points)
    time = np.linspace(0.992, 1.008, 8001)
    exact = 0.08 * np.clip((time - 0.9925) / 0.015, 0.0, 1.0)
    error = np.max(np.abs(np.asarray(kerb.height(time)[:, 0]) - exact)) / 0.08
    assert 0.9 * np.pi / (4 * points) < error < np.pi / (4 * points)


def kerb_of_a_disc(x, height, radius):
    """The lowest point of a disc at x [m] before (negative) or behind a kerb: the arc about its edge."""
    arc = height - radius + np.sqrt(np.maximum(radius**2 - x**2, 0.0))
    return np.where(x < 0, np.maximum(arc, 0.0), height)


@pytest.mark.parametrize("height", [0.03, 0.1, 0.25])
@pytest.mark.parametrize("points", [41, 181])
def test_disc_climbs_a_kerb_along_an_arc(height, points):
    x = np.linspace(-0.35, 0.2, 500)
    disc = rolling_disc(step(height, start=1.0, ramp=1e-9), radius=0.3, speed=10.0, points=points)
    z = np.asarray(disc.height(1.0 + x / 10.0)[:, 0])
    # never above the true disc, and not below where that one is one spacing of the points later
    spacing = 0.3 * np.pi / (points - 1)
    assert np.all(z <= kerb_of_a_disc(x, height, 0.3) + 1e-9)
    assert np.all(z >= kerb_of_a_disc(x - spacing, height, 0.3) - 1e-9)


def test_disc_does_not_reach_the_floor_of_a_short_hole():
    # a slot 0.2 m wide, 0.1 m deep: the disc hangs R - sqrt(R^2 - 0.1^2) below its edges
    place = 1e-3 * np.arange(2000)
    slot = from_profile(place, np.where((place > 0.9) & (place < 1.1), -0.1, 0.0), speed=1.0)
    lowest = float(jnp.min(rolling_disc(slot, radius=0.3, speed=1.0, points=601).height(place[500:1500])))
    assert lowest == pytest.approx(-(0.3 - np.sqrt(0.3**2 - 0.1**2)), abs=5e-4)  # 1.6 mm spacing, slope 1/3


def test_disc_follows_long_waves():
    # gentle slopes: the disc touches at a = R z', so it lies R z'^2/2 above the road
    waves = sine(0.05, wavelength=20.0, speed=10.0)
    above = np.asarray(rolling_disc(waves, radius=0.3, speed=10.0, points=2001).height(TIME) - waves.height(TIME))[:, 0]
    slope = 0.05 * 2 * np.pi / 20.0 * np.cos(np.pi * TIME)
    np.testing.assert_allclose(above, 0.5 * 0.3 * slope**2, atol=1e-6)


def test_both_keep_the_tracks_and_the_rest_of_the_road():
    record = from_profile(0.1 * np.arange(100), np.ones((100, 2)), speed=10.0)
    for road in (contact_patch(record, length=0.2, speed=10.0), rolling_disc(record, radius=0.3, speed=10.0)):
        assert (road.wheels, road.grid, road.duration) == (2, record.grid, record.duration)
        assert [float(t) for t in road.span] == pytest.approx([0.0, 0.99])
        np.testing.assert_allclose(road.height(np.array([0.0, 0.5])), 1.0, atol=1e-15)
    pair = two_track(sine(0.01, frequency=2.0), sine(0.02, frequency=2.0))
    z = contact_patch(pair, length=0.2, speed=10.0).height(TIME)
    np.testing.assert_allclose(z[:, 1], 2.0 * z[:, 0], atol=1e-16)


@pytest.mark.parametrize("argument", ["length", "speed", "radius"])
def test_gradients_equal_differences(argument, check_gradient):
    road = superposed(sine(0.03, wavelength=7.0, speed=10.0), sine(0.01, wavelength=2.2, speed=10.0))

    def energy(value):
        given = {"speed": 10.0, argument: value}
        if argument == "length":
            filtered = contact_patch(road, length=value, speed=10.0)
        else:
            filtered = rolling_disc(road, radius=given.get("radius", 0.3), speed=given["speed"], points=61)
        return jnp.sum((filtered.height(TIME[::20]) - road.height(TIME[::20])) ** 2)

    check_gradient(energy, {"length": 0.8, "speed": 10.0, "radius": 0.3}[argument], step=1e-5, rtol=1e-5)


ROAD = sine(0.01, frequency=2.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: contact_patch(ROAD, length=0.0, speed=10.0), r"`length` must be positive and finite, but is 0.0"),
        (lambda: contact_patch(ROAD, length=0.1, speed=-1.0), r"`speed` must be positive.*driven forwards"),
        (lambda: contact_patch(ROAD, length=0.1, speed=1.0, points=0), r"`points` must be positive"),
        (lambda: rolling_disc(ROAD, radius=0.0, speed=10.0), r"`radius` must be positive and finite, but is 0.0"),
        (lambda: rolling_disc(ROAD, radius=0.3, speed=0.0), r"`speed` must be positive"),
        (lambda: rolling_disc(ROAD, radius=0.3, speed=1.0, points=10), r"`points` must be odd.*is 10.*lowest one"),
    ],
)
def test_errors(make, message):
    with pytest.raises(ValueError, match=message):
        make()
