"""Bounded Levenberg-Marquardt on the host and inside JAX: the same ends, bounds, conditions, gradients."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from scipy.optimize import lsq_linear

from jaxdamp._status import Status
from jaxdamp.solve import BoundedLevenbergMarquardt, ImplicitWithinBounds, Linearisation, least_squares_on_host


TIME = np.linspace(0.0, 2.0, 50)
DATA = 3.0 * np.exp(-1.5 * TIME) + 0.01 * np.sin(40.0 * TIME)


def misses(y, data):
    return y[0] * jnp.exp(-y[1] * TIME) - data


@jax.jit
def linearised(y, data):
    return misses(y, data), jax.jacfwd(misses)(y, data)


def on_host(data, solver, conditions=None, max_steps=100, start=(1.0, 1.0), record=None):
    def at(y, lanes):
        points = [linearised(jnp.asarray(point), data[lane]) for point, lane in zip(y, lanes, strict=True)]
        rows = np.stack([np.concatenate([np.asarray(j), np.asarray(r)[:, None]], axis=1) for r, j in points])
        margins = np.zeros((len(y), 0)) if conditions is None else np.stack([conditions(p) for p in y])
        if record is not None:
            record.append((list(lanes), margins))
        slopes = np.zeros((*margins.shape, 2))
        if conditions is not None:
            slopes = np.stack([np.asarray(jax.jacfwd(conditions)(jnp.asarray(p))) for p in y])
        return Linearisation(rows, margins, slopes, np.full(len(y), 50.0)), y

    return least_squares_on_host(at, solver, np.tile(start, (len(data), 1)), max_steps)


@pytest.mark.parametrize("upper", [10.0, (10.0, 1.2)], ids=["inside", "at a bound"])
def test_host_and_jax_take_the_same_steps(upper):
    solver = BoundedLevenbergMarquardt(lower=np.zeros(2), upper=np.broadcast_to(upper, 2))
    end = on_host(DATA[None], solver)
    inside = optx.least_squares(
        misses, BoundedLevenbergMarquardt(lower=0.0, upper=jnp.asarray(upper)), jnp.ones(2), DATA
    )
    np.testing.assert_allclose(inside.value, end.y[0], rtol=1e-9)
    assert int(inside.stats["num_steps"]) == end.steps[0] and end.status == [Status.CONVERGED]


def test_lanes_end_by_themselves_and_are_computed_no_more():
    data, seen = np.stack([DATA, 3.0 * np.exp(-1.0 * TIME), 0.01 * DATA]), []
    end = on_host(data, BoundedLevenbergMarquardt(lower=np.zeros(2), upper=np.full(2, np.inf)), record=seen)
    alone = [on_host(row[None], BoundedLevenbergMarquardt(lower=np.zeros(2), upper=np.full(2, np.inf))) for row in data]
    for lane, single in enumerate(alone):
        np.testing.assert_allclose(end.y[lane], single.y[0], rtol=1e-10)
        assert end.steps[lane] == single.steps[0] == sum(lane in lanes for lanes, _ in seen)
    assert len(set(end.steps)) > 1
    together = jax.jit(
        jax.vmap(lambda d: optx.least_squares(misses, BoundedLevenbergMarquardt(lower=0.0), jnp.ones(2), d).value)
    )
    np.testing.assert_allclose(together(data), end.y, rtol=1e-7)


def test_a_condition_that_bends_within_a_step_is_kept():
    """The linearised condition lets a step pass that breaks the bent one: such a step must be refused."""

    def allowed(y):
        return (4.0 - y[0] ** 2 - (y[1] - 1.0) ** 2)[None]  # the minimum, near (3, 1.5), is outside

    solver = BoundedLevenbergMarquardt(lower=np.zeros(2), upper=np.full(2, 10.0))
    tried = []
    ends = [on_host(DATA[None], solver, allowed, max_steps=steps, record=tried) for steps in (2, 3, 4, 5, 6, 100)]
    assert min(float(margins[0, 0]) for _, margins in tried) < 0.0  # a step did break it
    assert all(float(allowed(end.y[0])[0]) > 0.0 for end in ends)  # but was not accepted
    assert ends[-1].status == [Status.CONVERGED] and float(allowed(ends[-1].y[0])[0]) < 1e-3
    inside = optx.least_squares(
        misses, BoundedLevenbergMarquardt(lower=0.0, upper=10.0, conditions=allowed), jnp.ones(2), DATA
    )
    np.testing.assert_allclose(inside.value, ends[-1].y[0], rtol=1e-6)


def searched(model, start, solver, data):
    """The end of a search of a NumPy function that gives forces and derivatives."""

    def at(y, lanes):
        force, slopes = model(y[0])
        rows = np.concatenate([slopes, (force - data)[:, None]], axis=1) / np.linalg.norm(data)
        return Linearisation(rows[None], np.zeros((1, 0)), np.zeros((1, 0, y.shape[1])), np.array([len(data)])), y

    end = least_squares_on_host(at, solver, np.asarray(start)[None], 300)
    assert end.status == [Status.CONVERGED]
    return end.y[0], int(end.steps[0]), float(np.sum((model(end.y[0])[0] - data) ** 2))


def test_unknowns_leave_bounds_again_within_a_step():
    """A linear problem whose columns are nearly alike: most unknowns are at bounds, but not those hit first."""
    random, count = np.random.default_rng(3), 10
    alike = np.linalg.cholesky(0.98 * np.ones((count, count)) + 0.02 * np.eye(count)).T
    columns = random.standard_normal((40, count)) @ alike
    data = columns @ random.uniform(-1.0, 1.0, count) + 0.1 * random.standard_normal(40)
    solver = BoundedLevenbergMarquardt(lower=np.full(count, -0.4), upper=np.full(count, 0.4))
    found, steps, _ = searched(lambda y: (columns @ y, columns), np.zeros(count), solver, data)
    np.testing.assert_allclose(found, lsq_linear(columns, data, (-0.4, 0.4), method="bvls").x, atol=1e-6)
    assert steps < 10


def test_a_search_ends_at_a_kink_only_where_none_from_there_gains():
    """Straight lines between knots, which stand at samples: a knot that crosses one changes the derivatives."""
    random = np.random.default_rng(11)
    v = np.sort(np.round(random.uniform(-1.0, 1.0, 60), 2))
    data = 3.0 * np.tanh(3.0 * v) + 0.1 * random.standard_normal(60)

    def lines(y):
        knots, slopes = y[:3], y[4:7]
        above = np.maximum(v[:, None] - knots, 0.0)
        columns = [np.where(above > 0.0, -slopes, 0.0), v[:, None], above, np.ones((60, 1))]
        return y[3] * v + above @ slopes + y[7], np.concatenate(columns, axis=1)

    solver = BoundedLevenbergMarquardt()
    found, _, squares = searched(lines, [-0.5, 0.0, 0.5, 2.0, 0.3, 0.3, 0.3, 0.0], solver, data)
    *_, least = searched(lines, found, solver, data)
    assert squares - least < 0.01 * squares / 60  # a tenth of a standard error


def test_the_gradient_of_a_solution_is_that_of_differences():
    def rate(data, upper):
        solver = BoundedLevenbergMarquardt(lower=0.0, upper=jnp.asarray([10.0, upper]), tolerance=1e-9)
        return optx.least_squares(misses, solver, jnp.ones(2), data, adjoint=ImplicitWithinBounds()).value

    along = np.cos(7.0 * TIME)
    derived = jax.jit(jax.value_and_grad(lambda d, upper: rate(d, upper) @ jnp.asarray([1.0, 2.0])))
    for upper in (10.0, 1.2):  # inside, and with the second number at its bound
        slope = derived(DATA, upper)[1] @ along
        ends = [derived(DATA + h * along, upper)[0] for h in (1e-4, -1e-4)]
        np.testing.assert_allclose(slope, (ends[0] - ends[1]) / 2e-4, rtol=1e-5)
    follows = jax.jit(jax.jacfwd(rate, argnums=1))(DATA, 1.2)
    assert float(follows[1]) == pytest.approx(1.0)  # it follows its bound


def test_unknowns_and_residuals_may_be_trees():
    def fn(y, _):
        return {"a": y["level"] * jnp.exp(-y["rate"] * TIME) - DATA, "b": 1e-6 * y["rate"]}

    solver = BoundedLevenbergMarquardt(lower={"level": 0.0, "rate": 0.0}, upper={"level": 10.0, "rate": 1.2})
    found = optx.least_squares(fn, solver, {"level": jnp.asarray(1.0), "rate": jnp.asarray(1.0)})
    assert float(found.value["rate"]) == pytest.approx(1.2) and found.value["level"].shape == ()


def test_bounds_are_numbers_for_vectors_and_in_order():
    solver = BoundedLevenbergMarquardt(lower={"a": -1.0, "b": 0.0}, upper={"a": 5.0, "b": 1.0})
    start = {"a": jnp.zeros(()), "b": jnp.zeros(2)}
    found = optx.least_squares(lambda y, _: (y["a"] - 1.0, y["b"] - jnp.array([2.0, -3.0])), solver, start)
    assert float(found.value["a"]) == pytest.approx(1.0) and found.value["b"].tolist() == [1.0, 0.0]
    with pytest.raises(ValueError, match=r"`lower` must be at most `upper`, but is 3\.0 above 1\.0"):
        BoundedLevenbergMarquardt(lower=3.0, upper=1.0)


def test_a_column_without_effect_leaves_a_finite_step():
    """However long the search: the least damping keeps the system solvable."""
    solver = BoundedLevenbergMarquardt(lower=np.full(2, -np.inf), upper=np.full(2, np.inf))
    rows = np.array([[[1.0, 0.0, 1.0], [0.0, 0.0, 0.5]]])
    nothing = np.zeros((1, 0)), np.zeros((1, 0, 2)), np.ones(1)
    state = solver.init(print, np.zeros((1, 2)), None, {"linearise": None}, None, None, frozenset())
    state = state._replace(step_size=np.full(1, np.inf))
    options = {"linearise": lambda y, lanes: (Linearisation(rows, *nothing), None)}
    _, state, _ = solver.step(print, np.zeros((1, 2)), np.arange(1), options, state, frozenset())
    np.testing.assert_allclose(state.trial, [[-1.0, 0.0]], atol=1e-9)
    assert not state.stuck[0]


def test_an_unknown_that_the_start_hardly_shows_does_not_stop_the_others():
    """A step of a billion in it, which was damped by nothing, was refused until no step was left: converged."""
    velocity, heat = np.sin(20.0 * TIME), 1.0 - np.exp(-TIME)

    def at(y, lanes):
        rate, slope, rise = y[0]
        misses = (rate - 2.0 - 1e-12 * rise) * velocity + slope * (heat + rise) - 0.1 * (heat + 2.0)
        rows = np.stack([velocity, heat + rise, slope - 1e-12 * velocity, misses], axis=1)
        return Linearisation(rows[None], np.zeros((1, 0)), np.zeros((1, 0, 3)), np.full(1, 50.0)), misses @ misses

    end = least_squares_on_host(at, BoundedLevenbergMarquardt(), np.array([[1.0, 0.0, 0.0]]), 200)
    assert end.status == [Status.CONVERGED] and end.aux < 1e-6


def test_a_start_without_finite_residual_has_no_step():
    end = on_host(DATA[None] * np.nan, BoundedLevenbergMarquardt(lower=np.zeros(2), upper=np.full(2, np.inf)))
    assert end.status == [Status.NO_STEP] and end.steps[0] == 1
    solver = BoundedLevenbergMarquardt(lower=0.0)
    lost = optx.least_squares(misses, solver, jnp.ones(2), DATA * jnp.nan, throw=False)
    assert lost.result == optx.RESULTS.nonfinite


@pytest.mark.parametrize("patience", [None, 3])
def test_patience_ends_a_search_that_gains_nothing(patience):
    """A residual that promises a decrease, as one does near a kink, which no step keeps."""

    @jax.custom_jvp
    def promising(y):
        return jnp.sum(y) * jnp.zeros(2) + 1.0

    promising.defjvp(lambda y, change: (promising(*y), 0.1 * change[0]))

    def at(y, lanes):
        rows = np.concatenate([0.1 * np.eye(2), np.ones((2, 1))], axis=1)
        return Linearisation(rows[None], np.zeros((1, 0)), np.zeros((1, 0, 2)), np.array([2.0])), y

    solver = BoundedLevenbergMarquardt(tolerance=1e-3, patience=patience)
    end = optx.least_squares(lambda y, _: promising(y), solver, jnp.zeros(2), max_steps=500)
    host = least_squares_on_host(at, solver, np.zeros((1, 2)), 500)
    assert host.steps[0] == int(end.stats["num_steps"]) and host.status == [Status.CONVERGED]
    np.testing.assert_allclose(host.y[0], end.value, atol=1e-12)
    assert host.steps[0] == 4 if patience else host.steps[0] > 6


@pytest.mark.parametrize(("patience", "steps"), [(None, 2), (3, 1)])
def test_a_start_from_which_no_step_promises_enough_is_the_end_of_a_search_with_patience(patience, steps):
    """The minimum of a parabola a hundredth of a standard error away; without patience the step is taken."""

    def missed(y):
        return jnp.concatenate([y, jnp.ones(3)])

    def at(y, lanes):
        rows = np.concatenate([np.eye(2), y.T], axis=1), np.array([[0.0, 0.0, np.sqrt(3.0)]])
        return Linearisation(np.concatenate(rows)[None], np.zeros((1, 0)), np.zeros((1, 0, 2)), np.array([5.0])), y

    solver, start = BoundedLevenbergMarquardt(tolerance=0.1, patience=patience), np.array([[0.01, 0.0]])
    host = least_squares_on_host(at, solver, start, 50)
    end = optx.least_squares(lambda y, _: missed(y), solver, jnp.asarray(start[0]), max_steps=50)
    assert host.steps[0] == int(end.stats["num_steps"]) == steps and host.status == [Status.CONVERGED]
    np.testing.assert_allclose(host.y[0], end.value, atol=1e-12)
    np.testing.assert_allclose(host.y[0], start[0] if patience else 0.0, atol=0.0 if patience else 1e-3)
