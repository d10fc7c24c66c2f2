"""The temperature in steady motion, and a fit of a record in which a damper fades."""

import numpy as np

from jaxdamp import bench, respond
from jaxdamp.dampers import Bilinear, Heated, Linear
from jaxdamp.identify import fit, fit_percent
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
        whole[name] = fit_percent([run.force[late]], [np.asarray(result.predict([run])[0])[late]])
    assert whole["heated"] > 98.0 > whole["cold"]
