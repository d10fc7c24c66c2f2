"""How long a run is and which instants it saves: the end of the road, less than a second, strides."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, dampers, roads, simulate
from jaxdamp.parameters import replace
from jaxdamp.simulation import Adaptive, Exponential
from jaxdamp.simulation.run import sampled
from jaxdamp.vehicles.presets import m113_003, quarter_car_000


BUMP = roads.cosine_bump(0.06, start=0.1, duration=0.25)
LAG = dampers.Lag(dampers.Linear(2500.0) + dampers.CoulombFriction(80.0, 0.02), 0.004)


def test_duration_of_the_road_is_used():
    road = roads.from_profile(np.linspace(0, 0.5, 501), np.zeros(501))
    assert float(simulate(quarter_car_000(), road).time[-1]) == pytest.approx(0.5)


@pytest.mark.parametrize(("speed", "steps"), [(24.5, 244), (24.0, 250), (5.0, 1200)])
def test_the_last_instant_of_a_run_is_not_beyond_the_road(speed, steps):
    """6 m take 0.24490, 0.25 and 1.2 s: as many whole steps as there are, and all of them where nothing is left."""
    road = roads.from_profile(np.linspace(0.0, 6.0, 61), np.zeros(61), speed=speed)
    assert sampled(quarter_car_000(), road, None, 1e-3)[0].size == steps + 1
    assert sampled(quarter_car_000(), road, None, 1e-3, jnp.asarray(100e-3))[0].size == steps - 99


def test_a_run_that_ends_before_its_bump_says_so():
    late = roads.superposed(roads.cosine_bump(0.06, start=1.0, duration=0.25), roads.step(0.05, start=1.2))
    with pytest.warns(UserWarning, match="level for the whole run of 0.8 s: its bump comes later"):
        Ride(quarter_car_000(), late, duration=0.8)
    first, state = simulate(quarter_car_000(), late, duration=0.8, return_state=True)
    assert first.notes == ("Nothing moves, as the road stays level. If it has a bump later, pass a longer `duration`.",)
    assert not simulate(quarter_car_000(), late, duration=0.8, state=state).notes


def test_comfort_of_less_than_a_second_has_no_largest_second():
    response = simulate(quarter_car_000(), BUMP, duration=0.8)
    comfort = response.comfort()["sprung_acceleration"]
    assert comfort.weighted_rms > 0.0 and np.isnan(comfort.max_transient_value) and comfort.vibration_dose_value > 0.0
    assert np.isnan(jax.jit(lambda r: r.comfort())(response)["sprung_acceleration"].max_transient_value)
    said = json.loads(json.dumps(response.to_dict(), allow_nan=False))["comfort"]["sprung_acceleration"]
    assert said["max_transient_value"]["value"] is None
    assert "max transient value" in str(response.comfort_table())


@pytest.mark.parametrize("engine", [Exponential(), Adaptive()], ids=["exponential", "adaptive"])
@pytest.mark.exhaustive_cases("adaptive")
def test_a_run_saved_with_stride_is_every_so_many_th_instant_of_the_run(engine):
    """Tyre damping included: what it hears of the road is the slope at the instant, not over the stride."""
    car = replace(quarter_car_000(LAG), {"tyre_damping": 300.0})
    whole, tenth = (simulate(car, BUMP, duration=0.6, dt=2e-3, engine=engine, every=every) for every in (1, 10))
    assert tenth.time.shape == (31,) and float(tenth.time[-1]) == pytest.approx(0.6)
    for name, channel in whole.channels.items():
        size = float(jnp.max(jnp.abs(channel)))
        np.testing.assert_allclose(tenth[name], channel[::10], atol=1e-12 * size, err_msg=name)
    for here, there in zip(tenth.final_state, whole.final_state, strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-12)
    parts = tenth.energy_balance()
    assert abs(float(parts["error"])) < 0.05 * float(parts["road_work"])


@pytest.mark.slow
def test_energies_of_a_run_saved_with_stride_are_estimates_of_the_same():
    """Of dampers at the road, whose rate is not its slope over a stride."""
    road = roads.iso8608("C", speed=15.0, seed=1)
    whole, tenth = (simulate(m113_003(), road, duration=2.0, every=every) for every in (1, 10))
    for name, energy in whole.absorbed_by().items():
        assert float(tenth.absorbed_by()[name]) == pytest.approx(float(energy), rel=0.01)
    balance = tenth.energy_balance()
    assert abs(float(balance["error"])) < 1e-3 * float(balance["road_work"])
    assert float(balance["road_work"]) == pytest.approx(float(whole.energy_balance()["road_work"]), rel=0.01)
