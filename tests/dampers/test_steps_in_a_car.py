"""Laws in a quarter car at coarse steps: right to 1.5 %, or warned of with the error, or refused."""

import re
import warnings

import numpy as np
import pytest

from jaxdamp import roads, simulate
from jaxdamp.simulation import CoarseStepWarning
from jaxdamp.vehicles.presets import quarter_car_000

from .test_contract import LAWS


pytestmark = pytest.mark.slow_one_in(3)

ROUGH = roads.iso8608("C", 20.0, 2.0, seed=1)
# one law for each way in which a step can be too long: smooth, kinked, steep at rest, explicit states, own steps
NAMES = (
    "linear",
    "power 0.65",
    "Besinger, published",
    "friction",
    "lag",
    "series spring, soft cubic",
    "bump stop",
    "Bouc and Wen",
    "LuGre",
    "modified Bouc and Wen, published",
    "mono-tube",
    "hybrid",
)
ALLOWED = 0.015  # RMS of the error over the RMS of the channel where nothing is said


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.exhaustive_cases("linear", "bump stop")
def test_right_or_warned_of_or_refused(name):
    car = quarter_car_000(LAWS[name]())
    fine = simulate(car, ROUGH, duration=2.0, dt=1e-4)
    for dt in (5e-3, 1e-2, 2e-2):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                run = simulate(car, ROUGH, duration=2.0, dt=dt)
            except ValueError as error:
                assert "estimated at" in str(error) and dt > 5e-3
                continue
        every = round(dt / 1e-4)
        pairs = [(run[name], fine[name][::every]) for name in ("sprung_acceleration", "dynamic_tyre_load")]
        error = max(float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2))) for a, b in pairs)
        said = [str(w.message) for w in caught if issubclass(w.category, CoarseStepWarning)]
        if not said:
            assert error < ALLOWED, dt
            continue
        match = re.search(r"estimated at (\S+) %", said[0])
        assert match and 1 / 3 < 0.01 * float(match[1]) / error < 3, dt
