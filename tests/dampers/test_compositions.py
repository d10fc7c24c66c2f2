"""Sums, factors, motion ratios, friction and the guesses that several laws share."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.dampers import (
    Besinger,
    Bilinear,
    CoulombFriction,
    Lag,
    Linear,
    MotionRatio,
    PiecewiseLinear,
    PowerLaw,
    Scaled,
    SeriesSpring,
    Sum,
    Table,
)


def test_a_linear_damper_acts_at_the_wheel_with_the_square_of_the_ratio():
    law = MotionRatio(Linear(2000.0), 0.7)
    np.testing.assert_allclose(law.force(0.0, 0.3, law.initial_state()), 0.49 * 2000.0 * 0.3, rtol=1e-14)


def test_a_motion_ratio_keeps_power():
    inner, ratio = SeriesSpring(Bilinear(2600.0, 1200.0), 4e5), 0.8
    t = np.linspace(0.0, 0.5, 501)
    x, v = 0.02 * np.sin(20 * t), 0.4 * np.cos(20 * t)
    wheel = respond(MotionRatio(inner, ratio), t, x, v)
    damper = respond(inner, t, ratio * x, ratio * v)
    np.testing.assert_allclose(wheel * v, damper * (ratio * v), rtol=1e-12, atol=1e-9)


def test_sums_are_flat_and_add():
    law = Linear(1000.0) + Lag(Linear(500.0), 0.01) + (Bilinear(300.0, 200.0) + CoulombFriction(40.0, 0.01))
    assert isinstance(law, Sum) and len(law.terms) == 4
    t = np.linspace(0.0, 0.5, 501)
    x, v = 0.02 * np.sin(20 * t), 0.4 * np.cos(20 * t)
    parts = [respond(term, t, x, v) for term in law.terms]
    np.testing.assert_allclose(respond(law, t, x, v), sum(parts), rtol=1e-12, atol=1e-9)


def test_factors_from_both_sides():
    for law in (2.0 * Linear(100.0), Linear(100.0) * 2.0):
        assert isinstance(law, Scaled)
        np.testing.assert_allclose(law.force(0.0, 1.5, law.initial_state()), 300.0, rtol=1e-14)


def test_what_is_no_law_does_not_add():
    with pytest.raises(TypeError, match="unsupported operand"):
        Linear(1.0) + 5.0  # type: ignore[operator]
    with pytest.raises(TypeError, match="unsupported operand"):
        assert Linear(1.0) * Linear(1.0)  # type: ignore[operator]
    with pytest.raises(ValueError, match="`terms` must hold at least one law"):
        Sum(())


def test_friction_reaches_its_force():
    law = CoulombFriction(40.0, 0.002)
    np.testing.assert_allclose(law.force_velocity(0.004), 40.0 * np.tanh(2.0), rtol=1e-14)
    assert 0.96 < np.tanh(2.0) < 0.97


def test_linear_guess_is_least_squares_through_the_origin():
    v = np.array([-1.0, 0.5, 2.0])
    np.testing.assert_allclose(Linear.guess(v, 1500.0 * v).rate, 1500.0, rtol=1e-14)


@pytest.mark.parametrize("kind", [Besinger, Bilinear, CoulombFriction, Linear, PiecewiseLinear, PowerLaw, Table])
@pytest.mark.parametrize("low", [-1.0, 0.05])
def test_every_guess_is_a_law_near_its_data(kind, low):
    v = np.linspace(low, 1.0, 300)
    force = np.where(v > 0, 2500.0, 1200.0) * np.tanh(v)
    law = kind.guess(v, force)
    found = np.asarray(jax.jit(jax.vmap(law.force_velocity))(jnp.asarray(v)))
    assert np.sqrt(np.mean((found - force) ** 2)) < (0.7 if kind is CoulombFriction else 0.35) * np.abs(force).max()


def test_a_negative_factor_must_be_asked_for():
    with pytest.raises(ValueError, match=r"`factor` must not be negative, but is -2.0.*allow_active=True"):
        _ = -2.0 * Linear(1500.0)
    law = Scaled(Linear(1500.0), -2.0, allow_active=True)
    assert float(law.force(0.0, 1.0, law.initial_state())) == -3000.0
    assert "allow_active=True" in repr(law)
