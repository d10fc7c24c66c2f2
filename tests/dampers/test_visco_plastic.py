"""The yield curve in steady sliding, the shelf after a reversal, relaxation at rest, asymmetry, refusals."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.dampers import ViscoPlastic

from .motions import last_cycle
from .single_precision import single_precision_error


def make(flow=1.0, times=(1e3, 1e3), asymmetry=0.8):
    return ViscoPlastic(
        100.0 * flow, 800.0 * flow, 0.5, 0.002, [150.0, 400.0], [1e-4, 5e-5], [0.0, 2e-4], [*times], asymmetry
    )


def test_steady_sliding_is_the_yield_curve_of_herschel_and_bulkley():
    t = np.linspace(0.0, 0.1, 201)
    for v, side in ((0.04, 1.0), (-0.25, -0.8)):
        force = respond(make(), t, v * t, np.full_like(t, v))
        np.testing.assert_allclose(float(force[-1]), side * (650.0 + 800.0 * abs(v) ** 0.5), rtol=2e-4)


def test_after_a_reversal_the_force_stays_on_a_shelf_over_the_clearance_and_then_jumps():
    x, v, force = last_cycle(make(flow=0.0, asymmetry=1.0), 1.0, 0.02, samples=20000)
    back = x.max() - x[v < 0]  # travel since the reversal
    for travel, expected in ((2.5e-5, 112.5 + 200.0), (1.5e-4, -75.0), (4e-4, -150.0), (4.75e-4, -150.0 - 200.0)):
        nearest = np.argmin(np.abs(back - travel))
        np.testing.assert_allclose(force[v < 0][nearest], expected, atol=10.0)


def test_the_force_relaxes_at_rest():
    t = np.linspace(0.0, 1.0, 2001)
    v = np.where(t < 0.5, 0.05, 0.0)
    force = np.asarray(respond(make(flow=0.0, times=(0.2, 0.05)), t, np.cumsum(v) * 5e-4, v))
    later, rest = (t > 0.55), t[t > 0.55] - 0.5
    first = 150.0 * np.exp(-rest / 0.2)
    second = 400.0 * np.maximum(2.5e-4 * np.exp(-rest / 0.05) - 2e-4, 0.0) / 5e-5
    np.testing.assert_allclose(force[later], first + second, rtol=0.02, atol=0.5)


def test_vectors_of_different_length_are_refused():
    with pytest.raises(ValueError, match=r"`sliding_forces` must be as long as `elastic_travels`"):
        ViscoPlastic(100.0, 800.0, 0.5, 0.002, [150.0, 400.0], [1e-4], [0.0], [1.0])


def test_single_precision():
    assert single_precision_error(make) < 1e-3


def test_the_start_from_data_has_the_sliding_force_of_the_data():
    t = np.linspace(0.0, 4.0, 4001)
    v = 0.1 * np.cos(6 * t)
    force = np.asarray(respond(make(), t, 0.1 / 6 * np.sin(6 * t), v))
    start = ViscoPlastic.guess(v, force)
    level = float(start.yield_force + jnp.sum(start.sliding_forces)) / 0.8 + float(start.viscous_force) * 0.1**0.5
    assert 0.6 < level / np.max(force) < 1.2
