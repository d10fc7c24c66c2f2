import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray

import jaxdamp
from jaxdamp._jacobian import choose_mode, value_and_jacobian
from jaxdamp.sweeps.function import trace

from .cases import AXES, decay


@pytest.mark.parametrize("mode", ["forward", "reverse", True])
def test_derivatives_equal_the_closed_form_and_differences(mode):
    data = jaxdamp.sweep(decay(), AXES, gradients=mode)
    assert set(data.data_vars) == {"sum", "square", "profile", "d_sum", "d_square"}
    assert data["d_sum"].dims == ("a", "b", "parameter") and list(data["parameter"].values) == ["a", "b"]
    rates = np.asarray(decay().rates)
    a, b = (np.asarray(v) for v in np.meshgrid(AXES["a"], AXES["b"], indexing="ij"))
    powers = np.exp(-a[..., None] * rates)
    exact = np.stack([-b * np.sum(rates * powers, -1), np.sum(powers, -1)], -1)
    np.testing.assert_allclose(data["d_sum"], exact, rtol=1e-12)
    np.testing.assert_allclose(data["d_square"], np.stack([0 * b, 2 * b], -1), rtol=1e-12)
    h = 1e-5
    shifted = [jaxdamp.sweep(decay(), {**AXES, "a": np.array(AXES["a"]) + s})["sum"].values for s in (-h, h)]
    np.testing.assert_allclose(data["d_sum"].sel(parameter="a"), (shifted[1] - shifted[0]) / (2 * h), atol=1e-8)
    assert data["d_sum"].attrs["units"] == "m per unit of the parameter"


def test_values_with_and_without_derivatives_are_the_same():
    plain, with_slopes = jaxdamp.sweep(decay(), AXES), jaxdamp.sweep(decay(), AXES, gradients=True)
    xarray.testing.assert_allclose(with_slopes[["sum", "square", "profile"]], plain[list(plain.data_vars)], rtol=1e-13)


def test_a_derivative_that_is_not_finite_is_a_failure():
    with pytest.warns(UserWarning, match="1 of 2 points"):
        data = jaxdamp.sweep(lambda p: {"y": jnp.sqrt(p["a"])}, {"a": [0.0, 4.0]}, gradients=True)
    np.testing.assert_array_equal(data["y"], [0.0, 2.0])
    np.testing.assert_array_equal(data["d_y"][:, 0], [np.nan, 0.25])


def test_results_without_derivative():
    data = jaxdamp.sweep(lambda p: {"n": jnp.sum(p["a"] > 1.0), "y": p["a"]}, {"a": [0.0, 4.0]}, gradients=True)
    assert set(data.data_vars) == {"n", "y", "d_y"}
    with pytest.raises(ValueError, match="leave the name 'd_y' to the derivative"):
        jaxdamp.sweep(lambda p: {"d_y": p["a"], "y": p["a"]}, {"a": [0.0, 4.0]}, gradients=True)


@pytest.mark.parametrize("mode", ["forward", "reverse"])
@pytest.mark.parametrize("shape", [(), (5,)])
def test_jacobians_of_points_and_batches(mode, shape, rng):
    def function(p):
        y = jnp.sin(p["a"]) * p["b"]
        return {"y": y, "v": jnp.stack([y * y, p["b"], jnp.ones_like(y)]), "count": jnp.asarray(3)}

    point = {name: jnp.asarray(rng.uniform(0.5, 1.5, shape)) for name in "ab"}
    values, slopes = value_and_jacobian(jax.vmap(function) if shape else function, point, mode)
    jacobian = jax.jacfwd(lambda p: {k: v for k, v in function(p).items() if k != "count"})
    expected = jax.vmap(jacobian)(point) if shape else jacobian(point)
    assert set(values) == {"y", "v", "count"} and set(slopes) == {"y", "v"}
    for result, by in slopes.items():
        for name in "ab":
            np.testing.assert_allclose(by[name], expected[result][name], rtol=1e-14, atol=1e-300)


def test_the_function_is_computed_once_for_all_tangents():
    """The primal numbers keep the shape of the lanes; only tangents have the axis of the inputs."""
    lanes = {"a": jnp.ones(32), "b": jnp.ones(32)}
    function = jax.vmap(lambda p: {"y": jnp.exp(p["a"]) * p["b"]})
    jaxpr = jax.make_jaxpr(lambda p: value_and_jacobian(function, p))(lanes)
    exponentials = [eqn for eqn in jaxpr.jaxpr.eqns if eqn.primitive.name == "exp"]
    assert [eqn.outvars[0].aval.shape for eqn in exponentials] == [(32,)]


def test_mode_by_the_number_of_inputs_and_results():
    assert choose_mode(2, 1) == choose_mode(12, 6) == "forward" and choose_mode(3, 1) == choose_mode(13, 6) == "reverse"


@pytest.mark.parametrize(("steps", "mode"), [(lambda a: 3, "reverse"), (lambda a: jnp.int32(a) + 3, "forward")])
def test_loops_of_unknown_length_are_differentiated_forward(steps, mode):
    """A loop whose length depends on the point has no reverse derivative."""

    def function(p):
        total = p["a"] + 2.0 * p["b"] + 3.0 * p["c"]
        return {"y": jax.lax.fori_loop(0, steps(p["a"]), lambda _, y: 2.0 * y, total)}

    assert trace(function, ["a", "b", "c"], True).mode == mode
    data = jaxdamp.sweep(function, {"a": [0.5], "b": [0.1], "c": [0.2]}, gradients=True)
    np.testing.assert_allclose(data["d_y"].values.ravel(), [8.0, 16.0, 24.0], rtol=1e-14)
