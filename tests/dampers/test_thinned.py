"""Structure that motion breaks: steady, fast and recovering, against closed forms."""

import numpy as np

from jaxdamp import respond
from jaxdamp.dampers import Linear, Thinned


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
