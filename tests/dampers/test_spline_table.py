"""SciPy's PCHIP as the reference; finite derivatives where neighbouring slopes vanish or change sign."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import SplineTable, Table
from jaxdamp.identify import fit

from .cars import simulated_and_integrated
from .single_precision import single_precision_error


VELOCITY = np.array([-1.0, -0.4, -0.1, 0.0, 0.05, 0.3, 1.0])
FORCE = np.array([-1900.0, -1150.0, -450.0, 0.0, 300.0, 1500.0, 3300.0])
# neighbouring secants zero, of opposite sign, equal; falling curves; no slope anywhere; two points
AWKWARD = {
    "flat beside rising": [-500.0, -500.0, -300.0, 0.0, 0.0, 0.0, 700.0],
    "up and down": [300.0, -200.0, 400.0, 0.0, 100.0, -50.0, 60.0],
    "straight": (1500.0 * VELOCITY).tolist(),
    "nothing": [0.0] * 7,
    "two points": [-1400.0, 2900.0],
    "three points": [-1400.0, 0.0, 0.0],
}


def places(forces):
    return VELOCITY[np.linspace(0, 6, len(forces)).astype(int)]


@jax.jit
def _curve(law, v):
    return jax.vmap(law.force_velocity)(v)


def curve(law, v):
    return np.asarray(_curve(law, jnp.asarray(v)))


@pytest.mark.parametrize("name", ["plain", *AWKWARD])
def test_equals_pchip(name):
    forces = np.array(AWKWARD.get(name, FORCE))
    velocity = places(forces)
    v = np.linspace(velocity[0], velocity[-1], 2001)
    expected = PchipInterpolator(velocity, forces)(v)
    np.testing.assert_allclose(
        curve(SplineTable(velocity, forces, allow_active=True), v), expected, rtol=1e-12, atol=1e-12 * 3300.0
    )


def test_random_tables_equal_pchip(rng):
    for count in (3, 5, 9):
        velocity = np.cumsum(rng.uniform(0.01, 0.5, count)) - 1.0
        forces = rng.choice([0.0, 500.0, -500.0], count) + rng.choice([0.0, 1.0], count) * rng.normal(size=count)
        v = rng.uniform(velocity[0], velocity[-1], 500)
        expected = PchipInterpolator(velocity, forces)(v)
        law = SplineTable(velocity, forces, allow_active=True)
        np.testing.assert_allclose(curve(law, v), expected, atol=1e-12 * 500.0)


def test_no_overshoot_and_a_continuous_slope():
    law = SplineTable(VELOCITY, FORCE)
    v = np.linspace(-1.2, 1.2, 4001)
    force = curve(law, v)
    assert np.all(np.diff(force) > 0)
    inside = (v >= -1) & (v <= 1)
    low = np.interp(v[inside], VELOCITY, np.arange(7)).astype(int).clip(0, 5)
    assert np.all((force[inside] >= FORCE[low] - 1e-9) & (force[inside] <= FORCE[low + 1] + 1e-9))
    slope = jax.jit(jax.vmap(jax.grad(law.force_velocity)))
    for beside in (-1e-9, 0.0, 1e-9):
        np.testing.assert_allclose(slope(VELOCITY + beside), slope(VELOCITY), rtol=1e-5)


def test_end_slopes_go_on():
    law = SplineTable(VELOCITY, FORCE)
    reference = PchipInterpolator(VELOCITY, FORCE).derivative()(VELOCITY[[0, -1]])
    np.testing.assert_allclose(curve(law, [-3.0, 2.5]), FORCE[[0, -1]] + reference * [-2.0, 1.5], rtol=1e-12)
    assert np.all(reference > 0)


@jax.jit
def derivatives(velocity, forces, v):
    """Forward and reverse derivatives in the forces and in the velocity, a row for each velocity."""

    def value(forces, v):
        return SplineTable(velocity, forces).force_velocity(v)

    return [jax.vmap(mode(value, argnums=(0, 1)), (None, 0))(forces, v) for mode in (jax.jacfwd, jax.jacrev)]


@pytest.mark.parametrize("name", ["plain", *AWKWARD])
def test_derivatives_are_finite(name):
    forces = np.array(AWKWARD.get(name, FORCE))
    velocity = places(forces)
    v = np.concatenate([velocity, [-5.0, 0.02, 5.0, 1e3]])
    for found in derivatives(velocity, forces, v):
        assert all(np.all(np.isfinite(a)) for a in found)
        # the curve goes through the points whatever they are: there it moves with that point's force alone
        np.testing.assert_allclose(found[0][: forces.size], np.eye(forces.size), atol=1e-12)


def test_derivatives_in_the_forces_are_those_of_pchip():
    v, step = np.linspace(-0.99, 0.99, 57), 1e-3

    def pchip(forces):
        return PchipInterpolator(VELOCITY, forces)(v)

    expected = [(pchip(FORCE + e) - pchip(FORCE - e)) / (2 * step) for e in step * np.eye(7)]
    found = derivatives(VELOCITY, FORCE, v)[0][0]
    np.testing.assert_allclose(found, np.transpose(expected), atol=1e-7)


def test_guess_is_closer_than_straight_lines():
    v = np.linspace(-0.9, 1.1, 4000)
    force = 1200.0 * np.tanh(6.0 * v) + 600.0 * v
    errors = [np.sqrt(np.mean((curve(kind.guess(v, force), v) - force) ** 2)) for kind in (SplineTable, Table)]
    assert errors[0] < 0.7 * errors[1] < 10.0


def test_fit_recovers_the_forces():
    t = np.arange(2000) / 1000
    x, v = 0.05 * np.sin(20.0 * t), np.cos(20.0 * t)
    rng = np.random.default_rng(3)
    run = BenchRun("sine", t, x, v, PchipInterpolator(VELOCITY, FORCE)(v) + 5.0 * rng.standard_normal(t.size))
    result = fit(SplineTable(VELOCITY, 1500.0 * VELOCITY), run)
    assert result.converged
    errors = np.array([e.standard_error for e in result.parameters])
    assert np.all(errors < 5.0)
    assert np.all(np.abs(np.array([e.value for e in result.parameters]) - FORCE) < 4 * errors)


@pytest.mark.exhaustive
def test_quarter_car():
    pchip = PchipInterpolator(VELOCITY, FORCE)
    found, expected = simulated_and_integrated(
        SplineTable(VELOCITY, FORCE), lambda x, v: float(pchip(v)), amplitude=0.03, frequency=1.5, duration=1.0
    )
    assert np.ptp(expected) > 0.03
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.max(np.abs(expected)))


def test_single_precision():
    assert single_precision_error(lambda: SplineTable(VELOCITY.tolist(), FORCE.tolist())) < 1e-5


@pytest.mark.parametrize(
    ("velocity", "force", "message"),
    [
        ([0.0], [0.0], "`force` must hold two or more points"),
        ([0.0, 1.0], [0.0, 1.0, 2.0], "`force` must hold two or more points, one force for each velocity"),
        ([0.0, 0.0], [0.0, 1.0], r"`SplineTable\.velocity` must be strictly increasing"),
    ],
)
def test_refusals(velocity, force, message):
    with pytest.raises(ValueError, match=message):
        SplineTable(velocity, force)
