"""What one vehicle needs once is compiled without optimisation, and in other functions as a part of these."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import _quickly, dampers, roads, tune, vehicles
from jaxdamp._quickly import compiled_quickly
from jaxdamp.simulation import Ride


AT = np.linspace(0.1, 2.0, 5)


@pytest.fixture
def squared() -> Callable:
    return compiled_quickly(lambda x: x * jnp.sin(x))


def test_it_is_the_same_function_alone_and_inside_others(squared: Callable) -> None:
    expected = AT * np.sin(AT)
    np.testing.assert_allclose([squared(x) for x in AT], expected, rtol=1e-14)
    np.testing.assert_allclose(jax.vmap(squared)(AT), expected, rtol=1e-14)
    np.testing.assert_allclose(jax.jit(jax.vmap(squared))(AT), expected, rtol=1e-14)
    np.testing.assert_allclose(jax.jit(lambda: squared(AT[1]))(), expected[1], rtol=1e-14)  # of a known number
    np.testing.assert_allclose(jax.grad(squared)(AT[2]), np.sin(AT[2]) + AT[2] * np.cos(AT[2]), rtol=1e-14)


def test_only_what_is_small_and_called_by_itself_takes_the_options(monkeypatch: pytest.MonkeyPatch) -> None:
    """An option that there is not is refused where it is used, and only there."""
    monkeypatch.setattr(_quickly, "OPTIONS", {0: {"xla_no_such_option": 0}, 1: {"xla_no_loop_option": 0}, None: None})
    make = functools.partial(compiled_quickly, jnp.sum, lambda x: None if x.size == 3 else x.size - 1)
    function = make()
    assert float(function(jnp.ones(3))) == 3.0 and float(jax.jit(function)(jnp.ones(1))) == 1.0
    with pytest.raises(Exception, match="xla_no_such_option"):
        function(jnp.ones(1))
    monkeypatch.setenv("XLA_FLAGS", "--xla_backend_optimization_level=2")  # stated by the user
    assert float(function(jnp.ones(2))) == 2.0
    monkeypatch.delenv("XLA_FLAGS")
    with pytest.raises(Exception, match="xla_no_loop_option"):
        make()(jnp.ones(2))


@pytest.mark.slow
def test_a_ride_on_a_white_road_is_one_function_in_a_loop_a_batch_and_a_program() -> None:
    road = roads.white("C", 20.0)
    ride = Ride(vehicles.presets.quarter_car_000(dampers.Bilinear(2600.0, 1200.0)), road)
    masses = np.array([1100.0, 1300.0])
    name = "rms_dynamic_tyre_load"
    alone = [ride({"sprung_mass": mass})[name] for mass in masses]
    batch = jax.vmap(lambda mass: ride({"sprung_mass": mass})[name])(masses)
    np.testing.assert_allclose(batch, alone, rtol=1e-9)
    np.testing.assert_allclose(jax.jit(lambda: ride({"sprung_mass": 1300.0})[name])(), alone[1], rtol=1e-9)
    conditions = {str(mass): tune.Condition({"sprung_mass": mass}) for mass in masses.tolist()}
    each = tune.Scenarios([road], conditions).ride(ride.vehicle, metrics=[name]).each()
    np.testing.assert_allclose(each[name], alone, rtol=1e-9)
