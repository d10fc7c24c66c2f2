import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import Degressive
from jaxdamp.identify import fit
from jaxdamp.parameters import parameters

from .cars import simulated_and_integrated


def test_force_of_a_truck_damper(data):
    published = json.loads((data / "damper_curves" / "chrono_damper_curves.json").read_text())["MAN_5t_7t_10t"]
    law = Degressive(published["c_exp"], published["d_exp"], published["c_comp"], published["d_comp"])
    # the curve of the same damper in Chrono's tables, at -1 m/s; rebound by hand: 98727.9 / 5.77954
    np.testing.assert_allclose(law.force_velocity(-1.0), -13131.65, atol=5e-3)
    np.testing.assert_allclose(law.force_velocity(1.0), 17082.31035, atol=5e-4)


def test_half_of_the_limit_at_the_inverse_of_the_degressivity():
    law = Degressive(8000.0, 4.0, 3000.0, 2.0)
    np.testing.assert_allclose(law.force_velocity(0.25), 1000.0, rtol=1e-14)
    np.testing.assert_allclose(law.force_velocity(-0.5), -750.0, rtol=1e-14)
    np.testing.assert_allclose(law.force_velocity(1e6), 2000.0, rtol=1e-6)


def test_slopes():
    slope = jax.jit(jax.vmap(jax.grad(Degressive(8000.0, 4.0, 3000.0, 2.0).force_velocity)))
    found = slope(jnp.array([0.0, 1e-12, -1e-12, 0.25, -0.5]))
    np.testing.assert_allclose(found, [8000.0, 8000.0, 3000.0, 2000.0, 750.0], rtol=1e-9)


def test_without_degressivity_it_is_linear():
    law = Degressive(1700.0, 0.0, 900.0, 0.0)
    np.testing.assert_allclose([law.force_velocity(v) for v in (2.0, -3.0)], [3400.0, -2700.0], rtol=1e-14)


def test_guess_and_fit():
    truth = [9000.0, 3.0, 4000.0, 6.0]
    runs = VirtualDyno(Degressive(*truth), force_noise=5.0, seed=1).run(SineTest(0.02, 6.0))
    v = np.concatenate([run.velocity for run in runs])
    start = Degressive.guess(v, np.concatenate([run.force for run in runs]))
    np.testing.assert_allclose(jax.tree.leaves(start), truth, rtol=0.2)
    np.testing.assert_allclose([p.value for p in parameters(fit(Degressive, runs).law)], truth, rtol=0.03)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_guess_mirrors_a_side_without_data(side):
    v = side * np.linspace(0.001, 1.0, 500)
    law = Degressive.guess(v, 5000.0 * v / (1 + 2 * np.abs(v)))
    np.testing.assert_allclose(jax.tree.leaves(law), [5000.0, 2.0, 5000.0, 2.0], rtol=0.15)


@pytest.mark.slow
def test_quarter_car():
    law = Degressive(6000.0, 4.0, 2500.0, 2.0)

    def force(x, v):
        return 6000.0 * v / (1 + 4 * v) if v > 0 else 2500.0 * v / (1 - 2 * v)

    found, expected = simulated_and_integrated(law, force, amplitude=0.02, frequency=2.0)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.max(np.abs(expected)))


def test_single_precision():
    with jax.enable_x64(False):
        v = jnp.array([0.0, 1e-30, -1e-30, 0.3, 1e3, -1e3])
        law = Degressive(98_727.9, 4.77954, 52_526.6, 3.0)
        force, slope = jax.jit(jax.vmap(jax.value_and_grad(law.force_velocity)))(v)
    assert force.dtype == jnp.float32
    assert np.all(np.isfinite(force)) and np.all(np.isfinite(slope))
    np.testing.assert_allclose(force[3], 98_727.9 * 0.3 / (1 + 4.77954 * 0.3), rtol=1e-6)
