"""One result, eager or traced: substeps, step checks and domains are decided by the numbers behind tracers."""

from typing import final

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, dampers, roads, simulate
from jaxdamp._types import Number
from jaxdamp.dampers import AbstractStateful
from jaxdamp.parameters import parameter, positive
from jaxdamp.simulation import Adaptive, TracedStepWarning, substeps_needed
from jaxdamp.vehicles.presets import quarter_car_000


ROAD = roads.iso8608("C", 20.0, 1.0, seed=1, amplitudes="fixed")
RMS = "rms_sprung_acceleration"


@final
class Filling(AbstractStateful):
    """F = c y, T ẏ = v − y: an explicit step, with a time constant that may be short."""

    rate: Number = parameter("N s/m", "c", positive)
    time: Number = parameter("s", "T", positive)

    def initial_state(self):
        return jnp.zeros(1)

    def force(self, x, v, state):
        return self.rate * state[0]

    def state_rate(self, x, v, state):
        return ((v - state[0]) / self.time)[None]

    def traits(self):
        return super().traits()._replace(has_feed_through=False)


LAWS = {
    "slow friction": (lambda c: dampers.Linear(1500.0) + dampers.CoulombFriction(c, 5e-3), 50.0, 1),
    "friction": (lambda c: dampers.Linear(1500.0) + dampers.CoulombFriction(c, 5e-4), 100.0, 2),
    "steep friction": (lambda c: dampers.Linear(1500.0) + dampers.CoulombFriction(c, 2e-4), 500.0, 23),
    "Dahl": (lambda c: dampers.Linear(1500.0) + dampers.Dahl(c, 200.0), 1e9, 3),
    "LuGre": (lambda c: dampers.LuGre(1e5, c, 200.0, 40.0, 60.0, 0.05), 2e5, 2),
    "explicit step": (lambda c: Filling(1500.0, c), 4e-4, 3),
}


def ride(law, **options):
    return Ride(quarter_car_000(law), ROAD, metrics=[RMS], duration=0.2, **options)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in ("friction", "LuGre"))) for name in LAWS]
)
def test_steps_are_divided_alike_however_a_number_is_traced(name):
    make, start, expected = LAWS[name]
    assert ride(make(start)).substeps == expected
    found = []

    def drive(c):
        found.append(ride(make(c)).substeps)
        return jnp.square(c)

    jax.grad(drive)(start)
    jax.jvp(drive, (start,), (1.0,))
    jax.linearize(drive, start)
    jax.hessian(drive)(start)
    for batch in (drive, jax.grad(drive)):
        jax.vmap(batch)(jnp.asarray([start, start]))
    jax.vmap(jax.vmap(drive))(jnp.asarray([[start], [start]]))
    jax.grad(lambda c: jax.vmap(drive)(c).sum())(jnp.asarray([start, start]))
    assert set(found) == {expected}


def test_of_a_batch_the_worst_car_counts():
    found = []

    def drive(c, velocity):
        law = dampers.CoulombFriction(c, velocity)
        found.append((ride(law).substeps, substeps_needed(quarter_car_000(law), 1e-3)))
        return c

    forces, velocities = jnp.asarray([50.0, 100.0]), jnp.asarray([5e-4, 5e-3])
    jax.vmap(drive)(forces, velocities)  # the steep one is not the strong one
    jax.vmap(lambda v: jax.vmap(drive, (0, None))(forces, v))(velocities)
    apart = [ride(dampers.CoulombFriction(c, v)).substeps for c, v in ((50.0, 5e-4), (100.0, 5e-4))]
    assert found == [(apart[0],) * 2, (apart[1],) * 2]


def test_value_and_derivative_of_a_car_with_friction():
    make, start, count = LAWS["steep friction"]
    plain = float(ride(make(start))()[RMS])

    def metric(c, **options):
        return ride(make(c), **options)()[RMS]

    value, slope = jax.value_and_grad(metric)(start)
    assert float(value) == pytest.approx(plain, rel=1e-9)
    near = [float(ride(make(start * share))()[RMS]) for share in (0.99, 1.01)]
    assert float(slope) == pytest.approx((near[1] - near[0]) / (0.02 * start), rel=0.1)
    compiled = jax.jit(lambda c: metric(c, substeps=count))
    assert float(compiled(start)) == pytest.approx(plain, rel=1e-9)
    with pytest.warns(TracedStepWarning, match=r"one step from instant to instant .*is assumed.*`substeps=`"):
        assumed = jax.eval_shape(metric, jnp.asarray(start))
    assert assumed.shape == ()


def test_what_is_no_argument_of_a_compiled_function_is_known_inside():
    car = quarter_car_000(LAWS["steep friction"][0](500.0))
    found = []

    def drive(scale):
        found.append(Ride(car, ROAD, duration=0.2).substeps)
        return scale

    jax.jit(drive)(1.0)
    assert found == [23]


def test_plain_numbers_are_known_inside_a_compiled_function():
    found = []

    def drive(scale):
        found.append(ride(LAWS["steep friction"][0](500.0)).substeps)
        return scale

    jax.jit(drive)(1.0)  # a `TracedStepWarning` would be an error here
    assert found == [23]


def test_an_adaptive_engine_says_what_it_cannot_check_of_a_traced_vehicle():
    def last(rate):
        car = quarter_car_000(dampers.Linear(rate))
        return simulate(car, ROAD, duration=0.1, dt=2e-3, engine=Adaptive(rtol=1e-4))["stroke"][-1]

    with pytest.warns(TracedStepWarning, match=r"whether instants every 0\.002 s resolve the road .* is not checked"):
        jax.eval_shape(last, jnp.asarray(1500.0))


def test_what_an_eager_run_refuses_a_derivative_and_a_batch_refuse():
    def steep(c):
        return simulate(quarter_car_000(dampers.CoulombFriction(c, 1e-5)), ROAD, duration=0.2)["stroke"][-1]

    def negative(c):
        return dampers.Linear(c).force_velocity(1.0)

    for run, value, said in ((steep, 500.0, "64 steps"), (negative, -5.0, "positive")):
        for traced in (run, jax.grad(run), lambda c, run=run: jax.vmap(run)(jnp.asarray([c, c]))):
            with pytest.raises(ValueError, match=said):
                traced(value)


def test_conditions_between_parameters_hold_for_each_of_a_batch():
    def gas(charge):
        return dampers.PiecewiseLinear(jnp.stack([-charge, charge]), jnp.ones(3)).force_velocity(0.1)

    assert np.all(np.isfinite(jax.vmap(gas)(jnp.asarray([0.1, 0.2]))))
    with pytest.raises(ValueError, match="increasing"):
        jax.vmap(gas)(jnp.asarray([0.1, -0.2]))
