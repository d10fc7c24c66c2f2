"""A `Problem` as the residual of one's own program, in a record that begins in motion."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

from jaxdamp import identify, respond
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import Lag, Linear
from jaxdamp.parameters import Coordinates


W = 25.0
TIME = 2e-3 * np.arange(506)  # two cycles
TRUE = Lag(Linear(1500.0), 0.004)


def settled():
    """A sine that begins at full speed, with the settled force of the law: F + τ Ḟ = c v."""
    rate, lag = 1500.0, 0.004
    stroke, velocity = 0.01 * np.sin(W * TIME), 0.01 * W * np.cos(W * TIME)
    phase = np.arctan(W * lag)
    force = rate * 0.01 * W * np.cos(phase) * np.cos(W * TIME - phase)
    return BenchRun("sine", TIME, stroke, velocity, force)


@pytest.mark.slow
def test_the_residual_of_a_problem_gives_the_truth_within_bounds_where_a_start_at_rest_does_not():
    run = settled()
    start = Lag(Linear(1000.0), 0.008)
    problem = identify.prepare(start, [run], bounds={"lag_time": (1e-4, 0.02)}, initial_state="periodic")
    coordinates = Coordinates(problem.free, smooth="all")
    solver = optx.LevenbergMarquardt(rtol=1e-9, atol=1e-9)
    found = optx.least_squares(
        lambda y, _: problem.residual(coordinates.to_physical(y)), solver, jnp.asarray(coordinates.start)
    )
    np.testing.assert_allclose(coordinates.to_physical(found.value), [1500.0, 0.004], rtol=2e-3)
    forward, reverse = (jax.jit(of(problem.residual))(problem.free.values) for of in (jax.jacfwd, jax.jacrev))
    np.testing.assert_allclose(forward, reverse, rtol=1e-8, atol=1e-12)

    def at_rest(values, _):
        law = problem.free.build(values)
        return (respond(law, TIME, run.stroke, run.velocity, state=law.initial_state()) - run.force) / 100.0

    biased = optx.least_squares(at_rest, solver, problem.free.values)
    assert abs(float(biased.value[1]) / 0.004 - 1.0) > 0.02
