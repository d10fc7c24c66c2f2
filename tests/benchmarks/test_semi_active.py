"""The bounds of the benchmark of control: found by gradients, checked by trying everything; the C beside it."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.optimize

from benchmarks import control_speed, semi_active
from benchmarks.peers import c, problem
from jaxdamp import Ride, roads
from jaxdamp.control import Controlled, Skyhook


PERIOD, DURATION = 25e-3, 0.2  # eight commands
BUMP = roads.cosine_bump(0.05, start=0.02, length=1.5, speed=10.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", [semi_active.BODY, semi_active.TYRE])
def test_the_best_history_is_that_of_an_exhaustive_search(name):
    def ride(policy):
        vehicle = Controlled(semi_active.corner(), policy, **semi_active.FAST, still=1e-3, period=PERIOD)
        return Ride(vehicle, BUMP, metrics=[name], duration=DURATION)

    prescribed = ride(semi_active.Prescribed(jnp.zeros(9)))

    @jax.jit
    @jax.vmap
    def value(shares):
        changed = eqx.tree_at(lambda ride: ride.vehicle.policy.shares, prescribed, jnp.append(shares, 0.0))
        return changed()[name]

    shares, values = semi_active.best_history(BUMP, DURATION, name, starts=(0.1, 0.8), period=PERIOD)
    found = float(value(shares[None, :8])[0])
    assert found == pytest.approx(min(values), rel=1e-9)
    grid = np.array([*itertools.product([-2.0, 0.5, 3.0], repeat=8)])  # soft, half and hard
    tried = np.asarray(value(grid))
    assert found < tried.min()
    searched = scipy.optimize.differential_evolution(
        lambda x: np.asarray(value(jnp.asarray(x.T))),
        [(-2.0, 3.0)] * 8,
        vectorized=True,
        updating="deferred",
        rng=0,
        maxiter=150,
        popsize=16,
        tol=1e-8,
        polish=False,
    )
    assert found <= searched.fun * (1.0 + 1e-4)
    assert searched.fun < tried.min() and found > 0.99 * searched.fun
    assert found < float(ride(Skyhook(3000.0))()[name])


def test_the_active_car_is_that_of_its_equations():
    duration, policy = 0.4, semi_active.policies()["clipped LQR"]
    found = semi_active.active(BUMP, duration)
    time = np.arange(401) * semi_active.STEP
    heights = np.ravel(np.asarray(BUMP.height(jnp.asarray(time))))
    gains = [getattr(policy, name) for name in ("body_velocity", "wheel_velocity", "stroke", "tyre_deflection")]

    def rates(t, y):
        tyre = y[1] - np.interp(t, time, heights)
        force = float(np.dot(gains, [y[2], y[3], y[0] - y[1], tyre])) + 20e3 * (y[0] - y[1])
        return [y[2], y[3], -force / 400.0, (force - 250e3 * tyre) / 50.0]

    y = scipy.integrate.solve_ivp(
        rates, (0.0, duration), np.zeros(4), t_eval=time, rtol=1e-9, atol=1e-12, max_step=1e-3
    )
    body = [rates(t, state)[2] for t, state in zip(time, y.y.T, strict=True)]
    np.testing.assert_allclose(found.body, body, atol=1e-5 * np.abs(body).max())
    np.testing.assert_allclose(found.tyre, 250e3 * (y.y[1] - heights), atol=1e-2)


def test_the_bands_are_those_of_their_definition():
    time = np.arange(4000) * semi_active.STEP
    signal = 2.0 + 3.0 * np.sin(2.0 * np.pi * 3.0 * time) + 4.0 * np.cos(2.0 * np.pi * 8.0 * time)
    bands = semi_active.in_bands(signal)
    assert bands["0 to 5 Hz"] == pytest.approx(np.hypot(2.0, 3.0 * 0.5**0.5))
    assert bands["5 to 20 Hz"] == pytest.approx(4.0 * 0.5**0.5)
    assert bands["all"] == pytest.approx(np.sqrt(np.mean(signal**2)))


@pytest.mark.skipif(not c.available(), reason="gcc is not installed")
@pytest.mark.exhaustive
def test_skyhook_in_c_is_that_of_jaxdamp():
    heights, table = problem.heights("besinger", 1.0), control_speed.drawn(2)
    found = c.skyhook(table, heights, lag=control_speed.LAG)
    ride = control_speed.ride(heights)
    ours = [float(ride(dict(zip(control_speed.PATHS, row, strict=True)))[control_speed.BODY]) for row in table]
    np.testing.assert_allclose(found, ours, rtol=1e-12)
