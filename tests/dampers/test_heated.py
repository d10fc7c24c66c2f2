"""The temperature in steady motion, and a fit of a record in which a damper fades."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import bench, respond
from jaxdamp.dampers import Bilinear, Heated, Lag, Linear
from jaxdamp.identify import fit, fit_percent
from jaxdamp.parameters import replace
from jaxdamp.rig import Rig


def test_in_steady_motion_the_force_decays_to_that_of_the_power_that_cooling_carries_off():
    law = Heated(Linear(1000.0), sensitivity=0.01, cooling_time=2.0, static_force_slope=-0.5, heat_capacity=20.0)
    t = np.linspace(0.0, 30.0, 6001)
    force = np.asarray(respond(law, t, 0.2 * t, np.full_like(t, 0.2)))
    rise = 4.0  # solves ϑ = 40 W exp(−0.01 ϑ) · 2 s/20 J/K
    for _ in range(50):
        rise = 4.0 * np.exp(-0.01 * rise)
    np.testing.assert_allclose(force[-1], 200.0 * np.exp(-0.01 * rise) - 0.5 * rise, rtol=1e-6)
    np.testing.assert_allclose(force[0], 200.0, rtol=1e-12)


def test_a_damper_that_loses_a_twentieth_of_its_force_within_a_record_is_fitted_throughout():
    heat = Rig(temperature_slope=0.002, heating=9e-3, cooling=1 / 300, gas_force=-100.0, gas_temperature_slope=0.003)
    dyno = bench.VirtualDyno(Bilinear(2600.0, 1500.0, 0.01), 100.0, rig=heat, force_noise=3.0)
    (run,) = dyno.run([bench.SineTest(amplitude=0.02, frequency=1.5, cycles=120)])
    start = Heated(Bilinear(2000.0, 2000.0, 0.01), 0.001, 200.0)
    whole = {}
    for name, law, freeze in (("cold", start.law, []), ("heated", start, ["initial_rise"])):
        result = fit(law, run, rig=Rig(gas_force=-50.0), freeze=freeze, samples_per_cycle=40, starts=1)
        late = run.time > run.time[-1] - 5.0
        whole[name] = fit_percent([run.force[late]], [np.asarray(result.respond(run))[late]])
    assert whole["heated"] > 98.0 > whole["cold"]


def test_a_measured_temperature_replaces_the_one_that_the_losses_give():
    t = np.linspace(0.0, 10.0, 5001)
    x, v = 0.02 * np.sin(9.0 * t), 0.18 * np.cos(9.0 * t)
    law = Heated(Lag(Bilinear(2600.0, 1500.0), 2e-3), 0.003, 200.0, -0.4, initial_rise=2.0, heat_capacity=12.0)
    rise = np.asarray(states_of(law, t, x, v))[:, 0]
    assert np.ptp(rise) > 20.0
    force = np.asarray(respond(law, t, x, v))
    known = np.asarray(respond(law, t, x, v, temperature=293.15 + rise))
    np.testing.assert_allclose(known, force, atol=1e-2)
    again = respond(replace(law, {"cooling_time": 9.0, "initial_rise": 50.0}), t, x, v, temperature=293.15 + rise)
    np.testing.assert_array_equal(again, known)


def states_of(law, t, x, v):
    """States at every instant."""

    def step(state, ends):
        state = law.advance(*ends, state, t[1])
        return state, state

    ends = tuple(jnp.asarray(a) for a in (x[:-1], v[:-1], x[1:], v[1:]))
    states = jax.lax.scan(step, law.initial_state(), ends)[1]
    return jnp.concatenate([law.initial_state()[None], states])


def test_a_fit_takes_the_temperature_channel_of_the_records():
    heat = Rig(temperature_slope=0.002, heating=0.03, cooling=1 / 300)
    dyno = bench.VirtualDyno(Bilinear(2600.0, 1500.0, 0.01), 100.0, rig=heat, force_noise=3.0, temperature_channel=True)
    (run,) = dyno.run([bench.SineTest(amplitude=0.02, frequency=1.5, cycles=30)])
    assert run.temperature is not None and np.ptp(run.temperature) > 10.0
    start = Heated(Bilinear(2000.0, 2000.0, 0.01), 0.001, 200.0)
    known = ["initial_rise", "cooling_time", "static_force_slope"]
    result = fit(start, run, freeze=known, samples_per_cycle=40, starts=1)
    assert result.fit_percent > 98.5
    np.testing.assert_allclose(result["sensitivity"].value, 0.002, rtol=0.1)  # exp(−κ ϑ) for 1 − κ ϑ
