import jax
import numpy as np
import pytest

from jaxdamp.roads import sine, wave_course


TIME = np.linspace(0.0, 4.0, 1001)


def test_closed_form():
    np.testing.assert_allclose(
        sine(0.01, frequency=1.7).height(TIME)[:, 0], 0.01 * np.sin(2 * np.pi * 1.7 * TIME), atol=1e-15
    )


def test_wavelength_and_speed_are_a_frequency():
    by_length = sine(0.01, wavelength=8.0, speed=16.0).height(TIME)
    np.testing.assert_allclose(by_length, sine(0.01, frequency=2.0).height(TIME), atol=1e-15)


def test_ramp_fades_in_and_then_changes_nothing():
    plain, faded = sine(0.01, frequency=2.0).height(TIME), sine(0.01, frequency=2.0, ramp=1.0).height(TIME)
    np.testing.assert_array_equal(faded[TIME >= 1.0], plain[TIME >= 1.0])
    factor = 0.5 * (1 - np.cos(np.pi * TIME[TIME < 1.0]))
    np.testing.assert_allclose(faded[TIME < 1.0, 0], factor * plain[TIME < 1.0, 0], atol=1e-16)


def test_gradient_in_speed_equals_closed_form():
    slope = jax.jit(jax.jacfwd(lambda v: sine(0.01, wavelength=8.0, speed=v).height(TIME)[:, 0]))(16.0)
    np.testing.assert_allclose(slope, 0.01 * np.cos(2 * np.pi * 2.0 * TIME) * 2 * np.pi * TIME / 8.0, atol=1e-13)


def test_has_neither_an_end_nor_samples():
    assert sine(0.01, frequency=2.0).duration is None
    assert sine(0.01, frequency=2.0).grid is None


def test_wave_course_swings_by_half_its_height():
    # 6 m long, 0.15 m from trough to crest, 12 km/h: 0.556 Hz, one wave in 1.8 s
    course = wave_course(0.15, length=6.0, speed=12 / 3.6)
    np.testing.assert_allclose(course.height(np.array([0.45, 1.35, 1.8]))[:, 0], [0.075, -0.075, 0.0], atol=1e-15)
    with pytest.raises(ValueError, match=r"`length` must be positive and finite, but is 0.0"):
        wave_course(0.15, length=0.0, speed=3.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, r"`frequency` must be given, or `wavelength` with `speed`.*neither was given.*Give exactly one"),
        (
            {"frequency": 2.0, "wavelength": 8.0},
            r"`frequency` must be.*not both.*2.0 Hz, and wavelength 8.0 m.*exactly",
        ),
        ({"wavelength": 8.0}, r"`speed` must be given with `wavelength`, but is None.*speed of the vehicle in m/s"),
        ({"frequency": 2.0, "speed": 9.0}, r"`speed` must be left out.*is 9.0.*Give `wavelength` and `speed` instead"),
        ({"wavelength": 8.0, "speed": -3.0}, r"`speed` must be positive and finite, but is -3.0.*driven forwards"),
        ({"wavelength": 0.0, "speed": 3.0}, r"`wavelength` must be positive and finite, but is 0.0"),
        ({"frequency": -2.0}, r"`frequency` must be positive and finite, but is -2.0"),
        ({"amplitude": np.nan, "frequency": 2.0}, r"`amplitude` must be finite, but is nan"),
        ({"frequency": 2.0, "ramp": -1.0}, r"`ramp` must be finite and not negative, but is -1.0.*Use 0"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        sine(**{"amplitude": 0.01, **arguments})
