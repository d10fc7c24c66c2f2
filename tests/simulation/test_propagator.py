import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from jaxdamp._matrices import phi_functions
from jaxdamp.parameters import replace
from jaxdamp.simulation.exponential import Propagator
from jaxdamp.vehicles import rest_position
from jaxdamp.vehicles.presets import quarter_car_000


def by_scipy(z):
    """eᶻ, φ₁, φ₂ and φ₃ from one exponential of the matrix augmented by a constant, a ramp and a parabola."""
    n = z.shape[0]
    big = np.zeros((4 * n, 4 * n))
    big[:n, :n] = z
    for i in range(3):
        big[i * n : (i + 1) * n, (i + 1) * n : (i + 2) * n] = np.eye(n)
    whole = scipy.linalg.expm(big)
    return tuple(whole[:n, i * n : (i + 1) * n] for i in range(4))


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 0.4, 0.6, 7.0, 300.0])
def test_phi_functions_are_those_of_scipy(size, rng):
    a = rng.normal(size=(5, 5))
    z = size * (a - a.T - 0.2 * np.eye(5)) / 5
    for found, expected in zip(phi_functions(jnp.asarray(z)), by_scipy(z), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-15 * (10 + 10 * size))


def test_phi_functions_of_a_defective_matrix():
    found = phi_functions(jnp.array([[0.0, 3.0], [0.0, 0.0]]))
    for matrix, corner in zip(found, (3.0, 3.0 / 2, 3.0 / 6, 3.0 / 24), strict=True):
        assert float(matrix[0, 1]) == pytest.approx(corner, rel=1e-14)


@pytest.mark.parametrize("dt", [1e-4, 1e-3, 0.02])
def test_step_is_exact_for_straight_roads_and_parabolic_forces(dt, rng):
    """Two half steps along the same inputs are the whole step, with tyre damping."""
    rate = replace(quarter_car_000(), {"tyre_damping": 300.0}).system().motion
    whole, half = Propagator.over(rate, jnp.asarray(dt)), Propagator.over(rate, jnp.asarray(dt / 2))
    x, parabola, line = rng.normal(size=4), 1e3 * rng.normal(size=3), 0.01 * rng.normal(size=2)

    def step(p, x, begin, length):
        before, now, after = (np.polyval(parabola, [t]) for t in (begin - length, begin, begin + length))
        height, next_height = (np.polyval(line, [t]) for t in (begin, begin + length))
        x = p.phi @ x + p.force_held @ now + p.force_ramp @ (after - now) + p.road_held @ height
        return x + p.force_bend @ (after - 2.0 * now + before) + p.road_ramp @ (next_height - height)

    halves = step(half, step(half, x, 0.0, 0.5), 0.5, 0.5)
    np.testing.assert_allclose(halves, step(whole, x, 0.0, 1.0), rtol=1e-11, atol=1e-12)


def test_a_vehicle_at_rest_stays():
    system = quarter_car_000().system()
    p = Propagator.over(system.motion, jnp.asarray(1e-3))
    road = jnp.array([0.3])
    position = rest_position(system, road)
    start = jnp.concatenate([position, jnp.zeros(2)])
    np.testing.assert_allclose(p.phi @ start + p.road_held @ jnp.array([0.3]), start, atol=1e-14)


@pytest.mark.slow
def test_batches_and_derivatives_pass_through():
    car = quarter_car_000()

    @jax.jit
    def phi(rate):
        return Propagator.over(replace(car, {"spring_rate": rate}).system().motion, jnp.asarray(1e-3)).phi[2, 0]

    rates = jnp.array([1e3, 6e4, 5e6])
    np.testing.assert_allclose(jax.vmap(phi)(rates), [phi(r) for r in rates], rtol=1e-13)
    difference = (phi(60_060.0) - phi(59_940.0)) / 120.0
    for mode in (jax.grad, jax.jacfwd):
        assert float(mode(phi)(60e3)) == pytest.approx(float(difference), rel=1e-7)
