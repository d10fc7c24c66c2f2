"""Second derivatives over a loop: forward over reverse, as `jax.hessian` takes them, forward over forward, differences.

Reverse mode over a loop forgets custom derivatives where it keeps values, so that forward over reverse can go wrong
where all first derivatives and forward over forward are right. Several laws stand side by side, so that few programs
are compiled.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, roads
from jaxdamp.dampers import BoucWen, Degressive, GasSpring, Linear, PowerLaw, SeriesSpring, Sum
from jaxdamp.parameters import free_parameters
from jaxdamp.rig import march
from jaxdamp.vehicles import QuarterCar, static_equilibrium
from jaxdamp.vehicles.presets import quarter_car_000

from .test_contract import FURTHER, LAWS


NAMES = list(LAWS)
GROUPS = [NAMES[i : i + 6] for i in range(0, len(NAMES), 6)]
KINDS = [name for name in NAMES if name not in FURTHER]  # every kind, without further examples of one
KIND_GROUPS = [KINDS[i : i + 6] for i in range(0, len(KINDS), 6)]
DT, STEPS = 1e-3, 80
TIME = DT * np.arange(STEPS + 1)
STROKE = 0.01 * np.sin(25.0 * TIME) + 0.004 * np.sin(71.0 * TIME + 0.3)
VELOCITY = 0.25 * np.cos(25.0 * TIME) + 0.284 * np.cos(71.0 * TIME + 0.3)


def bench(law):
    """Mean square of the force on the bench."""
    x, v = jnp.asarray(STROKE), jnp.asarray(VELOCITY)
    return jnp.mean(march(law, jnp.asarray(DT), x, v, 1) ** 2)


def ride(law):
    """Mean square of the acceleration of a car over a bump."""
    road = roads.cosine_bump(0.03, start=0.0, duration=0.06)
    driven = Ride(quarter_car_000(law), road, metrics=["rms_sprung_acceleration"], duration=STEPS * DT, substeps=1)
    return driven()["rms_sprung_acceleration"] ** 2


def function_of_shares(quantity, law):
    """The quantity, of a law whose numbers are changed by shares (those that are zero by units), and how many."""
    free = free_parameters(law)
    scale = jnp.where(free.values != 0.0, jnp.abs(free.values), 1.0)
    return lambda shares: quantity(free.build(free.values + shares * scale)), free.values.size


def second_derivatives(function, count, rng):
    """The Hessian times a direction, forward over reverse and forward over forward; and the direction."""
    at, way = jnp.zeros(count), jnp.asarray(rng.uniform(0.3, 1.0, count) * rng.choice([-1.0, 1.0], count))
    gradient = jax.grad(function)
    reverse = jax.jit(lambda at: jax.jvp(gradient, (at,), (way,))[1])(at)
    forward = jax.jit(jax.jacfwd(lambda at: jax.jvp(function, (at,), (way,))[1]))(at)
    return np.asarray(reverse), np.asarray(forward), way


def differences(function, way, step=1e-6):
    """The same from differences of the gradient, of fourth order, so short that no instant crosses a kink."""
    slope, at = jax.jit(jax.grad(function)), jnp.zeros_like(way)
    near, far = (slope(at + k * step * way) - slope(at - k * step * way) for k in (1, 2))
    return np.asarray(8.0 * near - far) / (12.0 * step)


def assert_agree(quantity, names, rng, *, with_differences=True):
    law = Sum(tuple(0.3 * LAWS[name]() for name in names))
    function, count = function_of_shares(quantity, law)
    reverse, forward, way = second_derivatives(function, count, rng)
    size = np.max(np.abs(forward))
    assert np.isfinite(size) and size > 0.0
    # where hysteresis saturates, second derivatives are made of small differences
    np.testing.assert_allclose(reverse / size, forward / size, atol=1e-7)
    if with_differences:
        np.testing.assert_allclose(forward / size, differences(function, way) / size, atol=1e-5)


@pytest.mark.exhaustive
def test_powers_and_limits_on_the_bench(rng):
    assert_agree(bench, ["Bouc and Wen", "power 0.4, offsets", "bump stop"], rng)


@pytest.mark.exhaustive
@pytest.mark.parametrize("names", GROUPS[:6], ids=lambda names: f"{names[0]} to {names[-1]}")
def test_every_law_on_the_bench(names, rng):
    assert_agree(bench, names, rng)


@pytest.mark.exhaustive
@pytest.mark.parametrize("names", KIND_GROUPS[:2], ids=lambda names: f"{names[0]} to {names[-1]}")
def test_every_kind_of_law_in_a_ride(names, rng):
    assert_agree(ride, names, rng, with_differences=False)


@pytest.mark.slow
def test_a_hessian_of_a_ride_by_names():
    """As a user writes it: `jax.hessian` of a metric by paths of the vehicle, against differences of its gradient."""
    car = quarter_car_000(BoucWen(800.0, 2000.0, 300.0, 1e-3) + PowerLaw(900.0, 0.6, 700.0, 0.7))
    driven = Ride(
        car, roads.cosine_bump(0.03, start=0.0, duration=0.06), metrics=["rms_sprung_acceleration"], duration=0.08
    )
    paths = ["damper.terms.0.viscous_rate", "damper.terms.0.yield_displacement", "damper.terms.1.rebound_exponent"]
    values = np.array([800.0, 1e-3, 0.6])

    def metric(shares):
        return driven({p: v * (1.0 + shares[i]) for i, (p, v) in enumerate(zip(paths, values, strict=True))})[
            "rms_sprung_acceleration"
        ]

    hessian = np.asarray(jax.jit(jax.hessian(metric))(jnp.zeros(3)))
    np.testing.assert_allclose(hessian, hessian.T, rtol=1e-9, atol=1e-12)
    slope, steps = jax.jit(jax.grad(metric)), 1e-4 * np.eye(3)
    expected = [(slope(jnp.asarray(s)) - slope(jnp.asarray(-s))) / 2e-4 for s in steps]
    np.testing.assert_allclose(hessian, expected, rtol=1e-4, atol=1e-6 * np.max(np.abs(hessian)))


def test_of_a_root_that_few_steps_find(rng):
    """A slow motion, in which the first guess is so near that one Newton step does."""
    law = SeriesSpring(Degressive(98_727.9, 4.77954, 52_526.6, 3.0), 5e5)
    x, v = jnp.asarray(0.02 * np.sin(6.0 * TIME)), jnp.asarray(0.12 * np.cos(6.0 * TIME))
    function, count = function_of_shares(lambda law: jnp.mean(march(law, jnp.asarray(DT), x, v, 1) ** 2), law)
    reverse, forward, _ = second_derivatives(function, count, rng)
    np.testing.assert_allclose(reverse, forward, rtol=0.0, atol=1e-11 * np.max(np.abs(forward)))


@pytest.mark.slow
def test_of_where_a_vehicle_comes_to_rest():
    """A gas spring's equilibrium k z = F(z): z″ by its pressure from differences of the first derivative."""

    def height(share):
        spring = GasSpring(2e6 * (1.0 + share), 6e-5, 1e-4)
        return static_equilibrium(QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(1500.0), extra_spring=spring))["z_sprung"]

    slope, h = jax.jit(jax.grad(height)), 1e-3
    expected = float(slope(h) - slope(-h)) / (2.0 * h)
    assert abs(expected) > 1e-6
    for second in (jax.hessian, lambda f: jax.jacfwd(jax.jacfwd(f))):
        assert float(jax.jit(second(height))(0.0)) == pytest.approx(expected, rel=1e-5)
