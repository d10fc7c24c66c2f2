"""Closed forms of the loops, the classical equations integrated independently, long steps, fits of the start."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import respond
from jaxdamp.dampers import BoucWen
from jaxdamp.dampers.bouc_wen import hysteresis_step
from jaxdamp.parameters import parameters

from .motions import last_cycle, work
from .single_precision import single_precision_error


def classical_force(t, stroke, velocity, *, c0, k0, alpha, A, beta, gamma, n, x0=0.0):
    """F of Wen's equations as printed, by an independent solver."""

    def rate(t, z):
        v = velocity(t)
        return A * v - gamma * abs(v) * z * np.abs(z) ** (n - 1) - beta * v * np.abs(z) ** n

    z = solve_ivp(rate, (t[0], t[-1]), [0.0], "DOP853", t, rtol=1e-10, atol=1e-15, max_step=1e-3).y[0]
    return c0 * velocity(t) + k0 * (stroke(t) - x0) + alpha * z


@eqx.filter_jit
def states_at_constant_velocity(law, v, dt, steps):
    """States after each step, from full yield the other way."""

    def step(state, _):
        state = law.advance(0.0, v, 0.0, v, state, dt)
        return state, state

    return jax.lax.scan(step, law.initial_state() - 1.0, steps)[1]


@pytest.mark.parametrize(("n", "virgin"), [(1.0, lambda u: 1 - np.exp(-u)), (2.0, np.tanh)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_virgin_curve(n, virgin, sign):
    law = BoucWen(0.0, 0.0, 250.0, 2e-3, 0.7, n)
    t = np.linspace(0.0, 1.0, 2001)
    x = sign * 0.012 * t
    np.testing.assert_allclose(respond(law, t, x), sign * 250.0 * virgin(0.012 * t / 2e-3), atol=2e-4)


@pytest.mark.parametrize("n", [1.0, 1.5, 2.0, 6.0, 20.0])
def test_saturates_at_the_yield_force_in_any_number_of_steps(n):
    for steps, shape in ((1, 0.5), (7, 0.8), (400, 1.0)):
        law = BoucWen(0.0, 0.0, 250.0, 1e-4, shape, n)
        z = np.asarray(states_at_constant_velocity(law, 0.5, 0.02 / steps, np.ones(400)))[:steps]
        assert np.all(np.abs(z) <= 1.0 + 1e-12)
        np.testing.assert_allclose(law.force(0.0, 0.5, jnp.asarray(z[-1])), 250.0, rtol=1e-9)


@pytest.mark.parametrize(("amplitude", "frequency"), [(0.008, 3.0), (0.02, 0.7)])
def test_work_of_a_cycle(amplitude, frequency):
    level, give = 300.0, 1.5e-3
    _, v, force = last_cycle(BoucWen(0.0, 0.0, level, give, 0.5, 1.0), frequency, amplitude)
    u = 2 * amplitude / give  # unloading is a straight line for γ = β, loading an exponential
    expected = 2 * level * give * (-0.5 + (u - 1) - (1 - np.exp(1 - u)))
    np.testing.assert_allclose(work(frequency, v, force), expected, rtol=5e-5)


@pytest.mark.parametrize(
    ("n", "beta", "gamma"), [(1.0, 150.0, 450.0), (1.4, 0.0, 9e3), (2.0, 4e6, 4e6), (5.0, 1e13, 7e13)]
)
def test_classical_equations(n, beta, gamma):
    numbers = dict(c0=700.0, k0=3000.0, alpha=4e5, A=1.3, beta=beta, gamma=gamma, n=n, x0=0.004)
    w1, w2 = 2 * np.pi * 4.0, 2 * np.pi * 11.0

    def stroke(t):
        return 0.006 * np.sin(w1 * t) + 0.002 * (1 - np.cos(w2 * t))

    def velocity(t):
        return 0.006 * w1 * np.cos(w1 * t) + 0.002 * w2 * np.sin(w2 * t)

    t = np.linspace(0.0, 0.5, 4001)
    expected = classical_force(t, stroke, velocity, **numbers)
    law = BoucWen.from_classical(**numbers)
    error = [
        np.max(np.abs(np.asarray(respond(law, t[::k], stroke(t[::k]), velocity(t[::k]))) - expected[::k]))
        for k in (8, 4, 1)
    ]
    size = np.ptp(expected)
    assert error[0] < 4e-3 * size and error[2] < 1e-4 * size
    assert error[2] < error[0] / 20


def test_classical_set_and_back():
    law = BoucWen(700.0, 0.0, 400.0, 2e-3, 0.6, 1.7)
    again = BoucWen.from_classical(700.0, 0.0, **law.classical())
    for a, b in zip(jax.tree.leaves(law), jax.tree.leaves(again), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)
    scaled = BoucWen.from_classical(700.0, 0.0, alpha=50.0, A=20.0, beta=30.0, gamma=90.0, n=2.0)
    np.testing.assert_allclose(scaled.yield_force, 50.0 * np.sqrt(20.0 / 120.0))
    np.testing.assert_allclose(scaled.yield_force / scaled.yield_displacement, 50.0 * 20.0)


def test_a_set_that_may_create_energy_is_refused():
    with pytest.raises(ValueError, match=r"`BoucWen.shape` must be between 0\.5 and 1"):
        BoucWen.from_classical(0.0, 0.0, alpha=1.0, A=1.0, beta=3.0, gamma=1.0, n=1.0)


def test_derivatives_at_rest_are_those_of_the_elastic_branch():
    law = BoucWen(0.0, 0.0, 300.0, 1e-3, 0.75, 1.0)

    @jax.jit
    def force(v):
        return law.force(0.0, v, law.advance(0.0, 0.0, 0.0, v, law.initial_state(), 1e-3))

    np.testing.assert_allclose(jax.grad(force)(0.0), 0.5 * 1e-3 * 300.0 / 1e-3, rtol=1e-9)
    jacobian = jax.jit(jax.jacfwd(lambda z: law.state_rate(0.0, 0.2, z)))(jnp.zeros(1))
    np.testing.assert_allclose(jacobian, [[-0.2 / 1e-3]], rtol=1e-9)


@pytest.mark.parametrize("n", [1.0, pytest.param(1.5, marks=pytest.mark.slow), 2.0, 4.0, 20.0])
@pytest.mark.exhaustive_cases("2.0", "4.0")
def test_derivatives_of_a_step_stay_right_up_to_the_yield_force(n, rng):
    """Where a quotient of rounding errors would be anything, up to 1e9, and differ between both modes."""
    size = 1.0 - np.concatenate([[0.0], 10.0 ** rng.uniform(-16.0, -3.0, 400)])
    travel = 10.0 ** rng.uniform(-3.0, 1.0, size.size)

    def step(travel, z, shape, exponent):
        return hysteresis_step(travel, z, shape, exponent)

    given = jnp.asarray(travel), jnp.asarray(size), 0.75, n
    forward, reverse = (
        np.stack(jax.jit(jax.vmap(mode(step, (0, 1, 2, 3)), (0, 0, None, None)))(*given))
        for mode in (jax.jacfwd, jax.grad)
    )
    np.testing.assert_allclose(forward, reverse, atol=1e-7)
    near = size > 1.0 - 1e-9  # there all loops are that of dw/du = (1 - w^2) n/2
    tanh = np.tanh(0.5 * n * travel[near])
    np.testing.assert_allclose(forward[1, near], (1.0 - tanh**2) / (1.0 + size[near] * tanh) ** 2, rtol=0.0, atol=1e-6)


def test_static_force_is_a_spring_relaxed_elsewhere():
    law = BoucWen.from_classical(0.0, 2000.0, alpha=1.0, A=1.0, beta=0.5, gamma=0.5, n=1.0, x0=0.03)
    np.testing.assert_allclose(law.force(0.03, 0.0, law.initial_state()), 0.0, atol=1e-12)


def test_guess_from_a_loop():
    true = BoucWen(900.0, 0.0, 260.0, 8e-4, static_force=-70.0)
    _, v, force = last_cycle(true, 8.0, 0.03)
    start = BoucWen.guess(v, force)
    np.testing.assert_allclose(start.viscous_rate, 900.0, rtol=0.2)
    np.testing.assert_allclose(start.yield_force, 260.0, rtol=0.2)
    np.testing.assert_allclose(start.static_force, -70.0, rtol=0.2)


@pytest.mark.parametrize("v", [np.zeros(50), np.linspace(-1, 1, 50)])
def test_guess_is_a_law_whatever_the_data(v):
    law = BoucWen.guess(v, -500.0 * v)
    numbers = {p.path: np.asarray(p.value) for p in parameters(law)}
    assert all(np.all(np.isfinite(value)) for value in numbers.values()), numbers
    assert numbers["yield_force"] > 0.0 and numbers["viscous_rate"] >= 0.0
    t = np.linspace(0.0, 0.2, 201)
    force = respond(law, t, 0.01 * np.sin(30.0 * t), 0.3 * np.cos(30.0 * t))
    assert np.all(np.isfinite(force)) and np.mean(force[100:] * np.cos(30.0 * t)[100:]) > 0.0


def test_single_precision():
    assert single_precision_error(lambda: BoucWen(800.0, 2000.0, 300.0, 5e-5, 0.5, 1.3)) < 1e-4
