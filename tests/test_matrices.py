"""Small matrices: equations and exponentials that sweeps may compute side by side."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp._matrices import solve


@pytest.mark.parametrize("kind", [float, complex])
def test_solves_as_lapack_does(kind):
    rng = np.random.default_rng(1)
    matrix = (rng.standard_normal((9, 9)) + (1j * rng.standard_normal((9, 9)) if kind is complex else 0)).astype(kind)
    matrix[0, 0] = 0.0  # rows must be exchanged
    right = rng.standard_normal((9, 3)).astype(kind)
    for b in (right, right[:, 0]):
        np.testing.assert_allclose(solve(jnp.asarray(matrix), jnp.asarray(b)), np.linalg.solve(matrix, b), rtol=1e-10)


def test_derivatives_are_those_of_the_inverse():
    rng = np.random.default_rng(2)
    matrix, right = jnp.asarray(rng.standard_normal((5, 5))), jnp.asarray(rng.standard_normal(5))
    for of in (jax.jacfwd, jax.jacrev):
        by_matrix, by_right = of(solve, (0, 1))(matrix, right)
        inverse = np.linalg.inv(matrix)
        np.testing.assert_allclose(by_right, inverse, rtol=1e-9)
        expected = -np.einsum("ij,k->ijk", inverse, inverse @ np.asarray(right))
        np.testing.assert_allclose(by_matrix, expected, rtol=1e-8, atol=1e-10)


@pytest.mark.slow
def test_a_sweep_on_a_white_road_ends():
    """With routines of LAPACK inside, as many devices as threads wait for one another for ever."""
    code = """
import jaxdamp; jaxdamp.configure()
import numpy as np
from jaxdamp import Ride, roads, sweep, vehicles
ride = Ride(vehicles.presets.quarter_car_000(), roads.white("C", 20.0), metrics=["rms_sprung_acceleration"])
print(float(sweep(ride, {"damper.rate": np.linspace(500.0, 8000.0, 400)})["rms_sprung_acceleration"].min()))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert 0.8 < float(done.stdout) < 0.93
