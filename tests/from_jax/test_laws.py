"""A fitted law in a user's own programs: optimistix, optax, flat vectors, branches, export, checkers."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import optimistix as optx
import pytest
from jax.flatten_util import ravel_pytree

from jaxdamp import identify, respond
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import Bilinear, Lag, Linear, Spring, with_fitted_range


TIME = 2e-3 * np.arange(126)
STROKE, VELOCITY = 0.01 * (1.0 - np.cos(25.0 * TIME)), 0.25 * np.sin(25.0 * TIME)
TRUE = Lag(Bilinear(2600.0, 1200.0), 0.004)
START = Lag(Bilinear(2000.0, 1500.0), 0.008)
FITTED = with_fitted_range(START, velocity=(-0.3, 0.3), force=(-400.0, 800.0))


def error(law: Any, force: Any) -> Any:
    return (respond(law, TIME, STROKE, VELOCITY) - force) / 100.0


@pytest.fixture(scope="module")
def force():
    return respond(TRUE, TIME, STROKE, VELOCITY)


@pytest.mark.slow
def test_optimistix_fits_a_law_that_was_fitted_before(force):
    found = optx.least_squares(error, optx.LevenbergMarquardt(rtol=1e-9, atol=1e-9), FITTED, args=force)
    np.testing.assert_allclose(jax.tree.leaves(found.value), jax.tree.leaves(TRUE), rtol=1e-6)


def test_a_step_of_adamw_changes_the_parameters_only():
    optimiser = optax.adamw(1.0, weight_decay=0.1)
    gradient = jax.tree.map(jnp.ones_like, FITTED)
    assert float(optax.tree.norm(gradient)) == pytest.approx(2.0)

    def step(law: Any) -> Any:
        updates, _ = optimiser.update(gradient, optimiser.init(law), law)
        return optax.apply_updates(law, updates)

    with jax.numpy_dtype_promotion("standard"):  # optax mixes types
        after, plain, compiled = step(FITTED), step(START), eqx.filter_jit(step)(FITTED)
    assert eqx.tree_equal(after, plain) and after.fitted_to == FITTED.fitted_to
    np.testing.assert_allclose(after.law.rebound_rate, 2000.0 - 1.0 - 0.1 * 2000.0, rtol=1e-6)
    assert compiled.fitted_to is None  # what a compiled program returns has no range


def test_a_fitted_law_is_a_vector_of_its_parameters_and_back():
    vector, law_of = ravel_pytree(FITTED)
    np.testing.assert_array_equal(vector, ravel_pytree(START)[0])
    assert vector.shape == (4,) and eqx.tree_equal(law_of(vector), FITTED)


def test_a_fitted_and_an_unfitted_law_in_one_branch_one_scan_and_one_batch():
    chosen = jax.lax.cond(jnp.asarray(True), lambda: FITTED, lambda: TRUE)
    assert eqx.tree_equal(chosen, START)
    both = jax.tree.map(lambda *leaves: jnp.stack(leaves), FITTED, TRUE)
    assert both.lag_time.tolist() == [0.008, 0.004]
    last, _ = jax.lax.scan(lambda law, _: (TRUE, None), FITTED, None, length=2)
    assert eqx.tree_equal(last, TRUE) and last.fitted_to is None


def test_forces_are_exported_and_called_with_a_law_of_another_range(force):
    @jax.jit
    def forces(numbers, time, stroke, velocity):
        return respond(jax.tree.unflatten(structure, numbers), time, stroke, velocity)

    numbers, structure = jax.tree.flatten(FITTED)
    record = tuple(map(jnp.asarray, (TIME, STROKE, VELOCITY)))
    program = jax.export.export(forces)(numbers, *record)
    np.testing.assert_allclose(program.call(jax.tree.leaves(TRUE), *record), force, rtol=1e-12)


def test_nothing_leaks_and_no_nan_is_made_on_the_way(force):
    with jax.checking_leaks(), jax.debug_nans(True):
        value, slope = eqx.filter_value_and_grad(lambda law: jnp.sum(error(law, force) ** 2))(FITTED)
    assert np.isfinite(float(value)) and all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slope))


def test_a_law_from_a_fit_has_its_range_and_from_a_compiled_program_none(force):
    record = BenchRun("sine", TIME, STROKE, VELOCITY, np.asarray(force))
    found = identify.fit(Linear(1000.0) + Spring(0.0), [record])
    assert found.law.fitted_to is not None and found.law.fitted_to.velocity is not None
    other = jax.jit(lambda law: law)(Linear(3.0) + Spring(1.0))
    assert jax.jit(lambda law: law)(found.law).fitted_to is None and other.fitted_to is None
