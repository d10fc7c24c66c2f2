"""How laws with states start in a record: at rest, after a warm-up cycle, in the periodic solution; rest itself."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import parameters
from jaxdamp.bench import RandomTest, SineTest, VirtualDyno
from jaxdamp.dampers import BoucWen, CoulombFriction, Lag, Linear, SeriesSpring, Sum
from jaxdamp.identify import fit, model, prepare
from jaxdamp.identify.initial_states import Cycle, periodic_state, start_of
from jaxdamp.identify.predicting import predict_runs
from jaxdamp.parameters import free_parameters
from jaxdamp.rig import Rig


SLOW_LAG = Lag(Linear(2000.0), 0.5)
OF_BOTH = Sum((Lag(Linear(2000.0), 0.5), SeriesSpring(Linear(2000.0), 1e6)))


def cut_out(law, tests, noise=0.0, sampling_rate=400.0, cycles=2.3):
    """Records of a few cycles from the end of a long motion, which begin and end within a cycle."""
    runs = VirtualDyno(law, force_noise=noise, sampling_rate=sampling_rate).run(tests)
    ends = [(run.duration - (cycles + 0.137) / run.frequency, run.duration - 0.137 / run.frequency) for run in runs]
    return [run.process(between=between) for run, between in zip(runs, ends, strict=True)]


@pytest.fixture(scope="module")
def lag_runs():
    return cut_out(SLOW_LAG, [SineTest(0.02, 2.0, cycles=12)])


def test_a_record_cut_out_of_a_long_motion_is_fitted_without_bias(lag_runs):
    periodic = fit(Lag(Linear(2600.0), 0.65), lag_runs, initial_state="periodic", starts=1)
    found = parameters.get(periodic.law, "law.rate"), parameters.get(periodic.law, "lag_time")
    assert found == pytest.approx((2000.0, 0.5), rel=5e-3)
    assert periodic.criterion == "all records start in the periodic solution"
    assert periodic.score(lag_runs)[1] == pytest.approx(periodic.rmse) and periodic.fit_percent > 99.9
    warmed_up = fit(Lag(Linear(2600.0), 0.65), lag_runs, starts=1)
    assert warmed_up.criterion == "" and abs(float(parameters.get(warmed_up.law, "lag_time")) / 0.5 - 1.0) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "tests", "frozen"),
    [
        (SeriesSpring(Linear(20_000.0), 1e4) + Linear(500.0), [SineTest(0.02, 2.0, cycles=40)], ["cubic_stiffness"]),
        (
            BoucWen(1500.0, 2000.0, 120.0, 0.004),
            [SineTest(0.002, 1.0, cycles=30), SineTest(0.01, 2.0, cycles=30)],
            ["exponent"],
        ),
    ],
    ids=["series spring", "Bouc-Wen"],
)
@pytest.mark.exhaustive_cases("Bouc-Wen")
def test_laws_with_states_are_identified_from_few_cycles(law, tests, frozen):
    runs = cut_out(law, tests, noise=2.0, sampling_rate=400.0)
    free = free_parameters(law, freeze=frozen)
    result = fit(free.build(1.2 * free.values), runs, freeze=frozen, initial_state="periodic", starts=1)
    for value, e in zip(free.values, result.parameters, strict=True):
        assert abs(e.value - value) < 3.5 * e.standard_error, e


@pytest.mark.parametrize(
    "law",
    [SLOW_LAG, pytest.param(BoucWen(1500.0, 2000.0, 120.0, 0.005), marks=pytest.mark.slow)],
    ids=["lag", "Bouc-Wen"],
)
def test_the_periodic_solution_is_that_after_many_cycles_and_so_are_its_derivatives(law):
    phase = jnp.linspace(0.0, 2.0 * jnp.pi, 101) + 0.3
    motion = Cycle(jnp.asarray(5e-3), 0.005 * jnp.sin(phase), 0.005 * 4 * jnp.pi * jnp.cos(phase), jnp.asarray(True))
    free = free_parameters(law)

    def after_many(values):
        law = free.build(values)

        def step(state, k):
            x, v = motion.stroke, motion.velocity
            return law.advance(x[k], v[k], x[k + 1], v[k + 1], state, motion.dt), None

        return jax.lax.scan(step, law.initial_state(), jnp.tile(jnp.arange(100), 60))[0]

    def settled(values):
        return periodic_state(free.build(values), motion)[0]

    for ours, slow in ((settled, after_many), (jax.jacfwd(settled), jax.jacfwd(after_many))):
        expected = np.asarray(jax.jit(slow)(free.values))
        np.testing.assert_allclose(jax.jit(ours)(free.values), expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


def test_a_short_rest_is_a_start_at_rest():
    law = BoucWen(1500.0, 2000.0, 120.0, 0.0015)
    runs = list(VirtualDyno(law, sampling_rate=1000.0).run(SineTest(0.02, 1.0, cycles=2, rest_before=0.4, run_up=0.5)))
    assert start_of(runs[0], "warm_up") == "rest"
    assert np.abs(predict_runs(law, runs)[0] - runs[0].force).max() < 1.0
    assert np.count_nonzero(prepare(law, runs).used) == len(runs[0]) // 2  # means of two samples


def test_rest_is_left_out_for_laws_without_states():
    """Dry friction holds 35 N at rest, which a law of the velocity would take for an offset."""
    ends: dict[str, Any] = {"rest_before": 1.0, "run_up": 0.5, "run_down": 0.5, "rest_after": 1.0}
    law = Linear(1500.0) + CoulombFriction(40.0, 0.01)
    raw = VirtualDyno(law, force_noise=1.0, sampling_rate=400.0).run(SineTest(0.02, 1.0, cycles=2, **ends))[0]
    resting = np.abs(raw.velocity) < 1e-9
    run = dataclasses.replace(raw, force=raw.force + 35.0 * resting)
    result = fit(law, run, rig=Rig(force_offset=1.0))
    assert abs(result["force_offset"].value) < 3.0 * result["force_offset"].standard_error
    assert result.criterion.startswith("rest left out: ")
    moving = fit(law, run.process(moving=True), rig=Rig(force_offset=1.0))
    assert result["rate"].value == pytest.approx(moving["rate"].value, rel=1e-9) and moving.criterion == ""


def test_what_is_no_periodic_record_is_named(lag_runs):
    random = VirtualDyno(Linear(1500.0), sampling_rate=400.0).run(RandomTest(duration=2.0))[0]
    assert start_of(random, "periodic") == "warm_up" and start_of(lag_runs[0], "periodic") == "periodic"
    with pytest.raises(ValueError, match="`initial_state` must be one of"):
        prepare(SLOW_LAG, lag_runs, initial_state="steady")


def test_states_are_counted_once_for_laws_that_differ_in_their_numbers():
    assert [model.count_states(law) for law in (Linear(1.0), Lag(Linear(1.0), 0.1), OF_BOTH)] == [0, 1, 2]
    counted = model._count_states.cache_info().misses
    assert model.count_states(Lag(Linear(2.0), 0.3)) == jax.jit(model.count_states)(Lag(Linear(3.0), 0.2)) == 1
    assert model._count_states.cache_info().misses == counted
