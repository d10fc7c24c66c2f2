"""Passive for any weights; the step against SciPy; the classical elements it contains."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
from scipy.integrate import solve_ivp

from jaxdamp import respond
from jaxdamp.dampers import Hybrid, Lag, Linear, NeuralHysteresis, PiecewiseLinear
from jaxdamp.parameters import free_parameters, replace


def network(key, **options):
    return NeuralHysteresis.random(jax.random.key(key), velocity_scale=0.3, force_scale=800.0, **options)


def wild(seed, elements=2, width=5, size=3.0):
    """A network with weights far beyond those of a trained one."""
    law = network(seed, elements=elements, width=width)
    names = ("hidden_weights", "hidden_biases", "output_weights", "output_biases")
    keys = jax.random.split(jax.random.key(1000 + seed), 4)
    drawn = [size * jax.random.normal(key, getattr(law, name).shape) for key, name in zip(keys, names, strict=True)]
    return replace(law, dict(zip(names, drawn, strict=True)))


def elastic(law, *, alpha, beta):
    """The law with constant α and β: no weights, biases that softplus turns into them."""
    biases = np.log(np.expm1(np.array([alpha, beta])))
    return replace(law, {"output_weights": jnp.zeros_like(law.output_weights), "output_biases": biases})


def relaxation(law, v, z):
    """ρ in NumPy, written from the formula of the docstring."""
    seen = np.concatenate([[v / 0.3], z / 800.0])
    hidden = np.tanh(np.asarray(law.hidden_weights) @ seen + np.asarray(law.hidden_biases))
    out = np.logaddexp(0.0, np.asarray(law.output_weights) @ hidden + np.asarray(law.output_biases))
    n = z.size
    speed = np.sqrt(v**2 + 0.003**2) - 0.003
    return np.asarray(law.stiffness) / 800.0 * (out[:n] * speed + out[n:] * 0.3)


def test_response_against_an_independent_integration():
    law = network(3, elements=2, width=4)
    t = 1e-3 * np.arange(301)
    w = 2 * np.pi * 7.0
    x, v = 0.5 / w * (1 - np.cos(w * t)), 0.5 * np.sin(w * t)

    def rate(t, z):
        v = 0.5 * np.sin(w * t)
        return np.asarray(law.stiffness) * v - relaxation(law, v, z) * z

    expected = solve_ivp(rate, (0.0, t[-1]), np.zeros(2), "LSODA", t, rtol=1e-10, atol=1e-8).y.sum(axis=0)
    errors = [np.max(np.abs(respond(law, t, x, v, substeps=n) - expected)) / np.ptp(expected) for n in (1, 4)]
    assert errors[0] < 2e-3
    assert errors[1] < errors[0] / 10


@pytest.mark.parametrize("size", [0.3, 3.0, 30.0])
def test_never_gives_back_more_than_was_put_in(size):
    laws = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(wild(seed, size=size) for seed in range(12)))
    t = 5e-4 * np.arange(4001)
    rng = np.random.default_rng(5)
    sizes, frequencies = rng.uniform(0.1, 0.8, 6), rng.uniform(0.3, 25, 6)
    v = sum(a * np.sin(2 * np.pi * f * t) for a, f in zip(sizes, frequencies, strict=True))
    x = scipy.integrate.cumulative_trapezoid(v, dx=5e-4, initial=0.0)
    force = np.asarray(
        jax.jit(jax.vmap(lambda law: respond(law, jnp.asarray(t), jnp.asarray(x), jnp.asarray(v))))(laws)
    )
    work = scipy.integrate.cumulative_trapezoid(force * v, dx=5e-4, axis=1, initial=0.0)
    assert np.all(work.max(axis=1) > 1.0)
    assert np.all(work >= -2e-3 * work.max(axis=1, keepdims=True))


def test_work_is_what_is_stored_and_what_is_dissipated():
    law = wild(2, size=1.0)
    t = 1e-4 * np.arange(4001)
    w = 2 * np.pi * 5.0
    v = 0.6 * np.sin(w * t)

    def rate(t, y):
        v, z, k = 0.6 * np.sin(w * t), y[:2], np.asarray(law.stiffness)
        let_go = relaxation(law, v, z)
        return np.concatenate([k * v - let_go * z, [np.sum(let_go * z**2 / k)]])

    y = solve_ivp(rate, (0.0, t[-1]), np.zeros(3), "LSODA", t, rtol=1e-10, atol=1e-8).y
    force = respond(law, t, 0.6 / w * (1 - np.cos(w * t)), v)
    work = np.trapezoid(force * v, t)
    stored = np.sum(y[:2, -1] ** 2 / (2 * np.asarray(law.stiffness)))
    np.testing.assert_allclose(work, stored + y[2, -1], rtol=1e-4)


def test_constant_relaxation_in_time_is_a_maxwell_element():
    law = elastic(network(0, elements=1, width=1), alpha=1e-12, beta=0.7)
    k = float(law.stiffness[0])
    lag = 800.0 / (k * 0.7 * 0.3)
    t = 1e-3 * np.arange(400)
    x, v = 0.01 * (1 - np.cos(40 * t)), 0.4 * np.sin(40 * t)
    expected = respond(Lag(Linear(k * lag), lag), t, x, v)
    np.testing.assert_allclose(respond(law, t, x, v), expected, atol=2e-3 * np.max(np.abs(expected)))


def test_constant_relaxation_with_travel_saturates_as_friction_does():
    law = elastic(network(0, elements=1, width=1), alpha=2.0, beta=1e-12)
    state = law.initial_state()
    for _ in range(200):
        state = law.advance(0.0, 0.5, 0.0, 0.5, state, 1e-3)
    speed = np.sqrt(0.25 + 0.003**2) - 0.003
    np.testing.assert_allclose(law.force(0.0, 0.5, state), 800.0 / 2.0 * 0.5 / speed, rtol=1e-6)


def test_bounded_at_any_step():
    law, state = wild(1), jnp.zeros(2)
    reach = np.sum(np.asarray(law.stiffness)) * 2.0
    for v in (5.0, -80.0, 0.3, 1000.0, -1000.0):
        state = law.advance(0.0, v, 0.0, v, state, 2.0)
        assert np.all(np.isfinite(state)) and np.max(np.abs(state)) <= reach * abs(v) + 1e-9


def test_the_key_makes_the_weights():
    first, again, other = (free_parameters(network(k)).values for k in (4, 4, 5))
    np.testing.assert_array_equal(first, again)
    assert np.max(np.abs(first - other)) > 0.1


def test_shapes_that_do_not_fit_are_refused():
    law = network(0)
    with pytest.raises(ValueError, match=r"`output_weights` must be of shape \(4, 6\) for 2 elements and 6 hidden"):
        replace(law, {"output_weights": jnp.zeros((3, 6))}).__check_init__()
    with pytest.raises(ValueError, match="`elements` must be 1 or more"):
        network(0, elements=0)


# ---- Hybrid


def test_hybrid_is_the_sum_of_its_parts():
    v = np.linspace(-0.5, 0.5, 300)
    law = Hybrid.guess(v, 1500.0 * np.tanh(4.0 * v), key=jax.random.key(1), elements=1, width=3)
    t = 1e-3 * np.arange(200)
    x, v = 0.01 * (1 - np.cos(40 * t)), 0.4 * np.sin(40 * t)
    np.testing.assert_allclose(respond(law, t, x, v), respond(law.backbone + law.hysteresis, t, x, v), rtol=1e-12)


def test_guess_of_the_hybrid():
    v = np.linspace(-0.5, 0.5, 300)
    force = 1500.0 * np.tanh(4.0 * v)
    law, again = (Hybrid.guess(v, force, key=jax.random.key(7)) for _ in range(2))
    np.testing.assert_array_equal(free_parameters(law).values, free_parameters(again).values)
    np.testing.assert_allclose(law.backbone.force_velocity(0.5), 0.5 * force[-1], rtol=0.05)
    np.testing.assert_allclose(law.hysteresis.force_scale, np.sqrt(np.mean(force**2)))


def test_a_backbone_that_could_drive_the_motion_is_refused():
    backbone = PiecewiseLinear([-0.2, 0.2], [900.0, 2500.0, -300.0], monotone=False)
    with pytest.raises(ValueError, match="`backbone` must be monotone, so that the hybrid is passive"):
        Hybrid(backbone, network(0))
