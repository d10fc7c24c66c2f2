"""The peers of the benchmarks do the work they are timed for, to the accuracy they are credited with."""

import importlib.util

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks.peers import c, casadi_map, diffrax_vmapped, finite_differences, problem, scipy_numba
from jaxdamp.dampers import Besinger


pytestmark = pytest.mark.exhaustive  # they are about benchmarks, not about what users call

DT = 1e-3
ALL = list(problem.CASES)

# of the exponential step of 1 ms, over the road of `some`
ERRORS = {"besinger": 4e-6, "lag": 2e-5, "series_spring": 1.5e-5, "bouc_wen": 7e-5, "half_car": 1.5e-5}

needs_gcc = pytest.mark.skipif(not c.available(), reason="gcc is not installed")
needs_numba = pytest.mark.skipif(not scipy_numba.available(), reason="numba is not installed")
needs_casadi = pytest.mark.skipif(not casadi_map.available(), reason="casadi is not installed")


def some(case: str, cars: int = 3, duration: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    return problem.draw(case, cars, seed=1), problem.heights(case, duration)


def gradients_by_jax(parameters: np.ndarray, road: np.ndarray) -> np.ndarray:
    """Forward mode through RK4 of the quarter car with a Besinger damper, written again."""
    heights = jnp.asarray(road[:, 0])

    def rms(row):
        law = Besinger(*row)

        def rates(y, z):
            pull = 60e3 * (y[0] - y[1]) + law.force_velocity(y[2] - y[3])
            return jnp.stack([y[2], y[3], -pull / 1200.0, (pull - 220e3 * (y[1] - z)) / 125.0])

        def step(y, z):
            k1 = rates(y, z[0])
            k2 = rates(y + 0.5 * DT * k1, 0.5 * (z[0] + z[1]))
            k3 = rates(y + 0.5 * DT * k2, 0.5 * (z[0] + z[1]))
            k4 = rates(y + DT * k3, z[1])
            return y + DT / 6.0 * (k1 + 2.0 * (k2 + k3) + k4), k1[2]

        start = heights[0] * jnp.array([1.0, 1.0, 0.0, 0.0])
        last, felt = jax.lax.scan(step, start, jnp.stack([heights[:-1], heights[1:]], axis=1))
        return jnp.sqrt((jnp.sum(felt**2) + rates(last, heights[-1])[2] ** 2) / heights.size)

    return np.asarray(jax.jit(jax.vmap(jax.jacfwd(rms)))(jnp.asarray(parameters)))


def test_parameters_lie_in_their_ranges_and_come_back_with_the_seed():
    for case, content in problem.CASES.items():
        table = problem.draw(case, 50, seed=3)
        low, high = np.array(list(content.ranges.values())).T
        assert np.all((table >= low) & (table <= high))
        np.testing.assert_array_equal(table, problem.draw(case, 50, seed=3))
        assert table.shape == (50, len(problem.names(case)))


@pytest.mark.parametrize("case", ALL)
def test_laws_of_a_table_have_a_leaf_for_each_column(case: str):
    table = problem.draw(case, 4)
    leaves = [leaf for leaf in jax.tree.leaves(problem.law(case, table)) if leaf.shape == (4,)]
    for column in table.T:
        assert any(np.allclose(leaf, column) for leaf in leaves)


@needs_gcc
def test_the_compiled_library_leaves_the_smallest_numbers_alone():
    """Linked with -ffast-math, it would flush them to zero in the whole process."""
    c.library()
    assert np.finfo(float).tiny / np.float64(4.0) > 0.0


@needs_gcc
@pytest.mark.parametrize("case", ALL)
def test_exponential_step_in_c_is_that_of_jaxdamp(case: str):
    parameters, road = some(case, cars=2)
    found, ours = c.exponential(case, parameters, road), problem.simulated(case, parameters, road, DT)
    # the few Newton steps of the series spring leave a little
    assert np.max(problem.errors(found, ours)) < (1e-6 if case == "series_spring" else 1e-12)


@needs_gcc
@pytest.mark.parametrize("case", ALL)
def test_rk4_in_c_agrees_with_jaxdamp_to_the_error_of_the_step(case: str):
    parameters, road = some(case, cars=2)
    found, ours = c.rk4(case, parameters, road), problem.simulated(case, parameters, road, DT)
    assert np.max(problem.errors(found, ours)) < 4.0 * ERRORS[case]


@needs_gcc
@pytest.mark.parametrize("case", ALL)
def test_exponential_step_in_c_converges(case: str):
    parameters, road = some(case, cars=16)
    sizes = []
    for factor in (1, 4):
        finer = problem.refined(road, factor)
        exact = c.rk4(case, parameters, finer, DT / factor, substeps=24 // factor)
        error = problem.errors(c.exponential(case, parameters, finer, DT / factor), exact)
        sizes.append(np.sqrt(np.mean(error**2)))
    assert sizes[0] < ERRORS[case]
    assert sizes[1] < sizes[0] / 9.0  # 16 to 64 but for kinks


@needs_gcc
@pytest.mark.parametrize("case", ALL)
def test_rk4_in_c_converges(case: str):
    parameters, road = some(case, cars=16)
    substeps = c.SUBSTEPS[case]
    exact = c.rk4(case, parameters, road, substeps=48)
    sizes = []
    for factor in (1, 2, 4, 8):
        error = problem.errors(c.rk4(case, parameters, road, substeps=factor * substeps), exact)
        sizes.append(np.sqrt(np.mean(error**2)))
    assert sizes[0] < 1e-5
    assert sizes[-1] < sizes[0] / 20.0  # kinks leave second order of the fourth


def without_kinks(case: str) -> np.ndarray:
    """A valve that never opens and, for Bouc-Wen, hardly any hysteresis leave smooth laws."""
    parameters = problem.draw(case, 4, seed=1)
    for column, name in enumerate(problem.names(case)):
        if name == "yield_force":
            parameters[:, column] = 1e-6
        elif name.endswith("limit_velocity"):
            parameters[:, column] = 100.0
    return parameters


@needs_gcc
@pytest.mark.parametrize("case", ["besinger", "lag", "bouc_wen"])
def test_rk4_in_c_has_fourth_order_without_kinks(case: str):
    """The one Newton step of the series spring is good for 1e-8, which hides the order."""
    parameters = without_kinks(case)
    road = 0.02 * np.linspace(0.0, 1.0, 401)[:, None]  # a ramp, which has no kink but at its start
    dt = 4e-3
    exact = c.rk4(case, parameters, road, dt, substeps=64)
    coarse, fine = (problem.errors(c.rk4(case, parameters, road, dt, substeps=n), exact) for n in (2, 4))
    assert np.all(fine < coarse / 8.0)


@needs_gcc
@pytest.mark.parametrize("case", ["besinger", "bouc_wen", "half_car"])
def test_exponential_step_in_c_has_third_order_without_kinks(case: str):
    """The states of the lag and of the series spring take steps of second order."""
    parameters = without_kinks(case)
    tracks = 2 if case == "half_car" else 1
    road = 0.02 * np.tile(np.linspace(0.0, 1.0, 401)[:, None], tracks)
    sizes = []
    for factor in (1, 2, 4):
        finer, dt = problem.refined(road, factor), 2e-3 / factor
        exact = c.rk4(case, parameters, finer, dt, substeps=16 // factor)
        sizes.append(problem.errors(c.exponential(case, parameters, finer, dt), exact))
    assert np.all(sizes[1] < sizes[0] / 7.0)
    assert np.all(sizes[2] < sizes[1] / 7.0)


@needs_gcc
@pytest.mark.parametrize("case", ALL)
def test_rk4_in_c_agrees_with_the_reference(case: str):
    parameters, road = some(case, cars=2, duration=2.0)
    exact = problem.reference(case, parameters, road, DT)
    assert np.max(problem.errors(c.rk4(case, parameters, road), exact)) < 1e-5
    assert np.max(problem.errors(c.rk4(case, parameters, road, substeps=32), exact)) < 1e-7


@needs_gcc
@pytest.mark.parametrize("case", ["series_spring", "half_car"])
def test_kernels_do_not_depend_on_threads_blocks_or_neighbours(case: str):
    parameters, road = some(case, cars=70, duration=0.2)
    for kernel in (c.rk4, c.exponential):
        expected = kernel(case, parameters, road)
        np.testing.assert_allclose(kernel(case, parameters, road, threads=2), expected, rtol=1e-12)
        np.testing.assert_allclose(kernel(case, parameters, road, lanes=8), expected, rtol=1e-9)
        np.testing.assert_allclose(kernel(case, parameters[40:41], road), expected[40:41], rtol=1e-12)


@needs_gcc
def test_kernels_refuse_a_table_or_road_of_another_shape():
    parameters, road = some("besinger", duration=0.1)
    with pytest.raises(ValueError, match="needs 6 parameters"):
        c.rk4("lag", parameters, road)
    with pytest.raises(ValueError, match="2 track"):
        c.rk4("half_car", problem.draw("half_car", 1), road)


@needs_gcc
def test_finite_differences_agree_with_derivatives():
    parameters, road = some("besinger", cars=2)
    found = finite_differences.gradient("besinger", parameters, road)
    np.testing.assert_allclose(found, gradients_by_jax(parameters, road), rtol=1e-5, atol=1e-10)


@needs_gcc
@pytest.mark.parametrize("case", ALL)
def test_diffrax_agrees_with_c(case: str):
    parameters, road = some(case, cars=2)
    exact = c.rk4(case, parameters, road, substeps=24)
    substeps = 2 * diffrax_vmapped.SUBSTEPS[case]  # at single steps the kinks of Bouc-Wen leave just 1e-5
    saved = diffrax_vmapped.rms(case, parameters, road, at_instants=True, substeps=substeps)
    assert np.max(problem.errors(saved, exact)) < 1e-5
    # the mean over time is not quite that over instants
    assert np.max(problem.errors(diffrax_vmapped.rms(case, parameters, road), exact)) < 1e-3


@needs_gcc
@needs_numba
@pytest.mark.parametrize("case", ALL)
def test_scipy_agrees_with_c(case: str):
    parameters, road = some(case, cars=1)
    exact = c.rk4(case, parameters, road, substeps=24)
    assert np.max(problem.errors(scipy_numba.rms(case, parameters, road, rtol=1e-6), exact)) < 1e-4
    tight = scipy_numba.rms(case, parameters, road, rtol=1e-9, atol=1e-11, method="DOP853")
    assert np.max(problem.errors(tight, exact)) < 1e-6


@needs_gcc
@needs_casadi
def test_casadi_agrees_with_c():
    parameters, road = some("besinger")
    expected = c.rk4("besinger", parameters, road)
    np.testing.assert_allclose(casadi_map.rms(parameters, road), expected, rtol=1e-11)
    np.testing.assert_allclose(casadi_map.rms(parameters, road, compiled=True), expected, rtol=1e-11)


@needs_casadi
def test_gradient_of_casadi_is_right():
    parameters, road = some("besinger", cars=1)
    expected = gradients_by_jax(parameters, road)[0]
    for mode in ("forward", "reverse"):
        np.testing.assert_allclose(casadi_map.gradient(parameters[0], road, mode=mode), expected, rtol=1e-8)


def test_peers_that_are_not_installed_say_so(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(c.shutil, "which", lambda name: None)
    assert not (c.available() or casadi_map.available() or scipy_numba.available())
    parameters, road = some("besinger", cars=1, duration=0.01)
    with pytest.raises(RuntimeError, match="gcc was not found"):
        c.rk4("besinger", parameters, road, lanes=4)
    with pytest.raises(ModuleNotFoundError, match="casadi is not installed"):
        casadi_map.rms(parameters, road)
    with pytest.raises(ModuleNotFoundError, match="numba is not installed"):
        scipy_numba.rms("besinger", parameters, road)
