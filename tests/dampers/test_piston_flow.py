"""Orifice and valves against the printed equations, solved by bisection in the pressure."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import root_scalar

from jaxdamp.dampers import PistonFlow
from jaxdamp.dampers.piston_flow import orifice_drop

from .single_precision import single_precision_error


AREA, BLEED, LEAK, TRANSITION = 1.42e-3, 1.6e-6, 2e-13, 1e3
REBOUND, COMPRESSION = (1.2e6, 1.2e11, 2.5e-5), (5e5, 4e10, 4e-5)
LAW = PistonFlow(AREA, BLEED, *REBOUND, *COMPRESSION, leak=LEAK)


def flow(drop, leak=LEAK, transition=TRANSITION):
    """Oil [m³/s] through the piston at a pressure drop [Pa], as in the paper."""
    opening, stiffness, largest = REBOUND if drop > 0 else COMPRESSION
    valve = largest * np.tanh(max(abs(drop) - opening, 0.0) / (stiffness * largest))
    root = drop / (drop**2 + transition**2) ** 0.25
    return 0.7 * np.sqrt(2 / 850.0) * (BLEED + valve) * root + leak * drop


@pytest.mark.parametrize("leak", [0.0, LEAK, 1e-11])
def test_the_drop_drives_the_flow_that_the_piston_displaces(leak):
    law = PistonFlow(AREA, BLEED, *REBOUND, *COMPRESSION, leak=leak)
    speeds = np.geomspace(1e-6, 30.0, 60)
    v = np.concatenate([-speeds, speeds])

    def drop(w):
        found = root_scalar(lambda drop: flow(drop, leak) - AREA * w, bracket=(-1e13, 1e13), xtol=1e-14, rtol=1e-14)
        return found.root

    force = jax.jit(jax.vmap(law.force_velocity))(jnp.asarray(v))
    np.testing.assert_allclose(force, [AREA * drop(w) for w in v], rtol=1e-9)


def test_orifice_alone():
    law = PistonFlow(AREA, BLEED, 1e9, 1e11, 1e-5, 1e9, 1e11, 1e-5)
    # Δp = ρ/2 (A v/(C_d A_b))², but for the transition, (ε/Δp)²/2 of it
    v = np.array([0.05, 0.3])
    expected = AREA * 425.0 * (AREA * v / (0.7 * BLEED)) ** 2
    np.testing.assert_allclose(jax.jit(jax.vmap(law.force_velocity))(v), expected, rtol=1e-5)
    slope = jax.jit(jax.grad(law.force_velocity))(0.0)
    np.testing.assert_allclose(slope, AREA**2 * np.sqrt(TRANSITION) / (0.7 * BLEED * np.sqrt(2 / 850.0)), rtol=1e-10)


@pytest.mark.parametrize("direction", ["rebound", "compression"])
def test_one_valve_for_each_direction(direction):
    """It changes the force of its direction only, and only above its opening pressure."""
    side, opening = (1.0, REBOUND[0]) if direction == "rebound" else (-1.0, COMPRESSION[0])
    knee = flow(side * opening) / AREA
    name = f"{direction}_valve_stiffness"

    def force(stiffness, v):
        return eqx.tree_at(lambda law: getattr(law, name), LAW, stiffness).force_velocity(v)

    v = jnp.array([-0.4, 0.99 * knee, 1.2 * knee, 0.4])
    slope = np.asarray(jax.jit(jax.vmap(jax.grad(force), (None, 0)))(1e11, v))
    opened = np.array([side < 0, False, True, side > 0])
    np.testing.assert_array_equal(slope != 0.0, opened)
    assert np.all(slope[opened] * side > 0.0)


def test_it_settles_for_hard_cases():
    """Valves that open within a thousandth of their opening pressure, or hardly; leaks from none to all of the flow.

    The force is found to about 1e-3 in the worst of 100 000 points, and to rounding in all but a few.
    """
    rng = np.random.default_rng(5)

    def spread(low, high):
        return np.exp(rng.uniform(np.log(low), np.log(high), 500))

    ranges = [(1e-4, 5e-3), (1e-7, 2e-5), *2 * [(1e4, 5e6), (1e9, 1e13), (1e-6, 2e-4)], (1e-16, 1e-10)]
    laws = jax.vmap(PistonFlow)(*[jnp.asarray(spread(*limits)) for limits in ranges])
    v = jnp.concatenate([-jnp.geomspace(1e-6, 10.0, 100), jnp.geomspace(1e-6, 10.0, 100)])

    def back(law, v):
        force = law.force_velocity(v)
        drop = force / law.area
        found = law.flow_velocity(law.root(drop), law.passages(drop >= 0))
        slope = jax.grad(law.force_velocity)(v)
        return (found - v) * slope / force

    error = np.abs(jax.jit(jax.vmap(lambda law: jax.vmap(lambda v: back(law, v))(v)))(laws))
    assert np.max(error) < 3e-3
    assert np.mean(error > 1e-9) < 1e-4


def test_the_slopes_of_the_pressure_drop_are_those_of_its_formula():
    def plain(root, transition):
        square = root * root
        return root * jnp.sqrt(0.5 * (square + jnp.sqrt(square * square + 4.0 * transition * transition)))

    def slopes(function):
        """First and second ones in both places, in both modes, at each root."""
        ways = [(mode, place) for mode in (jax.jacfwd, jax.jacrev) for place in (0, 1)]
        first = [mode(function, place) for mode, place in ways]
        second = [mode(slope, place) for slope, (mode, place) in zip(first, ways, strict=True)]
        at_one = lambda root: [jnp.stack([slope(root, TRANSITION) for slope in each]) for each in (first, second)]  # noqa: E731
        return jax.jit(jax.vmap(at_one))(jnp.array([-2e3, -30.0, 0.0, 1e-3, 31.0, 1500.0]))

    (first, second), (exact_first, exact_second) = slopes(orifice_drop), slopes(plain)
    np.testing.assert_allclose(first, exact_first, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(second, exact_second, rtol=1e-10, atol=1e-12)


def test_single_precision():
    assert single_precision_error(lambda: PistonFlow(AREA, BLEED, *REBOUND, *COMPRESSION, leak=LEAK)) < 1e-5


def test_no_bleed_is_refused():
    with pytest.raises(ValueError, match=r"`PistonFlow\.bleed_area` must be positive"):
        PistonFlow(AREA, 0.0, *REBOUND, *COMPRESSION)
