"""Creep of elements at rest and in slow motion, against closed forms; its agreement with `ViscoPlastic` elsewhere."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.dampers import CreepingViscoPlastic, ViscoPlastic


ELEMENTS = ([150.0, 400.0], [1e-4, 5e-5], [0.0, 2e-4])
LAW = CreepingViscoPlastic(0.0, 0.0, 0.5, 0.002, *ELEMENTS, [0.2, 0.05], 0.8, creep_exponent=2.5)


def test_the_deflections_at_rest_fall_by_a_power_of_time_in_steps_of_any_length():
    state = jnp.array([8e-5, -2.4e-4])  # loads 0.8 and −0.96
    advance = jax.jit(lambda duration: LAW.advance(0.0, 0.0, 0.0, 0.0, state, duration))
    for duration in (1e-3, 1.0, 100.0):
        for after, before, load, tau in zip(advance(duration), state, (0.8, 0.96), (0.2, 0.05), strict=True):
            left = (1.0 + 2.5 * load**2.5 * duration / tau) ** (-1.0 / 2.5)
            assert float(after) == pytest.approx(float(before) * left, rel=1e-6)


def test_in_slow_motion_an_element_flows_before_it_slides():
    for speed in (1e-4, 3e-4):
        t = np.linspace(0.0, 1.5e-4 / speed, 1001)  # not beyond the clearance of the second element
        force = respond(LAW, t, speed * t, np.full_like(t, speed))
        assert float(force[-1]) == pytest.approx(150.0 * (speed * 0.2 / 1e-4) ** (1.0 / 3.5), rel=0.02)


def test_without_time_to_creep_it_is_the_law_that_relaxes():
    t = np.linspace(0.0, 1.0, 1001)
    x, v = 0.002 * np.sin(6.0 * t), 0.012 * np.cos(6.0 * t)
    curve = (100.0, 800.0, 0.5, 0.002)
    slow = [CreepingViscoPlastic(*curve, *ELEMENTS, [1e6] * 2, 0.8), ViscoPlastic(*curve, *ELEMENTS, [1e6] * 2, 0.8)]
    np.testing.assert_allclose(respond(slow[0], t, x, v), respond(slow[1], t, x, v), atol=0.01)
