"""The laws with hysteresis in a quarter car: both engines agree, stiff laws are stable at a millisecond."""

import numpy as np
import pytest

from jaxdamp import simulate
from jaxdamp.dampers import BoucWen, Dahl, HyperbolicTangent, KaradayiMasada, Linear, LuGre, ModifiedBoucWen
from jaxdamp.roads import cosine_bump
from jaxdamp.vehicles.presets import quarter_car_000


STEPS = 300  # the same in all runs, so that each engine is compiled once a law


def acceleration(law, dt, method):
    road = cosine_bump(0.05, start=0.02, duration=0.1)
    run = simulate(quarter_car_000(law), road, duration=STEPS * dt, dt=dt, method=method, rtol=1e-7, atol=1e-9)
    return np.asarray(run["sprung_acceleration"])


def friction(contact, breakaway_velocity):
    return Linear(2000.0) + Dahl(contact, 60.0) + LuGre(contact, 300.0, 100.0, 40.0, 60.0, breakaway_velocity)


def chain(gap, hysteresis):
    return 0.5 * KaradayiMasada(2600.0, 1200.0, 40.0, 0.01, 1e6, gap) + hysteresis


MILD = {
    "hysteresis": lambda: BoucWen(1000.0, 2000.0, 300.0, 1e-3) + HyperbolicTangent(500.0, 500.0, 300.0, 10.0, 0.6),
    "friction": lambda: friction(4e5, 0.05),
    "chains": lambda: chain(3e-4, ModifiedBoucWen(800.0, 6000.0, 4690.0, 300.0, 1e-3)),
}
STIFF = {
    "hysteresis": lambda: BoucWen(1000.0, 2000.0, 300.0, 1e-5) + HyperbolicTangent(500.0, 500.0, 300.0, 10.0, 0.6),
    "friction": lambda: friction(2e7, 0.01),
    "chains": lambda: chain(1e-4, ModifiedBoucWen.prototype(2.25)),
}


@pytest.mark.parametrize("name", MILD)
def test_engines(name):
    law = MILD[name]()
    exact = acceleration(law, 5e-4, "diffrax")
    size = np.max(np.abs(exact))
    coarse = np.max(np.abs(acceleration(law, 2e-3, "exponential")[: STEPS // 4 + 1] - exact[::4])) / size
    fine = np.max(np.abs(acceleration(law, 5e-4, "exponential") - exact)) / size
    assert size > 1.0
    assert coarse < 5e-3
    assert fine < coarse / 6

    stiff = STIFF[name]()
    found = acceleration(stiff, 1e-3, "exponential")
    expected = acceleration(stiff, 1.25e-4, "exponential")[::8]
    np.testing.assert_allclose(found[: expected.size], expected, atol=0.03 * np.max(np.abs(expected)))
    assert np.max(np.abs(found)) < 2 * size
