"""Steady sliding, the limit of Dahl, independent integration, dissipation at every instant, stiffness."""

import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import respond
from jaxdamp.dampers import Dahl, Linear, LuGre
from jaxdamp.rig import quasi_static

from .motions import last_cycle
from .single_precision import single_precision_error


def test_steady_sliding():
    law = LuGre(3e5, 200.0, 150.0, 40.0, 70.0, 0.05)
    v = np.array([-0.5, -0.05, -0.02, 0.01, 0.05, 0.1, 1.0])
    expected = np.sign(v) * (40.0 + 30.0 * np.exp(-((v / 0.05) ** 2))) + 150.0 * v
    np.testing.assert_allclose(quasi_static(law, v).force, expected, rtol=1e-9)


def test_without_breakaway_it_is_the_law_of_dahl():
    one = last_cycle(LuGre(4e5, 0.0, 300.0, 60.0, 60.0, 0.02), 3.0, 3e-4, samples=300)[2]
    two = last_cycle(Dahl(4e5, 60.0) + Linear(300.0), 3.0, 3e-4, samples=300)[2]
    np.testing.assert_allclose(one, two, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("stiffness", "damping", "breakaway", "scale"), [(2e5, 300.0, 70.0, 0.05), (2e4, 30.0, 45.0, 0.2)]
)
def test_against_an_independent_solver(stiffness, damping, breakaway, scale):
    sliding, viscous, w = 40.0, 150.0, 2 * np.pi * 6.0

    def velocity(t):
        return 0.25 * np.sin(w * t)

    def curve(v):
        return sliding + (breakaway - sliding) * np.exp(-((v / scale) ** 2))

    def rate(t, z):
        return velocity(t) - stiffness * np.abs(velocity(t)) * z / curve(velocity(t))

    t = np.linspace(0.0, 0.4, 6401)
    z = solve_ivp(rate, (0.0, t[-1]), [0.0], "LSODA", t, rtol=1e-10, atol=1e-14, max_step=1e-3).y[0]
    v = velocity(t)
    fading = np.sqrt(1 + (damping * v / (4 * curve(v))) ** 2)
    expected = stiffness * z + damping / fading * rate(t, z) + viscous * v
    law = LuGre(stiffness, damping, viscous, sliding, breakaway, scale)
    error = []
    for k in (16, 8, 2):
        x = 0.25 / w * (1 - np.cos(w * t[::k]))
        error.append(np.max(np.abs(np.asarray(respond(law, t[::k], x, v[::k])) - expected[::k])))
    size = np.max(np.abs(expected))
    assert error[0] < 0.1 * size
    assert error[2] < error[0] / 25
    assert error[2] < 2e-3 * size


def test_takes_energy_in_at_every_instant(rng):
    """Power beyond what the bristles store; with a damping that does not fade it would be negative here."""
    law = LuGre(3e5, 2e4, 0.0, 40.0, 90.0, 0.02)
    v = np.concatenate([rng.normal(0, 0.02, 200), rng.normal(0, 1.0, 200)])
    z = rng.uniform(-3e-4, 3e-4, v.size)
    stored = 3e5 * z * v - 3e5 * z * 3e5 * np.abs(v) * z / (40.0 + 50.0 * np.exp(-((v / 0.02) ** 2)))
    rate = stored / (3e5 * z)
    force = jax.jit(jax.vmap(lambda v, z: law.force(0.0, v, z[None])))(v, z)
    assert np.min(np.asarray(force) * v - stored) >= -1e-9
    assert np.min((3e5 * z + 2e4 * rate) * v - stored) < -1.0


def test_stiff_contact_at_a_millisecond():
    t = np.arange(0.0, 0.5, 1e-3)
    v = 0.3 * np.sin(25.0 * t)
    law = LuGre(1e9, 0.0, 0.0, 40.0, 60.0, 0.05)
    force = np.asarray(respond(law, t, 0.012 * (1 - np.cos(25.0 * t)), v))
    sliding = np.abs(v) > 0.02
    expected = np.sign(v) * (40.0 + 20.0 * np.exp(-((v / 0.05) ** 2)))
    np.testing.assert_allclose(force[sliding], expected[sliding], rtol=1e-3)


def test_single_precision():
    assert single_precision_error(lambda: LuGre(1e7, 300.0, 200.0, 40.0, 60.0, 0.01)) < 1e-4
