"""Closed forms of the loop, exactness of the step, rest, stiffness."""

import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import respond
from jaxdamp.dampers import Dahl, Linear, SeriesSpring

from .motions import last_cycle, work
from .single_precision import single_precision_error


STIFFNESS, LEVEL = 4e5, 60.0


@pytest.mark.parametrize("amplitude", [5e-5, 4e-4, 0.02])
@pytest.mark.parametrize("frequency", [0.5, 8.0])
def test_loop(amplitude, frequency):
    _, v, force = last_cycle(Dahl(STIFFNESS, LEVEL), frequency, amplitude, cycles=20)
    u = 2 * amplitude * STIFFNESS / LEVEL
    peak = np.tanh(u / 2)
    expected = 2 * LEVEL * (2 * amplitude - (1 + peak) * LEVEL / STIFFNESS * (1 - np.exp(-u)))
    np.testing.assert_allclose(np.max(np.abs(force)), LEVEL * peak, rtol=1e-4)
    np.testing.assert_allclose(work(frequency, v, force), expected, rtol=2e-3)


@pytest.mark.parametrize(("v0", "v1"), [(0.3, 0.3), (-0.1, 0.5), (0.4, -0.2), (0.0, -0.3), (-0.2, 0.0), (0.1, -0.1)])
def test_step_is_exact_for_a_velocity_linear_over_the_step(v0, v1):
    dt, start = 2e-3, 17.0

    def rate(t, force):
        v = v0 + (v1 - v0) * t / dt
        return STIFFNESS * (v - abs(v) * force / LEVEL)

    turn = dt * v0 / (v0 - v1) if v0 * v1 < 0 else 0.5 * dt
    force = [start]
    for span in ((0.0, turn), (turn, dt)):
        force = solve_ivp(rate, span, force, "LSODA", rtol=1e-12, atol=1e-12).y[:, -1]
    law = Dahl(STIFFNESS, LEVEL)
    found = law.advance(0.0, v0, 0.0, v1, law.initial_state() + start, dt)
    np.testing.assert_allclose(found, force, rtol=1e-8)


def test_holds_at_rest():
    t = np.arange(400) * 1e-3
    x = np.minimum(0.1 * t, 0.01)
    force = np.asarray(respond(Dahl(STIFFNESS, LEVEL), t, x, np.where(t < 0.1, 0.1, 0.0)))
    np.testing.assert_allclose(force[-1], LEVEL, rtol=1e-9)
    assert np.ptp(force[150:]) == 0.0


def test_stiffness_has_no_limit():
    law = Dahl(1e12, LEVEL)
    for v in (0.5, -0.5, 1e-3, -20.0):
        state = law.advance(0.0, v, 0.0, v, law.initial_state() + LEVEL, 0.05)
        np.testing.assert_allclose(law.force(0.0, v, state), np.sign(v) * LEVEL)


def test_slope_at_rest():
    law = Dahl(STIFFNESS, LEVEL)
    slope = jax.jit(jax.grad(lambda v: law.advance(0.0, 0.0, 0.0, v, law.initial_state(), 1e-3)[0]))(0.0)
    np.testing.assert_allclose(slope, 0.5e-3 * STIFFNESS)


def test_alone_behind_a_spring_it_is_refused():
    with pytest.raises(ValueError, match=r"depends directly on the velocity, but is a Dahl"):
        SeriesSpring(Dahl(STIFFNESS, LEVEL), 1e6)
    SeriesSpring(Linear(1500.0) + Dahl(STIFFNESS, LEVEL), 1e6)


def test_single_precision():
    assert single_precision_error(lambda: Dahl(1e9, LEVEL)) < 1e-5
