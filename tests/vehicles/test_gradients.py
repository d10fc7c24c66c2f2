"""Ride metrics of a simulation, differentiated in every physical parameter, against differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers, roads, simulate
from jaxdamp.parameters import parameters, replace

from .by_hand import CASES
from .fleet import bumps, full_quarter_car


STEPS, DT = 500, 1e-3


def table(response):
    """All ride metrics but counts, which have no slope, and comfort but MTVV, which needs a second, by name."""
    names = [m.name for m in response.vehicle.ride_metrics if m.statistic.differentiable]
    comfort = {
        f"{name}/{k}": v
        for name, felt in response.comfort().items()
        for k, v in felt._asdict().items()
        if k != "max_transient_value"
    }
    return response.metrics(names) | comfort


def assert_slopes(found, expected, level, message=""):
    """Relative slopes agree; powers relative to the largest, as what only stores dissipates next to nothing."""
    largest = max(float(v) for name, v in level.items() if name.endswith("_dissipated_power"))
    sizes = {name: largest if name.endswith("_dissipated_power") else abs(float(v)) for name, v in level.items()}
    assert all(size > 0.0 for size in sizes.values())
    for name, size in sizes.items():
        error = f"{name} {message}"
        np.testing.assert_allclose(found[name] / size, expected[name] / size, rtol=1e-5, atol=1e-6, err_msg=error)


def ridden(vehicle, behind, right):
    """Paths of the vehicle's parameters, and its run with each of them multiplied by the exponential of a number."""
    heights = bumps(0.05 + 0.1 * np.asarray(behind), count=STEPS + 1, height=0.05, width=0.15)
    heights = heights * np.where(right, 0.4, 1.0)
    road = roads.from_profile(DT * np.arange(STEPS + 1), heights)
    known = [p for p in parameters(vehicle) if np.ndim(p.value) == 0 and float(p.value) != 0.0]
    values = jnp.array([float(p.value) for p in known])

    def run(shares):
        changed = replace(vehicle, {p.path: v for p, v in zip(known, values * jnp.exp(shares), strict=True)})
        return simulate(changed, road, dt=DT, substeps=1)

    return [p.path for p in known], run


def difference(function, direction, step=2e-5):
    """Central, of fourth order."""
    ends = [[function(sign * h * direction) for sign in (1.0, -1.0)] for h in (step, 2.0 * step)]
    near, far = (
        jax.tree.map(lambda a, b, h=h: (a - b) / (2.0 * h), *pair)
        for h, pair in zip((step, 2 * step), ends, strict=True)
    )
    return jax.tree.map(lambda a, b: (4.0 * a - b) / 3.0, near, far)


@pytest.mark.slow
def test_every_metric_in_every_parameter_of_a_quarter_car_with_everything():
    car = full_quarter_car(
        damper=dampers.MotionRatio(dampers.Lag(dampers.Bilinear(1900.0, 1100.0, knee_width=0.02), 4e-3), 0.9),
        bump_stop=dampers.BumpStop(0.02, 4e4, 1e7, damping=200.0, end="both"),
    )
    paths, run = ridden(car, [0.0], [False])
    assert len(paths) >= 15 and {"friction.friction_velocity", "damper.law.lag_time"} <= set(paths)
    value = jax.jit(lambda shares: table(run(shares)))
    level, jacobian = value(jnp.zeros(len(paths))), jax.jit(jax.jacfwd(value))(jnp.zeros(len(paths)))
    for i, path in enumerate(paths):
        found = {name: slopes[i] for name, slopes in jacobian.items()}
        assert max(abs(float(found[name] / level[name])) for name in found) > 1e-5, path  # counts in some metric
        assert_slopes(found, difference(value, jnp.eye(len(paths))[i]), level, path)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["full car", "walking beam", "tracked hull"])
def test_every_metric_of_a_vehicle_along_a_direction_in_all_parameters(name, rng):
    paths, run = ridden(CASES[name].vehicle, CASES[name].behind, CASES[name].right)
    assert len(paths) >= 5
    direction = jnp.asarray(rng.uniform(0.3, 1.0, len(paths)) * rng.choice([-1.0, 1.0], len(paths)))
    both = jax.jit(lambda shares: jax.jvp(lambda x: table(run(x)), (shares,), (direction,)))
    level, slope = both(jnp.zeros(len(paths)))
    assert_slopes(slope, difference(lambda shares: both(shares)[0], direction), level)
