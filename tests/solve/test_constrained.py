"""The constrained minimiser on problems with known solutions, one search and many side by side."""

import numpy as np
import pytest

from jaxdamp.solve import Evaluation, Region, Scaling, SequentialQuadratic


NONE = np.zeros((0, 2)), np.zeros(0)
WIDE = Region(np.full(2, -5.0), np.full(2, 5.0), *NONE)


def evaluated(function):
    """Rows and derivatives of a function of x and y, that gives pairs of a value and its gradient, at many points."""

    def at(points):
        rows = [list(zip(*function(*point), strict=True)) for point in points]
        return [Evaluation(np.array(p), np.array(r[0]), np.array(r[1])) for p, r in zip(points, rows, strict=True)]

    return at


def solved(
    function, starts, scaling, *, region=WIDE, aims=None, max_steps=200, feasible=1e-9, improvement=1e-14, **more
):
    """The searches from these starts."""
    solver = SequentialQuadratic(region, scaling, max_steps, improvement=improvement, feasible=feasible, **more)
    aims = [np.zeros(scaling.objectives)] * len(starts) if aims is None else aims
    at = evaluated(function)
    states = [solver.init(a, y, e) for a, y, e in zip(aims, starts, at(starts), strict=True)]
    solver.solve(at, states)
    return states


def rosenbrock(x, y):
    return [(100.0 * (y - x**2) ** 2 + (1.0 - x) ** 2, [-400.0 * x * (y - x**2) - 2.0 * (1.0 - x), 200.0 * (y - x**2)])]


def in_a_circle(x, y):
    """The distance from (2, 1), within a circle of radius one."""
    return [
        ((x - 2.0) ** 2 + (y - 1.0) ** 2, [2.0 * (x - 2.0), 2.0 * (y - 1.0)]),
        (x**2 + y**2 - 1.0, [2.0 * x, 2.0 * y]),
    ]


ONE, LIMITED = Scaling(np.zeros(1), np.ones(1), 1), Scaling(np.zeros(2), np.ones(2), 1)


def test_a_curved_valley_is_followed_to_its_end() -> None:
    (state,) = solved(rosenbrock, np.array([[-1.2, 1.0]]), ONE)
    np.testing.assert_allclose(state.y, [1.0, 1.0], rtol=1e-6)
    assert state.converged and state.steps < 60


@pytest.mark.parametrize("start", [(0.1, 0.1), (4.0, -4.0), (3.0, -4.0), (4.0, 3.0)])
@pytest.mark.parametrize("unit", [0.001, 0.01, 0.1, 1.0])
def test_a_curved_limit_holds_from_inside_and_outside_in_any_unit(start, unit) -> None:
    (state,) = solved(in_a_circle, np.array([start]), LIMITED._replace(unit=np.array([1.0, unit])))
    np.testing.assert_allclose(state.y, np.array([2.0, 1.0]) / np.sqrt(5.0), rtol=1e-6)
    assert state.converged


@pytest.mark.parametrize("steep", [1.0, 1e3, 1e5, 1e8])
def test_a_limit_holds_however_steep_the_objective(steep: float) -> None:
    """steep x² where x must be 1 or more."""
    steeply = lambda x, y: [(steep * x**2, [2.0 * steep * x, 0.0]), (1.0 - x, [-1.0, 0.0])]  # noqa: E731
    (state,) = solved(steeply, np.array([[3.0, 1.0]]), LIMITED)
    assert state.converged and state.y[0] == pytest.approx(1.0, abs=1e-6)


def test_a_limit_that_costs_more_than_the_penalty_holds_too() -> None:
    """The multiplier of the limit is 200: the penalty of 10 alone would leave it violated."""
    steep = Scaling(np.zeros(2), np.array([0.01, 1.0]), 1)
    (state,) = solved(in_a_circle, np.array([[2.0, 1.0]]), steep)
    np.testing.assert_allclose(state.y, np.array([2.0, 1.0]) / np.sqrt(5.0), rtol=1e-5)
    assert state.penalty > 10.0
    (constant,) = solved(in_a_circle, np.array([[2.0, 1.0]]), steep, feasible=np.inf)
    assert constant.evaluation.rows[1] > 0.1


def test_limits_that_contradict_each_other_are_violated_equally() -> None:
    def apart(x, y):
        return [(y**2, [0.0, 2.0 * y]), (x + 1.0, [1.0, 0.0]), (2.0 - x, [-1.0, 0.0])]  # x ≤ −1 and x ≥ 2

    (state,) = solved(apart, np.array([[0.0, 1.0]]), Scaling(np.zeros(3), np.ones(3), 1))
    np.testing.assert_allclose(state.evaluation.rows[1:], [1.5, 1.5], rtol=1e-4)


def test_bounds_and_order_hold_at_every_point() -> None:
    """The nearest pair to (2, 1) with x ≤ 0.5, and with y ≥ x + 1."""
    seen = []

    def distance(x, y):
        seen.append((x, y))
        return in_a_circle(x, y)[:1]

    region = Region(np.array([-5.0, -5.0]), np.array([0.5, 5.0]), np.array([[-1.0, 1.0]]), np.array([1.0]))
    (state,) = solved(distance, np.array([[-2.0, 0.0]]), ONE, region=region)
    np.testing.assert_allclose(state.y, [0.5, 1.5], atol=1e-7)
    assert all(x <= 0.5 and y - x >= 1.0 - 1e-9 for x, y in seen)


def test_searches_side_by_side_are_those_one_by_one() -> None:
    starts = np.array([[-1.2, 1.0], [2.0, 2.0], [0.0, -1.0]])
    together = solved(rosenbrock, starts, ONE)
    for start, state in zip(starts, together, strict=True):
        (alone,) = solved(rosenbrock, start[None], ONE)
        assert np.array_equal(alone.y, state.y) and alone.steps == state.steps


def test_aims_spread_along_a_front() -> None:
    """Two squared distances: with the aims of points of the front a search ends where both excesses are equal."""

    def both(x, y):
        return [(x**2 + y**2, [2.0 * x, 2.0 * y]), ((x - 1.0) ** 2 + y**2, [2.0 * (x - 1.0), 2.0 * y])]

    aims = [np.array([0.0, 0.0]), np.array([0.0, 0.2])]
    states = solved(both, np.array([[0.3, 2.0]] * 2), Scaling(np.zeros(2), np.ones(2), 2), aims=aims, share=1e-4)
    # x² − a₁ = (1 − x)² − a₂, up to the small share of the sum
    np.testing.assert_allclose([state.y for state in states], [[0.5, 0.0], [0.4, 0.0]], atol=1e-3)


def test_the_largest_of_many_is_smallest_where_several_are_equal() -> None:
    """Squared distances from points in a circle, three of them on it: the largest is smallest at its centre, 3²."""
    centre, on_circle = np.array([1.0, 2.0]), np.deg2rad([0.0, 130.0, 240.0])
    places = 3.0 * np.stack([np.cos(on_circle), np.sin(on_circle)], axis=1)
    points = centre + np.concatenate([places, np.random.default_rng(0).uniform(-2.0, 2.0, (60, 2))])

    def distances(*at):
        return [(float(np.sum((at - point) ** 2)), 2.0 * (at - point)) for point in points]

    (state,) = solved(distances, np.array([[-4.0, 4.0]]), Scaling(np.zeros(63), np.ones(63), 63))
    np.testing.assert_allclose(state.y, centre, atol=1e-6)
    assert state.converged and state.steps < 20
    np.testing.assert_allclose(state.evaluation.rows[:3], 9.0, rtol=1e-6)


def test_points_without_numbers_are_no_steps() -> None:
    def walled(x, y):
        if x > 0.4:
            return [(np.nan, [np.nan, np.nan])]
        return [(x**2 + y**2, [2.0 * x, 2.0 * y])]

    (state,) = solved(walled, np.array([[-3.0, 3.0]]), ONE)
    np.testing.assert_allclose(state.y, [0.0, 0.0], atol=1e-6)
    (lost,) = solved(walled, np.array([[3.0, 3.0]]), ONE)
    assert not lost.converged and not lost.open


def test_a_search_stops_after_its_steps() -> None:
    (state,) = solved(rosenbrock, np.array([[-1.2, 1.0]]), ONE, max_steps=3)
    assert state.steps == 3 and not state.converged and not state.open


def test_a_kinked_valley_is_followed_by_tangents_of_refused_points() -> None:
    """The largest of |x + 10 y| and |x − 10 y|, each smooth but for its sign: a search along the crease y = 0."""

    def creased(x, y):
        one, other = x + 10.0 * y + 0.05 * x**2, x - 10.0 * y + 0.05 * x**2
        if one >= other:
            return [(one, [1.0 + 0.1 * x, 10.0])]
        return [(other, [1.0 + 0.1 * x, -10.0])]

    region = Region(np.array([-3.0, -5.0]), np.full(2, 5.0), *NONE)
    (state,) = solved(creased, np.array([[4.0, 1.0]]), ONE, region=region)
    np.testing.assert_allclose(state.y, [-3.0, 0.0], atol=1e-5)
    assert state.steps < 30
