"""Structure that motion breaks: steady, fast and recovering, against closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.dampers import Linear, StrokeScaled, Thinned


LAW = Thinned(Linear(1000.0), thinning_velocity=0.1, recovery_time=0.5)


def force_of(velocity, dt):
    velocity = np.asarray(velocity)
    stroke = np.concatenate([[0.0], np.cumsum(0.5 * dt * (velocity[1:] + velocity[:-1]))])
    return np.asarray(respond(LAW, dt * np.arange(velocity.size), stroke, velocity))


def test_after_a_stop_the_structure_recovers_with_its_time_constant():
    velocity = np.concatenate([np.full(4001, 0.3), np.zeros(500), np.full(2, 0.3)])
    force = force_of(velocity, 1e-3)
    rate = (1.0 + 0.3 / 0.1) / 0.5  # of the breaking at 0.3 m/s: s = ¾ (1 − exp(−rate t))
    time = 1e-3 * np.arange(4001)
    np.testing.assert_allclose(force[:4001], 300.0 * (1.0 - 0.75 * (1.0 - np.exp(-rate * time))), rtol=1e-10)
    np.testing.assert_allclose(force[4501], 300.0 * (1.0 - 0.75 * np.exp(-1.0)), rtol=5e-3)  # 0.5 s of rest


def test_in_a_fast_oscillation_the_force_has_the_factor_of_the_mean_speed():
    time = 1e-4 * np.arange(100_001)
    velocity = 0.2 * np.cos(2 * np.pi * 40.0 * time)
    last = slice(-5000, None)
    factor = force_of(velocity, 1e-4)[last] @ velocity[last] / (1000.0 * velocity[last] @ velocity[last])
    np.testing.assert_allclose(factor, 1.0 / (1.0 + 0.2 * 2.0 / np.pi / 0.1), rtol=1e-3)


@pytest.mark.parametrize("stroke", [-10.0, 0.05, 10.0])
def test_a_factor_along_the_stroke_is_finite_far_outside(stroke):
    """In single precision too: a search may try any slope."""
    law = StrokeScaled(Linear(jnp.float32(2000.0)), jnp.float32(-50.0), jnp.float32(2e3))
    of_stroke = jax.value_and_grad(lambda x: law.force(x, jnp.float32(0.1), law.initial_state()))
    assert np.all(np.isfinite(of_stroke(jnp.float32(stroke))))
    slopes = jax.grad(lambda law: law.force(jnp.float32(stroke), jnp.float32(0.1), law.initial_state()))(law)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(slopes))
