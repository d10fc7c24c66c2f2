import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.dampers import CoulombFriction, StribeckFriction

from .motions import last_cycle, work


def test_force():
    law = StribeckFriction(40.0, 70.0, stribeck_velocity=0.02, friction_velocity=1e-3)
    # 40 + 30/e at v_s, 40 + 30 exp(-4) at 2 v_s, 40 far away
    found = [law.force_velocity(v) for v in (0.02, -0.04, 1.0, 0.0)]
    np.testing.assert_allclose(found, [51.03638324, -40.54946917, 40.0, 0.0], rtol=1e-9)


def test_slope_at_rest_is_finite():
    slope = jax.grad(StribeckFriction(40.0, 70.0, 0.02, 1e-3).force_velocity)
    np.testing.assert_allclose(slope(0.0), 70_000.0, rtol=1e-12)


def test_the_force_falls_with_velocity():
    slope = jax.jit(jax.vmap(jax.grad(StribeckFriction(40.0, 70.0, 0.02, 1e-3).force_velocity)))
    # steepest at v_s/√2: -√(2/e) (F_s - F_c)/v_s
    lowest = float(np.min(slope(jnp.linspace(0.005, 0.1, 2001))))
    np.testing.assert_allclose(lowest, -np.sqrt(2 / np.e) * 30.0 / 0.02, rtol=1e-4)


@pytest.mark.parametrize(("ratio", "share"), [(0.05, 0.98), (0.1, 0.96), (0.3, 0.83)])
def test_peak_that_is_left(ratio, share):
    law = StribeckFriction(40.0, 80.0, 0.02, 0.02 * ratio)
    peak = np.max(jax.jit(jax.vmap(law.force_velocity))(jnp.linspace(0.0, 0.05, 2001)))
    np.testing.assert_allclose(peak / 80.0, share, atol=0.005)


def test_equal_levels_are_coulomb_friction():
    v = jnp.linspace(-0.1, 0.1, 201)
    found = jax.jit(jax.vmap(StribeckFriction(40.0, 40.0, 0.02, 2e-3).force_velocity))(v)
    np.testing.assert_allclose(found, jax.jit(jax.vmap(CoulombFriction(40.0, 2e-3).force_velocity))(v), rtol=1e-13)


def test_work_of_a_fast_cycle():
    # far above v_s nearly all the stroke is at F_c: 4 F_c X
    _, v, force = last_cycle(StribeckFriction(40.0, 70.0, 1e-3, 1e-4), 5.0, 0.02, cycles=1)
    np.testing.assert_allclose(work(5.0, v, force), 4 * 40.0 * 0.02, rtol=1e-3)


def test_guess_has_the_level():
    v = 0.3 * np.sin(np.linspace(0.0, 20.0, 3001))
    law = StribeckFriction.guess(v, 60.0 * np.tanh(v / 0.002))
    assert 20.0 < float(law.friction_force) <= float(law.breakaway_force) < 90.0
    assert float(law.friction_velocity) < 0.2 * float(law.stribeck_velocity)
