"""Closed forms of a lag: it is the Maxwell element of stiffness c/τ."""

import numpy as np
import pytest

from jaxdamp.dampers import Lag, Linear

from .motions import force_at_zero_velocity, last_cycle, work


RATE, LAG = 2500.0, 0.004


@pytest.mark.parametrize("frequency", [1.0, 12.0, 40.0])
def test_loop_of_a_linear_law(frequency):
    amplitude, w = 0.01, 2 * np.pi * frequency
    x, v, force = last_cycle(Lag(Linear(RATE), LAG), frequency, amplitude)
    wt = w * LAG
    peak = RATE * w * amplitude / np.sqrt(1 + wt**2)
    np.testing.assert_allclose(np.abs(force).max(), peak, rtol=1e-5)
    np.testing.assert_allclose(work(frequency, v, force), np.pi * RATE * w * amplitude**2 / (1 + wt**2), rtol=1e-5)
    stored = 2 * np.mean(force * x) / amplitude**2
    np.testing.assert_allclose(stored, RATE / LAG * wt**2 / (1 + wt**2), rtol=1e-5)
    np.testing.assert_allclose(force_at_zero_velocity(v, force) / peak, wt / np.sqrt(1 + wt**2), rtol=1e-5)


def test_step_is_exact_for_a_force_linear_over_the_step():
    law, dt = Lag(Linear(RATE), LAG), 0.003
    state, v0, v1 = law.initial_state() + 100.0, 0.2, 0.5
    ramp = RATE * (v1 - v0) / dt
    exact = RATE * v1 - ramp * LAG + (100.0 - RATE * v0 + ramp * LAG) * np.exp(-dt / LAG)
    np.testing.assert_allclose(law.advance(0.0, v0, 0.0, v1, state, dt)[0], exact, rtol=1e-13)


def test_a_lag_far_below_the_step_is_no_lag():
    law = Lag(Linear(RATE), 1e-9)
    state = law.advance(0.0, 0.2, 0.0, 0.5, law.initial_state(), 1e-3)
    np.testing.assert_allclose(law.force(0.0, 0.5, state), RATE * 0.5, rtol=1e-6)


def test_two_lags_in_any_order():
    first = last_cycle(Lag(Lag(Linear(RATE), 0.002), 0.006), 8.0, 0.01)[2]
    second = last_cycle(Lag(Lag(Linear(RATE), 0.006), 0.002), 8.0, 0.01)[2]
    np.testing.assert_allclose(first, second, atol=1e-5 * np.abs(first).max())
