import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from jaxdamp.dampers import PiecewiseLinear


@eqx.filter_jit
def forces(law, v):
    return jax.vmap(law.force_velocity)(v)


@eqx.filter_jit
def slopes_at(law, v):
    return jax.vmap(jax.grad(law.force_velocity))(v)


SLOPES = arrays(np.float64, 4, elements=st.floats(1.0, 1e4))


@settings(max_examples=25, deadline=None)
@given(slopes=SLOPES, width=st.sampled_from([0.0, 0.005, 0.1]))
def test_positive_slopes_make_the_force_increase(slopes, width):
    law = PiecewiseLinear([-0.3, 0.05, 0.4], slopes, width)
    force = np.asarray(forces(law, jnp.linspace(-2.0, 2.0, 401)))
    assert np.all(np.diff(force) > 0)
    np.testing.assert_allclose(law.force_velocity(0.0), 0.0, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(slopes=SLOPES)
def test_slopes_between_the_knots(slopes):
    law = PiecewiseLinear([-0.3, 0.05, 0.4], slopes)
    found = slopes_at(law, jnp.array([-1.0, -0.1, 0.2, 1.0]))
    np.testing.assert_allclose(found, slopes, rtol=1e-9)


def test_rounded_knees_differ_by_the_width_at_most():
    sharp, rounded = (PiecewiseLinear([-0.2, 0.2], [500.0, 2000.0, 800.0], w) for w in (0.0, 0.02))
    v = jnp.linspace(-1.0, 1.0, 501)
    error = forces(rounded, v) - forces(sharp, v)
    assert np.max(np.abs(error)) <= 2 * 1500.0 * 0.02 * np.log(2)


def test_guess_fits_a_curve_with_knees():
    v = np.linspace(-1.0, 1.0, 401)
    force = np.where(np.abs(v) > 0.1, np.sign(v) * (200.0 + 800.0 * (np.abs(v) - 0.1)), 2000.0 * v)
    law = PiecewiseLinear.guess(v, force)
    found = forces(law, jnp.asarray(v))
    assert np.sqrt(np.mean((found - force) ** 2)) < 0.02 * np.abs(force).max()


@pytest.mark.parametrize(
    ("knots", "slopes", "message"),
    [
        ([0.1, -0.1], [1.0, 2.0, 3.0], r"`PiecewiseLinear\.knots` must be strictly increasing"),
        ([0.1], [1.0, 2.0, 3.0], r"`slopes` must have one entry more than `knots`, but is of shape \(3,\)"),
        ([0.1], [1.0, -2.0], r"`PiecewiseLinear\.slopes` must be positive \[N s/m\], but is \[ 1\. -2\.\]"),
        ([0.1], [1.0, np.nan], r"`PiecewiseLinear\.slopes` must be finite, but is \[ 1\. nan\]"),
    ],
)
def test_refusals(knots, slopes, message):
    with pytest.raises(ValueError, match=message):
        PiecewiseLinear(knots, slopes)
