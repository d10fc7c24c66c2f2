"""Rides of the published vehicles: eager, compiled, batched, forward and reverse are one result."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import roads, simulate
from jaxdamp.parameters import parameters, replace
from jaxdamp.vehicles import AbstractVehicle, presets


ROAD = roads.superposed(*[roads.in_phase(roads.sine(0.01, frequency=frequency)) for frequency in (1.3, 7.1)])
DURATION, DT = 0.04, 1e-3
CARS = {
    name: make
    for name, make in vars(presets).items()
    if getattr(make, "__module__", "") == presets.__name__ and not name.startswith("_")
}


def free_number(car: AbstractVehicle) -> tuple[str, float]:
    """A parameter of the first damper, and its value."""
    found = [p for p in parameters(car) if "damper" in p.path and p.value.shape == ()]
    chosen = (found or [p for p in parameters(car) if p.value.shape == ()])[0]
    return chosen.path, float(chosen.value)


@pytest.mark.slow_one_in(2)
@pytest.mark.parametrize("name", CARS)
def test_a_ride_is_one_result_however_it_is_transformed(name):
    car = CARS[name]()
    path, start = free_number(car)

    def motion(share):
        run = simulate(replace(car, {path: start * share}), ROAD, duration=DURATION, dt=DT, substeps=1)
        return run.motion[-1]

    one = jnp.ones(())
    eager, compiled = motion(one), jax.jit(motion)(one)
    size = np.max(np.abs(eager))
    np.testing.assert_allclose(compiled, eager, rtol=0, atol=1e-12 * size)
    forward = jax.jvp(motion, (one,), (one,))[1]
    slope = np.max(np.abs(forward))
    found = {
        "compiled, forward": jax.jit(jax.jacfwd(motion))(one),
        "reverse": jax.jacrev(motion)(one),
        "batched, reverse": jax.vmap(jax.jacrev(motion))(jnp.ones(2))[1],
    }
    for how, derivative in found.items():
        np.testing.assert_allclose(derivative, forward, rtol=0, atol=1e-9 * slope, err_msg=how)
    step = 1e-4
    differences = (motion(one + step) - motion(one - step)) / (2 * step)
    np.testing.assert_allclose(differences, forward, rtol=0, atol=1e-4 * slope)
