"""Fits by any solver of optimistix, and a problem as a function in a JAX program."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import optimistix as optx
import pytest

from jaxdamp import dampers, identify
from jaxdamp.dampers import Besinger, PiecewiseLinear
from jaxdamp.parameters import parameters
from jaxdamp.solve import BoundedLevenbergMarquardt


BESINGER = Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
AWAY = Besinger(1500.0, 4000.0, 1000.0, 0.15, 0.04)
HOW: dict[str, Any] = {"rtol": 1e-9, "atol": 1e-9}


def apart(one, other):
    """Largest difference in standard errors."""
    pairs = zip(one.parameters, other.parameters, strict=True)
    return max(abs(a.value - b.value) / a.standard_error for a, b in pairs)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [optx.Dogleg(**HOW), optx.BFGS(**HOW)], ids=["dogleg", "bfgs"])
@pytest.mark.exhaustive_cases("bfgs")
def test_a_law_with_conditions_by_another_solver(sines, solver):
    runs = sines(BESINGER, noise=20.0)
    usual, other = identify.fit(AWAY, runs), identify.fit(AWAY, runs, solver=solver)
    assert other.status is identify.Status.CONVERGED and apart(usual, other) < 1e-3
    assert other.warnings == usual.warnings
    errors = np.sqrt(np.diag(usual.covariance))
    np.testing.assert_allclose((other.covariance - usual.covariance) / np.outer(errors, errors), 0.0, atol=1e-4)


def test_an_end_far_from_the_minimum_is_said(sines):
    """The solver calls itself successful after a first small step."""
    runs = sines(BESINGER, noise=20.0)
    found = identify.fit(AWAY, runs, starts=1)
    error = found["rebound_rate"].standard_error
    near = dataclasses.replace(BESINGER, rebound_rate=float(found.law.rebound_rate) + 6.0 * error)
    early = identify.fit(near, runs, solver=optx.Dogleg(rtol=0.5, atol=0.5), starts=1, force_noise=20.0)
    assert apart(found, early) > 1.0
    assert early.status is identify.Status.NO_BETTER_STEP and "rebound_rate" in early.warnings[0]
    assert not all(e.identified for e in early.law.standard_errors)


def test_orders_and_bounds_hold_by_construction(sines):
    start = PiecewiseLinear([-0.3, 0.05, 0.2], [1000.0, 1800.0, 3000.0, 900.0])
    how = {"bounds": {"knots": (-0.35, 0.25)}, "starts": 1}
    runs = sines(PiecewiseLinear([-0.3, 0.05, 0.2], [700.0, 1800.0, 3500.0, 900.0]), noise=20.0)
    result = identify.fit(start, runs, solver=optx.LevenbergMarquardt(**HOW), **how)
    assert apart(identify.fit(start, runs, **how), result) < 0.01
    assert np.all(np.diff(result.law.knots) > 0.0)


@pytest.mark.parametrize("solver", [optx.LevenbergMarquardt(**HOW), optx.GaussNewton(**HOW)], ids=["lm", "gn"])
def test_a_number_that_presses_against_its_bound_is_on_it(sines, solver):
    """The search stopped before it, or so far out that rounding put it on the bound: both counted as failures."""
    start, runs = dampers.Bilinear(3800.0, 1500.0), sines(dampers.Bilinear(4000.0, 1600.0), noise=20.0)
    how: dict[str, Any] = {"bounds": {"rebound_rate": (1000.0, 3900.0)}, "starts": 1}
    usual, other = (identify.fit(start, runs, solver=s, **how) for s in (None, solver))
    assert other.status is identify.Status.CONVERGED and other["rebound_rate"].note == "at a bound"
    assert apart(usual, other) < 0.1


def test_a_search_that_ends_on_a_bound_which_it_should_leave_says_so(sines):
    start, runs = dampers.Bilinear(4009.96, 1500.0), sines(dampers.Bilinear(4000.0, 1600.0), noise=20.0)
    how: dict[str, Any] = {"bounds": {"rebound_rate": (1000.0, 4010.0)}, "starts": 1}
    result = identify.fit(start, runs, solver=optx.GaussNewton(**HOW), **how)
    assert result.status is identify.Status.NO_STEP
    assert "start farther inside, or leave `solver` out" in result.warnings[0]


def test_a_search_that_leaves_the_domain_of_the_law_is_not_blamed_on_its_start(sines):
    runs = sines(dampers.Linear(1500.0) + dampers.CoulombFriction(40.0, 0.02), noise=5.0)
    result = identify.fit(BESINGER, runs, solver=optx.GaussNewton(**HOW), starts=1)
    assert result.status is identify.Status.NO_STEP and result["transition_velocity"].value > 0.0


@pytest.fixture
def unchecked():
    """Annotations are not checked, as in a user's program."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


def test_steps_tolerances_and_wrong_solvers(sines, unchecked):
    runs = sines(BESINGER, noise=20.0)
    short = identify.fit(AWAY, runs, solver=optx.Dogleg(**HOW), max_steps=2, starts=1)
    assert short.status is identify.Status.STEP_LIMIT and "did not converge" in short.warnings[0]
    loose = identify.fit(AWAY, runs, solver=BoundedLevenbergMarquardt(tolerance=0.3), starts=1)
    exact = identify.fit(AWAY, runs, solver=BoundedLevenbergMarquardt(tolerance=1e-6), starts=1)
    assert loose.steps < exact.steps and apart(exact, loose) < 0.3
    with pytest.raises(ValueError, match="Argument `solver` must be a least-squares solver or minimiser of optimistix"):
        identify.fit(AWAY, runs, solver=optx.Newton(**HOW))  # type: ignore[call-overload]


def test_a_linear_law_by_a_given_solver_is_that_of_the_closed_form(sines):
    runs = sines(dampers.Bilinear(2600.0, 1200.0), noise=5.0)
    direct, searched = (identify.fit(dampers.Bilinear, runs, solver=s) for s in (None, optx.GaussNewton(**HOW)))
    assert apart(direct, searched) < 1e-6 and searched.steps > direct.steps == 0


def test_a_problem_is_a_pytree_and_its_minimum_that_of_fit(sines):
    runs = sines(BESINGER, noise=20.0)
    problem, result = identify.prepare(AWAY, runs), identify.fit(AWAY, runs, starts=1)
    assert all(isinstance(leaf, (jax.Array, np.ndarray, float)) for leaf in jax.tree.leaves(problem))

    @jax.jit
    def both(problem, force):
        return problem.minimum(force), optx.least_squares(problem, problem.solver(), problem.start, force).stats

    values, stats = both(problem, problem.measured)
    errors = np.sqrt(np.diag(result.covariance))
    assert np.max(np.abs(values - np.array([p.value for p in result.parameters])) / errors) < 1e-9
    assert stats["num_steps"] == result.steps
    with pytest.raises(ValueError, match=r"and settings; for other forces, `jax.vmap\(problem.minimum\)\(forces\)`"):
        jax.tree.map(lambda *both: jnp.stack(both), problem, identify.prepare(AWAY, runs[:2]))
    assert np.all(np.isnan(problem.minimum(max_steps=2)))


def test_the_minimum_by_the_measured_force_also_at_a_bound(sines):
    runs = sines(BESINGER, noise=20.0)
    problem = identify.prepare(AWAY, runs, bounds={"rebound_rate": (2000.0, 4100.0)})
    along = problem.measured * jnp.cos(jnp.arange(problem.measured.size))

    @jax.jit
    def both(change):
        return jax.jvp(lambda h: problem.minimum(problem.measured + h * along, tolerance=1e-9), (change,), (1.0,))

    ends = [both(h)[0] for h in (1e-4, -1e-4)]
    slope = both(0.0)[1]
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / 2e-4, rtol=1e-5, atol=1e-9)
    names = [p.path for p in parameters(AWAY)]
    assert np.flatnonzero(np.abs(slope) < 1e-9).tolist() == [names.index("rebound_rate")]
