"""The frequency-selective damper: the published equations by SciPy, closed forms, what it is for."""

import json
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import respond
from jaxdamp.dampers import FrequencySelective, Lag, Linear, Table

from .cars import simulated_and_integrated
from .motions import last_cycle, work
from .single_precision import single_precision_error


@pytest.fixture(scope="module")
def feda(data):
    """Both tables and both times of the FEDA truck's damper."""
    return json.loads((data / "damper_curves" / "chrono_damper_curves.json").read_text())["FEDA_FSD"]


def points(published, name):
    return np.array(published[f"{name}_table_v_F"]).T


def selective(published):
    high, low = (Table(*points(published, name)) for name in ("hf", "lf"))
    return FrequencySelective(high, low, published["T0_s"], published["T1_s"])


def source_force(published, v, s):
    """F1 as the source writes it."""
    high, low = (np.interp(a, *points(published, name)) for a, name in ((v, "hf"), (min(v, s), "lf")))
    return high + low if v > 0 else high


def integrated(heading, times, velocity, t):
    """The force by SciPy at instants t, from rest."""

    def rate(t, y):
        v = velocity(t)
        return [(v - y[0]) / times[0], (heading(v, y[0]) - y[1]) / times[1]]

    solved = solve_ivp(rate, (0.0, t[-1]), [0.0, 0.0], "LSODA", t, rtol=1e-10, atol=1e-10, max_step=2e-3)
    assert solved.success, solved.message
    return solved.y[1]


def follows(law, t, velocity):
    stroke = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (velocity(t)[1:] + velocity(t)[:-1]))])
    return np.asarray(respond(law, t, stroke, velocity(t)))


def test_published_equations_where_the_filtered_velocity_is_not_negative(feda):
    t = np.linspace(0.0, 0.6, 12_001)

    def velocity(t):
        return 0.15 * (1 - np.exp(-t / 0.05)) + 0.25 * np.sin(2 * np.pi * 9.0 * t) * (1 - np.exp(-t / 0.1))

    exact = integrated(lambda v, s: source_force(feda, v, s), (feda["T0_s"], feda["T1_s"]), velocity, t)
    assert velocity(t).min() < -0.05 and exact.max() > 8000.0
    # steps of 0.05 ms; the kinks of the tables, passed within a step, limit the error
    np.testing.assert_allclose(follows(selective(feda), t, velocity), exact, atol=2e-4 * np.abs(exact).max())


def test_equations_of_this_law_under_a_sine():
    law = FrequencySelective(Linear(2000.0), Linear(3000.0), 0.03, 0.002)
    t = np.linspace(0.0, 0.5, 10_001)

    def heading(v, s):
        return 2000.0 * v + 3000.0 * (min(v, max(s, 0.0)) if v > 0 else 0.0)

    def velocity(t):
        return 0.4 * np.sin(2 * np.pi * 6.0 * t)

    exact = integrated(heading, (0.03, 0.002), velocity, t)
    np.testing.assert_allclose(follows(law, t, velocity), exact, atol=3e-5 * np.abs(exact).max())


def test_after_compression_the_source_jumps_and_drives_the_motion_and_this_law_does_not(feda):
    law, s = selective(feda), -0.1
    v = np.array([-1e-9, 1e-9, 0.05, 0.3])
    source = np.array([source_force(feda, a, s) for a in v])
    # between the points (-0.13, -6669) and (-0.05, -2935) of the table
    np.testing.assert_allclose(source[1] - source[0], -2935.0 - 3734.0 * 5 / 8, rtol=1e-6)
    assert source[1] * v[1] < 0
    settled = jax.jit(jax.vmap(jax.vmap(lambda v, s: law.settled_force(0.0, v, s), (None, 0)), (0, None)))
    here = np.asarray(settled(v, np.array([s])))[:, 0]
    np.testing.assert_allclose(here, np.interp(v, *points(feda, "hf")), rtol=1e-12, atol=1e-4)

    grid = np.linspace(-0.5, 0.5, 41)
    assert np.all(np.asarray(settled(grid, grid)) * grid[:, None] >= 0)


@pytest.mark.parametrize("frequency", [0.05, 4.0, 1 / (2 * np.pi * 0.04), 40.0])
def test_work_of_linear_laws(frequency):
    # With v = A cos θ, s = A cos φ cos(θ − φ), tan φ = ω τ_f the second law works from θ = φ − π/2, along s up to
    # θ = φ and along v to π/2: ∫ w v dθ = A² (π/4 (1 + cos² φ) − φ/2), which at φ = π/4 is half of that at φ = 0.
    high, low, amplitude, w = 900.0, 2500.0, 0.01, 2 * np.pi * frequency
    law = FrequencySelective(Linear(high), Linear(low), 0.04, 1e-7)
    _, v, force = last_cycle(law, frequency, amplitude, cycles=max(4, int(frequency)))
    phi = np.arctan(w * 0.04)
    share = np.pi / 4 * (1 + np.cos(phi) ** 2) - phi / 2
    expected = (np.pi * high + low * share) * w * amplitude**2
    np.testing.assert_allclose(work(frequency, v, force), expected, rtol=2e-6)


def test_softer_in_fast_oscillation_at_equal_velocity(feda):
    law, peak = selective(feda), 0.2
    rates, slow_rebound = [], []
    for frequency in (0.1, 1.0, 4.0, 12.0):
        _, v, force = last_cycle(law, frequency, peak / (2 * np.pi * frequency), samples=4000)
        rates.append(np.mean((force * v)[v > 0]) / np.mean(v[v > 0] ** 2))
        slow_rebound.append(np.mean((force * v)[v < 0]) / np.mean(v[v < 0] ** 2))
    assert np.all(np.diff(rates) < 0)
    assert rates[-1] < 0.45 * rates[0]
    # in compression only the response lag of 1 ms tells frequencies apart
    np.testing.assert_allclose(slow_rebound, slow_rebound[0], rtol=0.02)


def test_limits_of_slow_and_fast_motion(feda):
    law, peak = selective(feda), 0.3
    both = sum(np.interp(peak, *points(feda, name)) for name in ("hf", "lf"))
    _, _, slow = last_cycle(law, 0.02, peak / (2 * np.pi * 0.02))
    np.testing.assert_allclose(slow.max(), both, rtol=2e-3)
    fast = FrequencySelective(law.high, law.low, 1e3, 1e-7)
    _, v, force = last_cycle(fast, 5.0, peak / (2 * np.pi * 5.0))
    np.testing.assert_allclose(force, np.interp(v, *points(feda, "hf")), atol=1e-3 * both)


@pytest.mark.slow
def test_quarter_car():
    law = FrequencySelective(Linear(900.0), Linear(1500.0), 0.04, 0.002)

    def rate(x, v, s, f):
        heading = 900.0 * v + 1500.0 * min(max(s, 0.0), max(v, 0.0))
        return [(v - s) / 0.04, (heading - f) / 0.002]

    found, expected = simulated_and_integrated(law, lambda x, v, s, f: f, rate, states=2, amplitude=0.03, frequency=1.5)
    assert np.ptp(expected) > 0.05
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.max(np.abs(expected)))


def test_single_precision():
    def make():
        return FrequencySelective(Linear(900.0), Linear(1500.0), 0.04, 0.002)

    assert single_precision_error(make) < 1e-5


@pytest.mark.parametrize("name", ["high", "low"])
def test_laws_with_states_are_refused(name):
    laws: dict[str, Any] = {"high": Linear(1.0), "low": Linear(1.0)} | {name: Lag(Linear(1.0), 0.01)}
    with pytest.raises(ValueError, match=rf"`{name}` must be without states, but is a Lag"):
        FrequencySelective(**laws, filter_time=0.04, response_time=0.001)


def test_derivatives_at_rest_and_at_ties_are_finite():
    law = FrequencySelective(Linear(900.0), Linear(1500.0), 0.04, 0.002)
    slopes = jax.jacfwd(lambda v, s: law.settled_force(0.0, v, s), argnums=(0, 1))
    for v, s in ((0.0, 0.0), (0.1, 0.1), (0.0, 0.1), (-0.1, -0.1)):
        assert np.all(np.isfinite(slopes(jnp.asarray(v), jnp.asarray(s))))
