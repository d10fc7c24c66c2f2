"""The printed equations integrated independently, limits, voltage, long steps."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import respond
from jaxdamp.dampers import BoucWen, ModifiedBoucWen

from .motions import last_cycle
from .single_precision import single_precision_error


@pytest.mark.slow
@pytest.mark.parametrize("voltage", [0.0, 2.25])
def test_printed_equations_with_the_prototype(voltage):
    """States y and z [m], all numbers as published."""
    alpha, c0, c1 = 14e3 + 69.5e3 * voltage, 2100.0 + 350.0 * voltage, 28.3e3 + 295.0 * voltage
    k0, k1, A, beta, gamma, w = 4690.0, 500.0, 301.0, 3.63e6, 3.63e6, 2 * np.pi * 2.5

    def motion(t):
        return 0.015 * (1 - np.cos(w * t)), 0.015 * w * np.sin(w * t)

    def y_rate(t, y, z):
        x, v = motion(t)
        return (alpha * z + c0 * v + k0 * (x - y)) / (c0 + c1)

    def rate(t, state):
        y, z = state
        u = motion(t)[1] - y_rate(t, y, z)
        return [y_rate(t, y, z), -gamma * abs(u) * z * abs(z) - beta * u * z * z + A * u]

    t = np.linspace(0.0, 0.3, 1201)
    solution = solve_ivp(rate, (0.0, 0.3), [0.0, 0.0], "LSODA", t, rtol=1e-10, atol=1e-14)
    x, v = motion(t)
    expected = c1 * y_rate(t, *solution.y) + k1 * x
    law = ModifiedBoucWen.prototype(voltage)
    error = []
    for k in (4, 2, 1):  # 1 ms and less, while the hysteresis saturates within 0.02 mm
        error.append(np.max(np.abs(np.asarray(respond(law, t[::k], x[::k], v[::k])) - expected[::k])))
    size = np.max(np.abs(expected))
    assert error[0] < 0.02 * size
    assert error[2] < error[0] / 4


@pytest.mark.slow
def test_with_a_stiff_dashpot_it_is_bouc_wen():
    one = last_cycle(ModifiedBoucWen(800.0, 1e11, 3000.0, 300.0, 1e-3, 0.6, 1.5), 4.0, 0.01, samples=300)[2]
    two = last_cycle(BoucWen(800.0, 3000.0, 300.0, 1e-3, 0.6, 1.5), 4.0, 0.01, samples=300)[2]
    np.testing.assert_allclose(one, two, atol=2e-3 * np.max(np.abs(two)))


def test_long_constant_velocity_leaves_the_dashpot_in_series():
    law = ModifiedBoucWen(800.0, 5000.0, 9000.0, 300.0, 1e-3)
    state = jax.lax.fori_loop(0, 2000, lambda _, s: law.advance(0.0, 0.2, 0.0, 0.2, s, 0.01), law.initial_state())
    np.testing.assert_allclose(law.force(0.0, 0.2, state), 5000.0 * 0.2, rtol=1e-9)
    np.testing.assert_allclose(state, [(1000.0 - 300.0) / 9000.0, 1.0], rtol=1e-9)


def test_voltage_changes_three_numbers():
    on = ModifiedBoucWen(800.0, 5000.0, 9000.0, 300.0, 1e-3, 0.75, 2.0, 500.0, -20.0, 100.0, 200.0, 400.0, voltage=2.0)
    off = ModifiedBoucWen(1000.0, 5400.0, 9000.0, 1100.0, 1e-3, 0.75, 2.0, 500.0, -20.0)
    state = jnp.array([0.003, 0.4])
    np.testing.assert_allclose(on.force(0.01, 0.3, state), off.force(0.01, 0.3, state), rtol=1e-12)
    step = eqx.filter_jit(lambda law: law.advance(0.0, 0.3, 0.0, -0.2, state, 1e-3))
    after = [step(law) for law in (on, off)]
    np.testing.assert_allclose(*after, rtol=1e-9)


@pytest.mark.slow
def test_stable_at_a_step_far_too_long():
    t = np.arange(200) * 0.05
    v = np.where(np.arange(200) % 20 < 10, 0.8, -0.8)
    law = ModifiedBoucWen.prototype(2.25)
    force = np.asarray(respond(law, t, np.cumsum(v) * 0.05, v))
    bound = 0.8 * (2100.0 + 350.0 * 2.25) + 1100.0 + (4690.0 + 500.0) * 0.45
    assert np.all(np.abs(force) < 1.2 * bound)


@pytest.mark.slow
def test_single_precision():
    assert single_precision_error(lambda: ModifiedBoucWen.prototype(1.5)) < 1e-3
