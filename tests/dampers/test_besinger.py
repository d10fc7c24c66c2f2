"""Paper 001: the numbers of its parameter set."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.dampers import Besinger, SeriesSpring
from jaxdamp.dampers.besinger import least_rebound, transition_rate
from jaxdamp.dampers.inside import margins
from jaxdamp.export import from_json, to_json
from jaxdamp.parameters import replace

from .motions import force_at_zero_velocity, last_cycle, work


PUBLISHED = (14_400.0, 15_600.0, 3_600.0, 0.125, 0.7)


def test_opening_velocity_makes_the_force_continuous():
    law = Besinger(*PUBLISHED)
    np.testing.assert_allclose(law.opening_velocity(), 0.1147828786, atol=5e-11)
    v_open, v_lim = float(law.opening_velocity()), 0.125
    above = 15_600.0 * v_open + 3_600.0 * (v_lim - v_open)
    np.testing.assert_allclose(law.force_velocity(v_lim), above, rtol=1e-12)


@pytest.mark.parametrize(
    ("v", "force"), [(0.125, 1827.394543), (-0.3, -4352.5383), (0.3, 2457.3945), (-0.12566, -1827.3906), (0.0, 0.0)]
)
def test_force(v, force):
    np.testing.assert_allclose(Besinger(*PUBLISHED).force_velocity(v), force, atol=5e-5)


def test_transition_rate():
    np.testing.assert_allclose(transition_rate(0.0, 14_400.0, 15_600.0, 0.7), 14575.735931, atol=5e-7)
    np.testing.assert_allclose(transition_rate(-1e9, 14_400.0, 15_600.0, 0.7), 14_400.0, rtol=1e-12)
    np.testing.assert_allclose(transition_rate(1e9, 14_400.0, 15_600.0, 0.7), 15_600.0, rtol=1e-12)


@pytest.mark.parametrize(("alpha", "v_open", "digits"), [(0.07, 0.12261, 5), (0.007, 0.12499, 5), (0.7, 0.114783, 6)])
def test_opening_velocity_over_transition_velocity(alpha, v_open, digits):
    law = Besinger(*PUBLISHED[:4], transition_velocity=alpha)
    np.testing.assert_allclose(law.opening_velocity(), v_open, atol=0.51 * 10**-digits)


def test_the_printed_formula_jumps():
    with pytest.warns(UserWarning, match=r"v_open = 0\.125 m/s jumps by \+122\.6 N \(\+6\.7 %\) at v_lim = 0\.125 m/s"):
        law = Besinger.from_printed(*PUBLISHED)
    np.testing.assert_allclose(15_600.0 * 0.125 - law.force_velocity(0.125), 122.605457, atol=5e-7)


def test_the_printed_formula_with_the_right_opening_velocity_is_silent():
    law = Besinger.from_printed(*PUBLISHED, v_open=float(Besinger(*PUBLISHED).opening_velocity()))
    np.testing.assert_allclose(law.force_velocity(0.3), 2457.3945, atol=5e-5)


def increases(compression, rebound, limit, transition):
    """Whether C(v) v grows up to v_lim."""
    v = np.linspace(-5.0 * transition, limit, 30001)
    rate = jax.vmap(lambda v: transition_rate(v, compression, rebound, transition))(v)
    return bool(np.all(np.diff(v * np.asarray(rate)) > 0))


def is_accepted(compression, rebound, limit, transition):
    try:
        Besinger(compression, rebound, 3_600.0, limit, transition)
    except ValueError as error:
        assert "Otherwise the force decreases with increasing velocity" in str(error)
        return False
    return True


@pytest.mark.parametrize("ratio", [0.0060, 0.0066, 0.0068])
def test_a_set_whose_force_falls_in_compression_is_refused(ratio):
    numbers = (ratio * 15_600.0, 15_600.0, 0.125, 0.7)
    assert is_accepted(*numbers) is increases(*numbers) is (ratio > 0.0067)


@pytest.mark.parametrize("transition", [0.02, 0.07, 0.1, 0.119, 0.2])
def test_a_set_whose_force_falls_in_rebound_is_refused(transition):
    edge = 15_600.0 * float(least_rebound(0.125, transition))
    assert (edge > 0) is (transition < 0.125)
    for factor in (0.98, 1.02):
        rebound = factor * edge if edge else 10.0
        numbers = (15_600.0, rebound, 0.125, transition)
        assert is_accepted(*numbers) is increases(*numbers) is (not edge or factor > 1)


def test_a_replaced_value_and_a_file_are_refused_too():
    law = SeriesSpring(Besinger(*PUBLISHED), 1.5e6)
    with pytest.raises(ValueError, match=r"above 0.0067 rebound_rate, 104.52, but is 100.0"):
        replace(law, {"law.compression_rate": 100.0})
    text = to_json(law).replace("14400.0", "100.0")
    with pytest.raises(ValueError, match=r"Besinger.compression_rate` must be above 0.0067 rebound_rate"):
        from_json(text)


def test_the_published_set_is_far_from_the_edge_and_traced_values_pass():
    assert np.all(np.asarray(margins(Besinger(*PUBLISHED))) > 1e4)
    made = jax.jit(lambda c: Besinger(c, *PUBLISHED[1:]).force_velocity(0.1))(1.0)
    assert np.isfinite(made)


# frequency, amplitude, then rigid and with the series spring: F+, F-, work, equivalent damping (None: not printed);
# deflection of the spring [mm] and |F(v = 0)|, each after rebound and after compression
TABLE = [
    (1.0, 0.010, (917, -915, 28.8, 14577), (789, -787, 21.1, 10708), (5.1, 5.1), (402, 402)),
    (2.0, 0.010, (1830, -1827, 57.5, 14577), (1198, -1195, 24.1, 6093), (7.6, 7.6), (897, 897)),
    (2.5, 0.010, (1943, -2283, 69.0, None), (1307, -1305, 22.8, None), (8.3, 8.3), (1062, 1062)),
    (2.0, 0.020, (2282, -3648, 195.8, None), (2158, -2598, 103.6, None), (12.7, 14.8), (1479, 1759)),
    (2.5, 0.020, (2508, -4557, 232.4, None), (2303, -2945, 103.7, None), (13.4, 16.2), (1650, 2161)),
]


def _check_loop(frequency, amplitude, v, force, printed):
    high, low, energy, damping = printed
    np.testing.assert_allclose([force.max(), force.min()], [high, low], atol=1.0)
    np.testing.assert_allclose(work(frequency, v, force), energy, atol=0.06)
    if damping is not None:
        equivalent = work(frequency, v, force) / (np.pi * 2 * np.pi * frequency * amplitude**2)
        np.testing.assert_allclose(equivalent, damping, rtol=2e-4)


@pytest.mark.parametrize(("frequency", "amplitude", "rigid", "series", "deflection", "at_zero"), TABLE)
def test_rig_table(frequency, amplitude, rigid, series, deflection, at_zero):
    law = Besinger(*PUBLISHED)
    _, v, force = last_cycle(law, frequency, amplitude)
    _check_loop(frequency, amplitude, v, force, rigid)
    np.testing.assert_allclose(force_at_zero_velocity(v, force), 0.0, atol=5.0)
    _, v, force = last_cycle(SeriesSpring(law, 1.5e5, 1.2e8), frequency, amplitude)
    _check_loop(frequency, amplitude, v, force, series)
    # the printed values were read at the sample nearest to v = 0
    np.testing.assert_allclose(force_at_zero_velocity(v, force), at_zero, rtol=5e-3)
    grid = np.linspace(-0.02, 0.02, 40001)
    spring = 1.5e5 * grid + 1.2e8 * grid**3
    extremes = np.interp([force.max(), -force.min()], spring, grid)
    np.testing.assert_allclose(1e3 * extremes, deflection, atol=0.06)


def test_a_ten_times_stiffer_spring_is_plausible():
    _, v, force = last_cycle(SeriesSpring(Besinger(*PUBLISHED), 1.5e6), 2.0, 0.010)
    np.testing.assert_allclose([force.max(), force.min()], [1828.0, -1819.0], rtol=3e-3)
    np.testing.assert_allclose(force_at_zero_velocity(v, force), 220.0, atol=2.0)


def test_guess_finds_the_knee_and_the_slopes():
    v = np.linspace(-0.5, 0.5, 801)
    force = np.where(v > 0.2, 600.0 + 700.0 * (v - 0.2), np.where(v > 0, 3000.0, 1100.0) * v)
    law = Besinger.guess(v, force)
    np.testing.assert_allclose(law.limit_velocity, 0.2, atol=0.02)
    np.testing.assert_allclose(law.rebound_rate, 3000.0, rtol=0.05)
    np.testing.assert_allclose(law.blow_off_rate, 700.0, rtol=0.05)


def test_a_guess_keeps_the_conditions_where_the_force_falls_in_rebound():
    velocity = np.linspace(-0.3, 0.3, 601)
    law = Besinger.guess(velocity, np.where(velocity > 0, -200.0 * velocity, 3000.0 * velocity))
    v = np.linspace(-1.0, 1.0, 2001)
    assert np.all(np.diff(jax.vmap(law.force_velocity)(jnp.asarray(v))) > 0)
