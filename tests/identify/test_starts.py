"""Starts from data lead back to the law that made the data."""

import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import BoucWen, Dahl, KaradayiMasada, Linear, LuGre, Spring


TRUTHS = {
    "Bouc-Wen": (BoucWen(900.0, 3000.0, 400.0, 2e-3, 0.8, 1.5, 30.0), BoucWen),
    "Dahl": (Linear(1500.0) + Dahl(3e5, 200.0), lambda v, f: Linear.guess(v, f) + Dahl.guess(v, f)),
    "LuGre": (LuGre(3e5, 800.0, 700.0, 250.0, 350.0, 0.05), LuGre),
    "Karadayi-Masada": (KaradayiMasada(2600.0, 1400.0, 120.0, 0.02, 6e5, 3e-4), KaradayiMasada),
}


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n != "Dahl" else []) for n in TRUTHS])
@pytest.mark.exhaustive_cases("Karadayi-Masada")
def test_fit_from_the_start_finds_the_law(name):
    law, start = TRUTHS[name]
    tests = [SineTest(0.02, 1.0, cycles=2), SineTest(0.004, 6.0, cycles=2), SineTest(0.02, 4.0, cycles=2)]
    runs = VirtualDyno(law, sampling_rate=400.0, force_noise=1.0).run(tests)
    result = identify.fit(start, runs, samples_per_cycle=200)
    assert result.fit_percent > 98.5, result


def test_spring_is_what_goes_with_the_stroke():
    angle = np.linspace(0.0, 6 * np.pi, 900)
    stroke, velocity = 0.02 * np.sin(angle), 0.3 * np.cos(angle)
    force = 1500.0 * velocity + 80.0 * np.sign(velocity) + 4000.0 * stroke - 60.0
    spring = Spring.guess(velocity, force, stroke)
    np.testing.assert_allclose([spring.stiffness, spring.preload], [4000.0, -60.0], rtol=1e-6)
    assert float(Spring.guess(velocity, -4000.0 * stroke, stroke).stiffness) > 0.0
