import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.dampers import GasSpring, Linear

from .cars import SPRING, simulated_and_integrated
from .motions import last_cycle, work


LAW = GasSpring(2e6, 6e-5, 1e-4, 1.3)


def _force(law, x):
    return law.force(x, 0.0, law.initial_state())


def test_force_pushes_the_rod_out():
    np.testing.assert_allclose(_force(LAW, 0.0), -189.8675, rtol=1e-12)
    # pushed in by 0.3 m the volume is half: -(2e6 · 2^1.3 - 101325) 1e-4
    np.testing.assert_allclose(_force(LAW, -0.3), -(2e6 * 2.46228882669 - 101_325) * 1e-4, rtol=1e-10)
    # drawn out until the volume doubles
    np.testing.assert_allclose(_force(LAW, 0.6), -(2e6 / 2.46228882669 - 101_325) * 1e-4, rtol=1e-10)


def test_stiffness():
    stiffness = jax.grad(lambda x: _force(LAW, x))
    np.testing.assert_allclose(stiffness(0.0), 1.3 * 2e6 * 1e-8 / 6e-5, rtol=1e-12)
    assert stiffness(-0.1) > stiffness(0.0) > stiffness(0.1) > 0


def test_work_is_that_of_the_gas():
    x = np.linspace(-0.1, 0.1, 20_001)
    force = np.asarray(respond(LAW, np.linspace(0.0, 1.0, x.size), x, np.full(x.size, 0.2)))
    v0, v1 = 6e-5 - 1e-5, 6e-5 + 1e-5
    of_gas = 2e6 * 6e-5**1.3 / 0.3 * (v0**-0.3 - v1**-0.3)
    np.testing.assert_allclose(np.trapezoid(force, x), 101_325 * (v1 - v0) - of_gas, rtol=1e-8)


def test_no_energy_is_lost():
    _, v, force = last_cycle(LAW, 3.0, 0.1, cycles=1)
    assert abs(work(3.0, v, force)) < 1e-12 * 200.0 * 0.1


def test_finite_beyond_the_pole():
    slope = jax.jit(jax.vmap(jax.value_and_grad(lambda x: _force(LAW, x))))
    border = (0.05 - 1.0) * 6e-5 / 1e-4
    x = jnp.array([-1e3, -1.0, -0.6, border - 1e-9, border + 1e-9, 1e3])
    force, stiffness = slope(x)
    assert np.all(np.isfinite(force)) and np.all(np.isfinite(stiffness)) and np.all(np.diff(force) > 0)
    assert np.all(stiffness > 0)
    np.testing.assert_allclose(force[3], force[4], rtol=1e-6)
    np.testing.assert_allclose(stiffness[3], stiffness[4], rtol=1e-6)
    np.testing.assert_allclose(stiffness[0], stiffness[1], rtol=1e-12)


def test_relative_leaves_out_the_force_at_stroke_zero():
    relative = GasSpring(2e6, 6e-5, 1e-4, 1.3, relative=True)
    assert _force(relative, 0.0) == 0.0
    np.testing.assert_allclose(_force(relative, 0.05) + _force(LAW, 0.0), _force(LAW, 0.05), rtol=1e-12)


@pytest.mark.slow
def test_it_lifts_a_quarter_car():
    law = GasSpring(2e6, 6e-5, 1e-4, 1.3) + Linear(2500.0)

    def force(x, v):
        return 2500.0 * v - (2e6 * (6e-5 / (6e-5 + 1e-4 * x)) ** 1.3 - 101_325.0) * 1e-4

    found, expected = simulated_and_integrated(law, force, amplitude=0.0, frequency=1.0)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.max(np.abs(expected)))
    np.testing.assert_allclose(found[-1], 189.8675 / (SPRING + 1.3 * 2e6 * 1e-8 / 6e-5), rtol=2e-3)


def test_single_precision():
    with jax.enable_x64(False):
        law = GasSpring(2e6, 6e-5, 1e-4, 1.3)
        both = jax.jit(jax.vmap(jax.value_and_grad(lambda x: _force(law, x))))
        force, slope = both(jnp.array([-1e3, -0.6, 0.0, 0.05, 1e3]))
    assert force.dtype == jnp.float32
    assert np.all(np.isfinite(force)) and np.all(np.isfinite(slope))
    np.testing.assert_allclose(force[2], -189.8675, rtol=1e-6)


def test_no_pressure_is_refused():
    with pytest.raises(ValueError, match=r"`GasSpring\.pressure` must be positive"):
        GasSpring(0.0, 6e-5, 1e-4)
