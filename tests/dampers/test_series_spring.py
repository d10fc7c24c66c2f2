"""Closed forms of the Maxwell element, order and stability of the step, derivative of the implicit solve."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.dampers import Bilinear, CoulombFriction, Lag, Linear, MotionRatio, PowerLaw, SeriesSpring

from .motions import force_at_zero_velocity, last_cycle, work


@pytest.mark.parametrize(("frequency", "stiffness"), [(1.0, 1.5e5), (12.0, 6e5), (12.0, 1.5e7), (40.0, 2e5)])
def test_loop_of_a_linear_law(frequency, stiffness):
    rate, amplitude, w = 3000.0, 0.01, 2 * np.pi * frequency
    x, v, force = last_cycle(SeriesSpring(Linear(rate), stiffness), frequency, amplitude, cycles=12)
    wt = w * rate / stiffness
    peak = rate * w * amplitude / np.sqrt(1 + wt**2)
    np.testing.assert_allclose(np.abs(force).max(), peak, rtol=1e-5)
    np.testing.assert_allclose(work(frequency, v, force), np.pi * rate * w * amplitude**2 / (1 + wt**2), rtol=1e-5)
    np.testing.assert_allclose(2 * np.mean(force * x) / amplitude**2, stiffness * wt**2 / (1 + wt**2), rtol=1e-4)
    np.testing.assert_allclose(force_at_zero_velocity(v, force) / peak, wt / np.sqrt(1 + wt**2), rtol=1e-4)


def test_a_linear_law_gives_the_loop_of_a_lag():
    spring = last_cycle(SeriesSpring(Linear(2500.0), 2500.0 / 0.004), 9.0, 0.01)[2]
    lag = last_cycle(Lag(Linear(2500.0), 0.004), 9.0, 0.01)[2]
    np.testing.assert_allclose(spring, lag, atol=1e-4 * np.abs(lag).max())


@pytest.mark.parametrize("rate", [15_000.0, 200.0])
def test_stable_and_accurate_at_a_millisecond_however_stiff(rate):
    dt, w = 1e-3, 2 * np.pi * 10.0
    t = np.arange(0.0, 0.4, dt)
    stiffness = 1.5e7
    law = SeriesSpring(Linear(rate), stiffness)
    force = respond(law, t, 0.01 * np.sin(w * t), 0.01 * w * np.cos(w * t))
    lag = rate / stiffness
    exact = np.real(rate * w * 0.01 * np.exp(1j * w * t) / (1 + 1j * w * lag))
    late = t > 0.1
    np.testing.assert_allclose(force[late], exact[late], atol=2e-3 * exact.max())


def test_stable_at_a_step_far_too_long():
    law = SeriesSpring(PowerLaw(1800.0, 0.5, 900.0, 0.5) + CoulombFriction(40.0, 0.002), 1.5e7)
    t = np.arange(200) * 0.05
    v = np.where(np.arange(200) % 20 < 10, 0.8, -0.8)
    force = np.asarray(respond(law, t, np.cumsum(v) * 0.05, v))
    assert np.all(np.abs(force) < 2000.0)


def test_second_order():
    law, w = SeriesSpring(Linear(3000.0), 5e5, 1e9), 2 * np.pi * 12.0

    @jax.jit
    def final(count):
        dt = 0.05 / count

        def step(i, state):
            v0, v1 = 0.75 * jnp.sin(w * dt * i), 0.75 * jnp.sin(w * dt * (i + 1))
            return law.advance(0.0, v0, 0.0, v1, state, dt)

        return jax.lax.fori_loop(0, count.astype(int), step, law.initial_state())[0]

    counts = (50.0, 100.0, 200.0, 3200.0)
    *coarse, exact = (float(final(jnp.asarray(count))) for count in counts)
    errors = np.abs(np.array(coarse) - exact)
    np.testing.assert_allclose(errors[:-1] / errors[1:], 4.0, rtol=0.15)
    assert errors[0] < 2e-3 * abs(exact)


def test_derivatives_of_the_implicit_solve():
    state = jnp.array([2e-4])

    def step(parameters):
        rate, stiffness, cubic = parameters
        law = SeriesSpring(Bilinear(rate, 0.5 * rate, 0.02), stiffness, cubic)
        return law.advance(0.01, 0.1, 0.0102, 0.25, state, 1e-3)[0]

    def rate_of_change(parameters):
        rate, stiffness, cubic = parameters
        return SeriesSpring(Bilinear(rate, 0.5 * rate, 0.02), stiffness, cubic).state_rate(0.01, 0.1, state)[0]

    values = jnp.array([2600.0, 6e5, 1e9])
    for function in (step, rate_of_change):
        scaled = jax.jit(lambda factors, function=function: function(values * factors))
        forward, reverse = jax.jacfwd(scaled)(jnp.ones(3)), jax.jacrev(scaled)(jnp.ones(3))
        h = 1e-5
        difference = [(scaled(1 + h * e) - scaled(1 - h * e)) / (2 * h) for e in jnp.eye(3)]
        np.testing.assert_allclose(forward, reverse, rtol=1e-10)
        np.testing.assert_allclose(forward, jnp.array(difference), rtol=1e-5)


def test_rounding_at_the_root_does_not_throw_the_solve_back():
    law = SeriesSpring(PowerLaw(1800.0, 0.4, 900.0, 0.5, knee_width=0.01), 8e5)
    v = jnp.linspace(-3.0, 3.0, 4001)
    step = jax.jit(jax.vmap(lambda v: law.advance(0.0, 0.0, 0.0, v, law.initial_state(), 1e-3)[0]))
    force = 8e5 * np.asarray(step(v))
    smooth = 0.5 * (force[2:] + force[:-2])
    assert np.max(np.abs(force[1:-1] - smooth)[np.abs(v[1:-1]) > 0.5]) < 0.05


@pytest.mark.parametrize(
    "law",
    [
        Lag(Linear(1000.0), 0.01),
        SeriesSpring(Linear(1000.0), 1e6),
        MotionRatio(Lag(Linear(1000.0), 0.01), 0.8),
        2.0 * SeriesSpring(Linear(1000.0), 1e6),
        Lag(Linear(1000.0), 0.01) + Lag(Linear(500.0), 0.02),
    ],
)
def test_a_law_that_does_not_answer_at_once_is_refused(law):
    with pytest.raises(
        ValueError, match=r"`law` must be a law whose force depends directly on the velocity.*Lag\(Series"
    ):
        SeriesSpring(law, 1e6)
