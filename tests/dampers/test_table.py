import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.dampers import SplineTable, Table


VELOCITY = [-1.1, -0.4, -0.1, 0.0, 0.05, 0.3, 1.0]
FORCE = [-1400.0, -800.0, -450.0, 10.0, 300.0, 1500.0, 2900.0]


def test_straight_lines_between_the_points():
    v = np.linspace(-1.1, 1.0, 211)
    found = jax.jit(jax.vmap(Table(VELOCITY, FORCE).force_velocity))(jnp.asarray(v))
    np.testing.assert_allclose(found, np.interp(v, VELOCITY, FORCE), rtol=1e-11, atol=1e-9)


def test_end_slopes_go_on():
    law = Table(VELOCITY, FORCE)
    np.testing.assert_allclose(law.force_velocity(1.7), 2900.0 + 0.7 * 2000.0, rtol=1e-12)
    np.testing.assert_allclose(law.force_velocity(-1.8), -1400.0 - 0.7 * 600.0 / 0.7, rtol=1e-12)


def test_two_points_are_a_line():
    np.testing.assert_allclose(Table([-1.0, 1.0], [-500.0, 700.0]).force_velocity(0.5), 400.0, rtol=1e-12)


def test_guess_goes_through_its_data():
    v = np.linspace(-1.0, 1.0, 801)
    force = 900.0 * np.tanh(4.0 * v) + 500.0 * v
    found = jax.jit(jax.vmap(Table.guess(v, force, points_a_side=10).force_velocity))(jnp.asarray(v))
    assert np.max(np.abs(found - force)) < 10.0


@pytest.mark.parametrize(
    ("velocity", "force", "message"),
    [
        ([0.0, 1.0], [1.0, 2.0, 3.0], "`force` must hold two or more points, one force for each velocity"),
        ([0.0], [1.0], "`force` must hold two or more points"),
        ([1.0, 0.0], [1.0, 2.0], r"`Table\.velocity` must be strictly increasing"),
        ([0.0, 1.0], [1.0, np.inf], r"`Table\.force_points` must be finite"),
    ],
)
def test_refusals(velocity, force, message):
    with pytest.raises(ValueError, match=message):
        Table(velocity, force)


@pytest.mark.parametrize("law", [Table, SplineTable])
def test_points_that_drive_the_motion_are_refused(law):
    with pytest.raises(ValueError, match=r"`force` must resist the motion.*900 N at -1 m/s, 1 of 3 points"):
        law([-1.0, 0.0, 1.0], [900.0, 0.0, 900.0])
    assert float(law([-1.0, 0.0, 1.0], [900.0, 0.0, 900.0], allow_active=True).force_velocity(-1.0)) == 900.0


def test_gas_force_and_scatter_near_rest_are_not_active():
    Table([-1.0, 0.0, 1.0], [-900.0, -200.0, 700.0])
    Table([-1.0, -0.01, 0.0, 1.0], [-900.0, 20.0, 0.0, 900.0])
