import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.bench import BenchRun, SineTest, VirtualDyno
from jaxdamp.dampers import Bilinear, Lag, Linear, TemperatureScaled
from jaxdamp.identify import fit
from jaxdamp.parameters import get
from jaxdamp.rig import Rig
from jaxdamp.simulation import Exponential


@pytest.mark.parametrize(("temperature", "share"), [(293.15, 1.0), (343.15, 0.85), (273.15, 1.06)])
def test_force_falls_in_proportion(temperature, share):
    law = TemperatureScaled(Bilinear(2600.0, 1200.0), temperature, sensitivity=0.003)
    found = [law.force(0.0, v, law.initial_state()) for v in (0.5, -0.5)]
    np.testing.assert_allclose(found, [1300.0 * share, -600.0 * share], rtol=1e-12)


def test_another_reference():
    law = TemperatureScaled(Linear(1000.0), 300.0, 350.0, 0.002)
    np.testing.assert_allclose(law.force(0.0, 1.0, law.initial_state()), 1100.0, rtol=1e-13)


def test_states_are_those_of_the_law():
    t = np.linspace(0.0, 0.5, 1001)
    x, v = 0.01 * np.sin(40 * t), 0.4 * np.cos(40 * t)
    cold = respond(Lag(Linear(2000.0), 0.004), t, x, v)
    warm = respond(TemperatureScaled(Lag(Linear(2000.0), 0.004), 333.15, sensitivity=0.0025), t, x, v)
    np.testing.assert_allclose(warm, 0.9 * cold, rtol=1e-12)


def test_fit_of_a_warm_record_gives_the_numbers_of_the_cold_law():
    cold = Bilinear(2600.0, 1200.0)
    runs = VirtualDyno(0.88 * cold, force_noise=5.0, seed=1).run(SineTest(0.02, 5.0))
    result = fit(TemperatureScaled(Bilinear(900.0, 900.0), 333.15, sensitivity=0.003), runs, freeze=["sensitivity"])
    found = [get(result.law, name) for name in ("law.rebound_rate", "law.compression_rate")]
    np.testing.assert_allclose(found, [2600.0, 1200.0], rtol=2e-3)


def test_fit_of_the_sensitivity():
    runs = VirtualDyno(0.88 * Bilinear(2600.0, 1200.0), force_noise=5.0, seed=1).run(SineTest(0.02, 5.0))
    result = fit(TemperatureScaled(Bilinear(2600.0, 1200.0), 333.15, sensitivity=0.001), runs, freeze=["law.*"])
    np.testing.assert_allclose(get(result.law, "sensitivity"), 0.003, rtol=0.01)


@pytest.mark.parametrize("temperature", [793.15, 900.0])
def test_a_factor_that_is_not_positive_is_refused(temperature):
    with pytest.raises(ValueError, match=r"`sensitivity` must give a positive factor .* nearby"):
        TemperatureScaled(Linear(1000.0), temperature)


def test_single_precision():
    law = TemperatureScaled(Linear(jnp.asarray(1000.0, jnp.float32)), *jnp.array([333.0, 293.0, 2e-3], jnp.float32))
    force = law.force(jnp.float32(0.0), jnp.float32(0.5), law.initial_state())
    assert force.dtype == jnp.float32
    np.testing.assert_allclose(force, 460.0, rtol=1e-5)


WARM = TemperatureScaled(Bilinear(2600.0, 1200.0), 293.15, sensitivity=0.003)


def records(rng=0):
    """Two records at temperatures that rise; their force decreases with it."""
    t = np.arange(4000) / 500.0
    noise = np.random.default_rng(rng)
    runs = []
    for frequency, first in ((1.0, 290.0), (3.0, 320.0)):
        x, v = 0.02 * np.sin(2 * np.pi * frequency * t), 0.04 * np.pi * frequency * np.cos(2 * np.pi * frequency * t)
        temperature = first + 5.0 * t
        force = np.where(v > 0, 2600.0, 1200.0) * v * (1.0 - 0.003 * (temperature - 293.15))
        noisy = force + noise.normal(0.0, 3.0, len(t))
        runs.append(BenchRun(f"{frequency:g} Hz", t, x, v, noisy, temperature))
    return runs


@pytest.mark.parametrize(
    ("inner", "freeze"),
    [(Bilinear(900.0, 900.0), []), (Lag(Bilinear(900.0, 900.0), 1e-6), ["lag_time"])],
    ids=["curve", "states"],
)
def test_fits_take_the_temperature_channel_of_the_records(inner, freeze):
    start = TemperatureScaled(inner, 400.0, sensitivity=0.001)
    result = fit(start, records(), freeze=freeze, starts=1, samples_per_cycle=100)
    assert result.fit_percent > 99.0
    found = [result[name].value for name in ("rebound_rate", "compression_rate", "sensitivity")]
    np.testing.assert_allclose(found, [2600.0, 1200.0, 0.003], rtol=3e-3)
    later = records(1)[1]
    np.testing.assert_allclose(result.respond(later)[200:-200], later.force[200:-200], atol=20.0)


def test_records_of_which_some_lack_the_channel_are_refused_by_name():
    with_it, without = records()
    without = dataclasses.replace(without, temperature=None)
    with pytest.raises(ValueError, match=r"`runs` must all state their temperature, but is without one: 3 Hz"):
        fit(WARM, [with_it, without], starts=1)


def test_a_measured_temperature_in_a_response():
    t = np.linspace(0.0, 1.0, 501)
    v = np.full_like(t, 0.1)
    law, temperature = WARM + Linear(100.0), 293.15 + 100.0 * t
    expected = 260.0 * (1.0 - 0.3 * t) + 10.0
    np.testing.assert_allclose(respond(law, t, 0.1 * t, v, temperature=temperature), expected, rtol=1e-9)
    np.testing.assert_allclose(respond(law, t, 0.1 * t, v, temperature=303.15), 262.2, rtol=1e-9)
    np.testing.assert_allclose(Rig().force(law, t, 0.1 * t, v, temperature=temperature), expected, rtol=1e-9)
    wrong = [
        (Linear(1.0), temperature, "beside a law that does not depend"),
        (law, temperature[1:], "as long as `time`"),
        (law, -1.0, "in kelvin, above 150, but is -1.0"),
        (law, 60.0, "in kelvin, above 150"),
    ]
    for other, value, message in wrong:
        with pytest.raises(ValueError, match=f"`temperature` must be .*{message}"):
            respond(other, t, 0.1 * t, v, temperature=value)
    with pytest.raises(ValueError, match=r"`temperature` must be left out beside an engine"):
        respond(law, t, 0.1 * t, v, temperature=300.0, engine=Exponential())
