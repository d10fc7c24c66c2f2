"""Independent integration, the free travel after a reversal, the limit without clearance."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from jaxdamp import respond
from jaxdamp.dampers import Bilinear, CoulombFriction, KaradayiMasada, SeriesSpring

from .motions import last_cycle
from .single_precision import single_precision_error


@pytest.mark.slow
def test_against_an_independent_solver():
    rebound, compression, friction, scale, k, gap, w = 2600.0, 1200.0, 40.0, 0.01, 4e5, 4e-4, 2 * np.pi * 5.0

    def zone(x):
        return np.maximum(x - gap, 0.0) - np.maximum(-x - gap, 0.0)

    def dashpot_velocity(force):
        def surplus(v):
            return (rebound if v > 0 else compression) * v + friction * np.tanh(v / scale) - force

        return brentq(surplus, -10.0, 10.0, xtol=1e-15)

    def rate(t, x):
        return [0.3 * np.sin(w * t) - dashpot_velocity(k * float(zone(x[0])))]

    t = np.linspace(0.0, 0.15, 1201)
    solution = solve_ivp(rate, (0.0, 0.15), [0.0], "DOP853", t, rtol=1e-10, atol=1e-13, max_step=1e-3)
    expected = k * zone(solution.y[0])
    law = KaradayiMasada(rebound, compression, friction, scale, k, gap)
    error = []
    for step in (8, 4, 1):
        s = t[::step]
        force = respond(law, s, 0.3 / w * (1 - np.cos(w * s)), 0.3 * np.sin(w * s))
        error.append(np.max(np.abs(np.asarray(force) - expected[::step])))
    size = np.max(np.abs(expected))
    assert error[0] < 5e-3 * size
    assert error[2] < error[0] / 15


@pytest.mark.parametrize("gap", [2e-4, 1e-3])
def test_free_travel_after_a_reversal(gap):
    x, v, force = last_cycle(KaradayiMasada(2600.0, 1200.0, 40.0, 0.01, 2e7, gap), 0.4, 0.01, samples=4000)
    free = (force == 0.0) & (v < 0)
    np.testing.assert_allclose(np.ptp(x[free]), 2 * gap, rtol=0.1)


def test_without_clearance_it_is_a_series_spring():
    one = last_cycle(KaradayiMasada(2600.0, 1200.0, 40.0, 0.01, 6e5, 0.0), 9.0, 0.01, samples=300)[2]
    two = last_cycle(SeriesSpring(Bilinear(2600.0, 1200.0) + CoulombFriction(40.0, 0.01), 6e5), 9.0, 0.01, samples=300)[
        2
    ]
    np.testing.assert_allclose(one, two, rtol=1e-9, atol=1e-9)


def test_stable_at_a_step_far_too_long():
    t = np.arange(200) * 0.05
    v = np.where(np.arange(200) % 20 < 10, 0.8, -0.8)
    law = KaradayiMasada(2600.0, 1200.0, 40.0, 0.002, 1.5e7, 3e-4)
    force = np.asarray(respond(law, t, np.cumsum(v) * 0.05, v))
    assert np.all(np.abs(force) < 1.1 * (2600.0 * 0.8 + 40.0))


def test_two_springs_in_series_are_refused():
    law = KaradayiMasada(2600.0, 1200.0, 40.0, 0.01, 1e6, 3e-4)
    with pytest.raises(ValueError, match=r"depends directly on the velocity, but is a KaradayiMasada"):
        SeriesSpring(law, 1e6)


@pytest.mark.exhaustive
def test_single_precision():
    assert single_precision_error(lambda: KaradayiMasada(2600.0, 1200.0, 40.0, 0.01, 1e6, 3e-4)) < 1e-3
