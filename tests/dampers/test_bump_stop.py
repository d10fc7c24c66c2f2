import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.dampers import BumpStop, Linear

from .cars import simulated_and_integrated
from .motions import last_cycle, work


def _force(law, x, v=0.0):
    return float(law.force(x, v, law.initial_state()))


def test_direction_on_both_ends():
    both = BumpStop(0.04, 50e3, 2e8, end="both")
    # 10.5 mm beyond contact with 1 mm of engagement: d = 10 mm, 500 N + 200 N
    np.testing.assert_allclose([_force(both, x) for x in (-0.0505, 0.0505)], [-700.0, 700.0], rtol=1e-12)
    assert [_force(both, x, v) for x in (-0.04, 0.0, 0.04) for v in (-2.0, 2.0)] == [0.0] * 6


@pytest.mark.parametrize(("end", "touched", "free"), [("compression", -0.0505, 0.0505), ("rebound", 0.0505, -0.0505)])
def test_one_end(end, touched, free):
    law = BumpStop(0.04, 50e3, damping=100.0, end=end)
    sign = np.sign(touched)
    np.testing.assert_allclose(_force(law, touched), sign * 500.0, rtol=1e-12)
    np.testing.assert_allclose(_force(law, touched, sign * 2.0), sign * 700.0, rtol=1e-12)
    np.testing.assert_allclose(_force(law, touched, -sign * 2.0), sign * 300.0, rtol=1e-12)
    assert _force(law, free, 1.0) == _force(law, free, -1.0) == 0.0


def test_damping_comes_in_with_the_penetration():
    law = BumpStop(0.04, 0.0, damping=100.0, engagement_width=4e-3)
    beyond = (-1e-3, 0.0, 1e-3, 2e-3, 4e-3, 9e-3)
    found = [_force(law, -0.04 - u, -3.0) for u in beyond]
    np.testing.assert_allclose(found, [0.0, 0.0, -75.0, -150.0, -300.0, -300.0], atol=1e-9)


def test_a_stop_never_pulls():
    law = BumpStop(0.04, 50e3, damping=1000.0)
    assert _force(law, -0.0505, 2.0) == 0.0
    np.testing.assert_allclose(_force(law, -0.0505, 0.3), -200.0, rtol=1e-9)


def test_slope_is_continuous_at_contact():
    law = BumpStop(0.04, 50e3, end="both")
    slope = jax.jit(jax.vmap(jax.grad(lambda x: law.force(x, 0.0, law.initial_state()))))
    edges = np.array([0.04, 0.041, -0.04, -0.041])
    np.testing.assert_allclose(slope(jnp.asarray(edges + 1e-9)), slope(jnp.asarray(edges - 1e-9)), atol=0.2)
    np.testing.assert_allclose(slope(jnp.array([0.0, 0.0405, 0.05])), [0.0, 25e3, 50e3], rtol=1e-9)


def test_work_of_a_cycle():
    # always in contact (no clearance, both ends) it is spring and damper, π c ω X², less what they would take while
    # they pull: on both ways out, from tan φ = c ω/k to φ = 0 with x = X sin φ
    k, damping = 80e3, 500.0 * 2 * np.pi * 3.0
    free = np.arctan(damping / k)
    lost = damping * (0.5 * free + 0.25 * np.sin(2 * free)) - 0.5 * k * np.sin(free) ** 2
    law = BumpStop(0.0, k, damping=500.0, engagement_width=1e-7, end="both")
    _, v, force = last_cycle(law, 3.0, 0.02, cycles=1, samples=20_000)
    np.testing.assert_allclose(work(3.0, v, force), (np.pi * damping - 2 * lost) * 0.02**2, rtol=1e-3)
    _, v, force = last_cycle(BumpStop(0.01, 80e3, 1e8, end="both"), 3.0, 0.02, cycles=1)
    assert abs(work(3.0, v, force)) < 1e-9


def test_derivatives_in_compression():
    x, v = jnp.array([-0.03, -0.0405, -0.045, -0.06]), jnp.array([-0.5, -0.5, 0.2, -1.0])

    def forces(numbers):
        law = BumpStop(numbers[0], numbers[1], numbers[2], numbers[3])
        return jax.vmap(lambda x, v: law.force(x, v, law.initial_state()))(x, v)

    numbers = jnp.array([0.04, 50e3, 2e8, 300.0])
    rows = jnp.broadcast_to(numbers, (4, 4))
    forward, reverse = (jax.jit(derivative(forces))(numbers) for derivative in (jax.jacfwd, jax.jacrev))
    np.testing.assert_allclose(forward, reverse, rtol=1e-12, atol=1e-12)
    steps = 1e-6 * jnp.diag(numbers)
    batch = jax.jit(jax.vmap(forces))
    both = batch(rows + steps) - batch(rows - steps)
    np.testing.assert_allclose(forward * rows, both.T / 2e-6, rtol=1e-5, atol=1e-3)


@pytest.mark.slow
def test_it_limits_the_stroke_of_a_quarter_car():
    law = Linear(1200.0) + BumpStop(0.02, 60e3, 3e8, 400.0, end="both")

    def force(x, v):
        u = abs(x) - 0.02
        d = 0.0 if u < 0 else (u * u / 2e-3 if u < 1e-3 else u - 5e-4)
        push = 60e3 * d + 3e8 * d**3 + 400.0 * min(max(u / 1e-3, 0.0), 1.0) * np.sign(x) * v
        return 1200.0 * v + np.sign(x) * max(push, 0.0)

    found, expected = simulated_and_integrated(law, force, amplitude=0.03, frequency=1.5)
    assert np.max(expected) > 0.025 and np.min(expected) < -0.025
    np.testing.assert_allclose(found, expected, atol=3e-3 * np.max(np.abs(expected)))


def test_single_precision():
    with jax.enable_x64(False):
        law = BumpStop(0.04, 50e3, 2e8, 300.0, end="both")
        x = jnp.array([-1e3, -0.041, -0.04, 0.0, 0.04, 0.05, 1e3])
        force, slope = jax.jit(jax.vmap(jax.value_and_grad(lambda x: law.force(x, -1.0, law.initial_state()))))(x)
    assert force.dtype == jnp.float32
    assert np.all(np.isfinite(force)) and np.all(np.isfinite(slope))


def test_refusals():
    with pytest.raises(ValueError, match=r"`end` must be one of .* but is 'rebond'. Did you mean 'rebound'"):
        BumpStop(0.04, 50e3, end="rebond")
    with pytest.raises(ValueError, match=r"`BumpStop\.engagement_width` must be positive"):
        BumpStop(0.04, 50e3, engagement_width=0.0)
