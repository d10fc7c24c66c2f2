"""A run that goes on where an earlier one stopped: parts are the whole."""

import pickle
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers, metrics, roads, simulate
from jaxdamp.dampers import BoucWen, Lag, Linear
from jaxdamp.parameters import replace
from jaxdamp.simulation import AbstractEngine, Adaptive, Exponential, Outcome
from jaxdamp.simulation.equations import STRAIGHT
from jaxdamp.vehicles import QuarterCar, presets


ROAD = roads.iso8608("C", 20.0, 1.0, seed=1)
FRICTION = Linear(1500.0) + dampers.CoulombFriction(300.0, 1e-3)
LAG = presets.quarter_car_000(Lag(Linear(2500.0), 0.004))
CARS = {
    "several steps between two instants": presets.quarter_car_000(FRICTION),
    "states and two axles": presets.half_car_002(BoucWen(800.0, 2000.0, 300.0, 1e-3, 0.75, 1.5)),
    "extrapolated states": LAG,
    "a tyre that lifts off": QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(1500.0), 500.0, tyre_lifts=True),
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name not in ("extrapolated states",))) for name in CARS],
)
def test_parts_are_the_whole_to_rounding(name):
    car = CARS[name]
    whole = simulate(car, ROAD, duration=0.2, every=2)
    first, state = simulate(car, ROAD, duration=0.1, every=2, return_state=True)
    assert float(state.time) == 0.1
    second = simulate(car, ROAD, duration=0.1, every=2, state=pickle.loads(pickle.dumps(state)))
    for channel in ("time", "motion", "port_force", "road", "road_rate"):
        ahead, after, expected = (getattr(run, channel) for run in (first, second, whole))
        parts = np.concatenate([ahead, after[1:]])
        np.testing.assert_allclose(parts, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max(), err_msg=channel)
        np.testing.assert_allclose(ahead[-1], after[0], rtol=1e-12, atol=1e-12)
    for here, there in zip(second.final_state, whole.final_state, strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-11)


def test_displacements_of_a_part_count_from_where_the_run_began():
    first, state = simulate(LAG, ROAD, duration=0.1, return_state=True)
    _, state = simulate(LAG, ROAD, duration=0.05, state=state, return_state=True)
    third = simulate(LAG, ROAD, duration=0.05, state=state)
    names = ["peak_sprung_displacement", "rms_sprung_displacement"]
    z = np.asarray(third["z_sprung"]) - float(first["z_sprung"][0])
    found = third.metrics(names)
    assert float(found[names[0]]) == pytest.approx(np.abs(z).max(), rel=1e-9)
    part = third.between(0.175, 0.2).metrics(names)
    assert float(part[names[1]]) == pytest.approx(np.sqrt(np.mean(z[25:] ** 2)), rel=1e-9)


def test_the_interval_is_exact_in_single_precision_late_in_a_run():
    """Instants of single precision at 600 s are 0.06 ms apart from one number to the next."""
    with jax.enable_x64(False):
        car, road = presets.quarter_car_000(), roads.sine(0.01, frequency=3.0)
        _, state = simulate(car, road, duration=0.02, return_state=True)
        late = eqx.tree_at(lambda state: state.time, state, jnp.asarray(600.0))
        run = simulate(car, road, duration=0.2, state=late)
        assert run.time.dtype == np.float32 and run.between(600.05, 600.15).time.size == 101
        felt = run.comfort()["sprung_acceleration"].weighted_rms
        energy, moved = run.energy_balance(), np.asarray(run.motion[:, 2:] @ run.system.form.ports.T, float)[:, 0]
    acceleration = np.asarray(run["sprung_acceleration"], float)
    wanted = metrics.weighted_rms(acceleration, 1e-3, "Wk", method="step", remove_mean=False)
    assert float(felt) == pytest.approx(float(wanted), rel=1e-5)
    work = np.trapezoid(np.asarray(run.port_force[:, 0], float) * moved, dx=1e-3)
    assert float(energy["absorbed"]) == pytest.approx(work, rel=1e-5)


@pytest.mark.slow
def test_parts_of_other_steps_and_other_numbers_agree_as_well_as_the_steps_do():
    whole = simulate(LAG, ROAD, duration=0.2)["stroke"]
    _, state = simulate(LAG, ROAD, duration=0.1, return_state=True)
    finer = simulate(LAG, ROAD, duration=0.1, dt=5e-4, state=state)
    assert float(finer.time[1]) == pytest.approx(0.1005, rel=1e-12)
    np.testing.assert_allclose(finer["stroke"][::2], whole[100:], atol=1e-3 * np.abs(whole).max())
    finest = simulate(LAG, ROAD, duration=0.1, dt=5e-4, substeps=16, state=state).motion[1]  # by the ratio of the steps
    np.testing.assert_allclose(finer.motion[1], finest, atol=1e-5 * np.abs(finest).max())
    stiffer = simulate(replace(LAG, {"damper.law.rate": 5000.0}), ROAD, duration=0.1, state=state)
    np.testing.assert_array_equal(stiffer.motion[0], state.now.motion)
    assert np.abs(stiffer["stroke"] - whole[100:]).max() > 0.1 * np.abs(whole).max()


def test_a_solver_goes_on_within_its_tolerances():
    engine = Adaptive(rtol=1e-8, atol=1e-10)
    whole = simulate(LAG, ROAD, duration=0.1, engine=engine)
    _, state = simulate(LAG, ROAD, duration=0.05, engine=engine, return_state=True)
    second = simulate(LAG, ROAD, duration=0.05, engine=engine, state=state)
    np.testing.assert_allclose(second.motion, whole.motion[50:], atol=1e-7 * np.abs(whole.motion).max())


@pytest.mark.slow
def test_parts_go_on_in_a_scan_in_a_batch_and_with_derivatives():
    def last(rate):
        car = presets.quarter_car_000(Lag(Linear(rate), 0.004))

        def part(state, _):
            run, state = simulate(car, ROAD, duration=0.02, substeps=1, state=state, return_state=True)
            return state, run["stroke"][1:]

        first, state = simulate(car, ROAD, duration=0.02, substeps=1, return_state=True)
        return jnp.concatenate([first["stroke"], jax.lax.scan(part, state, None, length=3)[1].ravel()])

    rates = jnp.asarray([900.0, 2500.0])
    found, slope = jax.vmap(lambda rate: jax.jvp(last, (rate,), (jnp.ones(()),)))(rates)

    def whole(rate):
        return simulate(presets.quarter_car_000(Lag(Linear(rate), 0.004)), ROAD, duration=0.08, substeps=1)["stroke"]

    expected = jax.vmap(lambda rate: jax.jvp(whole, (rate,), (jnp.ones(()),)))(rates)
    np.testing.assert_allclose(found, expected[0], rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(slope, expected[1], rtol=1e-9, atol=1e-16)


def test_the_rest_of_a_road_is_driven_to_its_end():
    road = roads.from_profile(0.5 * np.arange(5.0), 0.01 * np.sin(np.arange(5.0)), speed=10.0)  # 0.2 s
    first, state = simulate(LAG, road, duration=0.15, return_state=True)
    second, end = simulate(LAG, road, state=state, return_state=True)
    assert float(end.time) == pytest.approx(0.2) and np.all(np.isfinite(second.road_rate))
    np.testing.assert_array_equal(first.motion[-1], second.motion[0])


class Silent(AbstractEngine):
    """An engine that does not say where it stopped."""

    @property
    def derivatives(self):
        return ("forward",)

    def run(self, equations, heights, dt, start, observer, edges=STRAIGHT):
        outcome = Exponential().run(equations, heights, dt, start, observer, edges)
        return Outcome(outcome.gathered, outcome.records, outcome.states)


def test_what_cannot_go_on_is_refused():
    _, state = simulate(LAG, ROAD, duration=0.02, return_state=True)
    cases: list[tuple[dict[str, Any], str]] = [
        ({"start": {"z_sprung": 0.1}}, r"`start` must be left out"),
        ({"engine": Adaptive()}, r"`state` must be of a run by Adaptive, but is of one by Exponential"),
        ({"duration": ROAD.longest_run}, r"`duration` must not be longer than the random road"),
    ]
    for options, said in cases:
        with pytest.raises(ValueError, match=said):
            simulate(LAG, ROAD, **({"duration": 0.02, "state": state} | options))
    with pytest.raises(ValueError, match=r"`state` must have motion and states of the shapes"):
        simulate(CARS["states and two axles"], ROAD, duration=0.02, state=state)
    with pytest.raises(ValueError, match=r"`return_state` must be left out beside a Silent"):
        simulate(LAG, ROAD, duration=0.02, engine=Silent(), return_state=True)
