import numpy as np
import pytest
from scipy.special import gamma

from jaxdamp.dampers import PowerLaw
from jaxdamp.dampers.base import Reach

from .motions import last_cycle, work


@pytest.mark.parametrize(
    ("exponent", "factor"), [(0.5, 3.4961), (0.65, 3.3777), (1.0, np.pi), (1.8, None), (2.0, 8 / 3)]
)
def test_work_of_a_cycle(exponent, factor):
    closed = 2 * np.sqrt(np.pi) * gamma(exponent / 2 + 1) / gamma(exponent / 2 + 1.5)
    if factor is not None:
        np.testing.assert_allclose(closed, factor, atol=5e-5)
    law = PowerLaw(1700.0, exponent, 1700.0, exponent, knee_width=1e-6)
    frequency, amplitude = 3.0, 0.02
    _, v, force = last_cycle(law, frequency, amplitude, cycles=1, samples=20000)
    w = 2 * np.pi * frequency
    expected = 1700.0 * w**exponent * amplitude ** (exponent + 1) * closed
    np.testing.assert_allclose(work(frequency, v, force), expected, rtol=1e-7)


def test_work_of_a_cycle_of_dry_friction():
    law = PowerLaw(1e-9, 1.0, 1e-9, 1.0, 40.0, 60.0, knee_width=1e-7)
    _, v, force = last_cycle(law, 2.0, 0.01, cycles=1, samples=20000)
    np.testing.assert_allclose(work(2.0, v, force), 2 * 0.01 * (40.0 + 60.0), rtol=1e-5)


@pytest.mark.parametrize("exponent", [0.4, 0.65, 1.8])
def test_error_of_the_rounding(exponent):
    law = PowerLaw(1800.0, exponent, 900.0, exponent, knee_width=1e-3)
    v = 0.05
    exact = 1800.0 * v**exponent
    relative = float(law.force_velocity(v)) / exact - 1.0
    np.testing.assert_allclose(relative, (exponent - 1) / 2 * (1e-3 / v) ** 2, rtol=1e-3)


def test_sides_and_offsets():
    law = PowerLaw(1800.0, 0.5, 900.0, 0.7, 30.0, 20.0, knee_width=1e-6)
    np.testing.assert_allclose(law.force_velocity(0.25), 1800.0 * 0.5 + 30.0, rtol=1e-9)
    np.testing.assert_allclose(law.force_velocity(-0.25), -900.0 * 0.25**0.7 - 20.0, rtol=1e-9)


def test_guess_finds_a_power_law():
    v = np.linspace(-1.0, 1.0, 401)
    force = np.where(v > 0, 1800.0, 900.0) * np.sign(v) * np.abs(v) ** np.where(v > 0, 0.55, 0.8)
    law = PowerLaw.guess(v, force)
    found = [law.rebound_force, law.rebound_exponent, law.compression_force, law.compression_exponent]
    np.testing.assert_allclose(found, [1800.0, 0.55, 900.0, 0.8], rtol=1e-6)


def test_a_side_without_force_starts_from_a_straight_line_where_there_is_motion():
    law = PowerLaw(1e-3, 1.5, 900.0, 0.6, 0.0, 10.0)
    (start,) = law.other_starts(Reach(0.02, 0.5))
    assert start == pytest.approx({"rebound_force": (900.0 * 0.5**0.6 + 10.0) / 0.5, "rebound_exponent": 1.0})
    assert law.other_starts(Reach(0.0, 0.0)) == law.other_starts(Reach(np.inf, np.inf)) == []
