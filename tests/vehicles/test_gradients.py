"""Ride metrics of a simulation, differentiated in every physical parameter, against differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers, metrics, roads, simulate
from jaxdamp.parameters import parameters, replace

from .by_hand import CASES
from .fleet import bumps, full_quarter_car


pytestmark = pytest.mark.slow

STEPS, DT = 500, 1e-3


def sloped(response):
    """All ride metrics but counts, which have no slope."""
    names = [m.name for m in response.vehicle.ride_metrics if metrics.STATISTICS[m.statistic].differentiable]
    return response.metrics(names).values()


def ridden(vehicle, behind, right):
    """Paths of the vehicle's parameters, and its run with each of them multiplied by the exponential of a number."""
    heights = bumps(0.05 + 0.1 * np.asarray(behind), count=STEPS + 1, height=0.05, width=0.15)
    heights = heights * np.where(right, 0.4, 1.0)
    road = roads.from_profile(DT * np.arange(STEPS + 1), heights)
    known = [p for p in parameters(vehicle) if np.ndim(p.value) == 0 and float(p.value) != 0.0]
    values = jnp.array([float(p.value) for p in known])

    def run(shares):
        changed = replace(vehicle, {p.path: v for p, v in zip(known, values * jnp.exp(shares), strict=True)})
        return simulate(changed, road, dt=DT)

    return [p.path for p in known], run


def difference(function, direction, step=2e-5):
    """Central, of fourth order."""
    near, far = ((function(h * direction) - function(-h * direction)) / (2 * h) for h in (step, 2 * step))
    return (4 * near - far) / 3


def test_every_metric_in_every_parameter_of_a_quarter_car_with_everything():
    car = full_quarter_car(
        damper=dampers.MotionRatio(dampers.Lag(dampers.Bilinear(1900.0, 1100.0, knee_width=0.02), 4e-3), 0.9),
        bump_stop=dampers.BumpStop(0.02, 4e4, 1e7, damping=200.0, end="both"),
    )
    paths, run = ridden(car, [0.0], [False])

    def metrics(shares):
        ride = run(shares)
        return jnp.stack([*sloped(ride), *ride.comfort()["sprung_acceleration"]])

    assert len(paths) >= 15 and {"friction.friction_velocity", "damper.law.lag_time"} <= set(paths)
    value, jacobian = jax.jit(metrics), jax.jit(jax.jacfwd(metrics))(jnp.zeros(len(paths)))
    level = np.asarray(value(jnp.zeros(len(paths))))
    found = np.asarray(jacobian) / level[:, None]
    assert np.all(np.abs(found).max(axis=0) > 1e-5)  # every parameter counts in some metric
    for i, path in enumerate(paths):
        expected = np.asarray(difference(value, jnp.eye(len(paths))[i])) / level
        np.testing.assert_allclose(found[:, i], expected, rtol=1e-4, atol=1e-6, err_msg=path)


@pytest.mark.parametrize("name", ["full car", "walking beam", "tracked hull"])
def test_every_metric_of_a_vehicle_along_a_direction_in_all_parameters(name, rng):
    paths, run = ridden(CASES[name].vehicle, CASES[name].behind, CASES[name].right)
    direction = jnp.asarray(rng.uniform(0.3, 1.0, len(paths)) * rng.choice([-1.0, 1.0], len(paths)))

    def metrics(shares):
        return jnp.stack([*sloped(run(shares))])

    both = jax.jit(lambda shares: jax.jvp(metrics, (shares,), (direction,)))
    level, slope = both(jnp.zeros(len(paths)))
    assert len(paths) >= 5 and np.all(np.asarray(level) > 0.0)
    expected = difference(lambda shares: both(shares)[0], direction)
    np.testing.assert_allclose(slope / level, expected / level, rtol=1e-4, atol=1e-6)
