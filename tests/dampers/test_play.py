"""The law of Karadayi and Masada as a case, a mono-tube, the derivative by the clearance, laws that are refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import respond
from jaxdamp.dampers import Bilinear, CoulombFriction, KaradayiMasada, Lag, Linear, MonoTube, Play, Saturating
from jaxdamp.parameters import with_values
from jaxdamp.rig import march

from .motions import last_cycle


DASHPOT = Bilinear(2600.0, 1200.0) + CoulombFriction(40.0, 0.01)


def test_around_a_dashpot_with_friction_it_is_the_law_of_karadayi_and_masada():
    one = last_cycle(Play(DASHPOT, 6e5, 3e-4), 9.0, 0.01, samples=300)[2]
    two = last_cycle(KaradayiMasada(2600.0, 1200.0, 40.0, 0.01, 6e5, 3e-4), 9.0, 0.01, samples=300)[2]
    np.testing.assert_array_equal(one, two)


@pytest.mark.slow
def test_around_a_mono_tube_it_agrees_with_another_solver():
    law = Play(MonoTube.reference() + Linear(20.0), stiffness=4e6, clearance=1e-4)
    t = np.linspace(0.0, 1 / 12, 301)
    x, v = 0.006 * (1 - np.cos(24 * np.pi * t)), 0.144 * np.pi * np.sin(24 * np.pi * t)

    @jax.jit
    def rate(t, state):
        return law.state_rate(0.006 * (1 - jnp.cos(24 * np.pi * t)), 0.144 * np.pi * jnp.sin(24 * np.pi * t), state)

    rest = np.asarray(law.state_at_rest(0.0))
    solved = solve_ivp(rate, (0.0, t[-1]), rest, "LSODA", t, rtol=1e-8, atol=1e-12, max_step=1e-3)
    expected = jax.jit(jax.vmap(law.force))(jnp.asarray(x), jnp.asarray(v), jnp.asarray(solved.y.T))
    error = respond(law, t, x, v) - expected
    assert jnp.sqrt(jnp.mean(error**2)) < 3e-4 * jnp.max(jnp.abs(expected))


@pytest.mark.parametrize("name", ["clearance", "stiffness"])
def test_derivatives_agree_with_differences(name):
    t = np.linspace(0.0, 0.4, 801)
    x, v = jnp.asarray(0.005 * np.sin(20 * t)), jnp.asarray(0.1 * np.cos(20 * t))
    law = Play(DASHPOT, 6e5, 3e-4)

    @jax.jit
    def energy(value):  # an integral, since single samples jump where the clearance ends
        return jnp.sum(march(with_values(law, {name: value}), jnp.asarray(5e-4), x, v, 1) * v) * 5e-4

    value = getattr(law, name)
    small = 1e-3 * value
    slope = jax.jit(jax.grad(energy))(value)
    np.testing.assert_allclose(slope, (energy(value + small) - energy(value - small)) / (2 * small), rtol=1e-2)


def test_a_law_whose_force_is_a_state_needs_damping_beside_it():
    with pytest.raises(ValueError, match=r"depends directly on the velocity, but is a Lag.*`Lag\(Play\(law\)\)`"):
        Play(Lag(Linear(2000.0), 0.004), 1e6, 3e-4)
    Play(Lag(Linear(2000.0), 0.004) + Linear(50.0), 1e6, 3e-4)


@pytest.mark.parametrize("stiffness", [1.5e7, 1e9])
def test_forces_and_derivatives_are_finite_around_a_law_that_levels_off(stiffness):
    """The law's force levels off within a fraction of a millimetre per second; the contact is far stiffer."""
    t = np.linspace(0.0, 0.5, 251)
    x, v = jnp.asarray(0.02 * np.sin(4 * np.pi * t)), jnp.asarray(0.08 * np.pi * np.cos(4 * np.pi * t))
    values = jnp.array([18_000.0, 79_000.0, 4.8, 1.6e5, stiffness, 2.9e-3])

    def force(values):
        return march(Play(Saturating(*values[:4]), *values[4:]), jnp.asarray(2e-3), x, v, 1)

    assert np.all(np.isfinite(jax.jit(jax.jacfwd(force))(values)))
    if stiffness == 1e9:  # the contact has let go at once
        inside = np.asarray(jax.jit(force)(values))[(t > 0.13) & (t < 0.145)]
        assert np.all(inside == 0.0)
