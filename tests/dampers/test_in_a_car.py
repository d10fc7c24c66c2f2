"""Every law in a quarter car: the fixed-step engine converges to an adaptive solver of the same equations.

Six laws stand side by side in one car, so that few engines are compiled.
"""

import numpy as np
import pytest

from jaxdamp import simulate
from jaxdamp.dampers import Sum
from jaxdamp.roads import cosine_bump
from jaxdamp.simulation import Adaptive, Exponential
from jaxdamp.simulation.stability import substeps_needed
from jaxdamp.vehicles.presets import quarter_car_000

from .test_contract import LAWS


pytestmark = pytest.mark.exhaustive

STEPS = 200  # the same in all runs, so that each engine is compiled once a group
NAMES = list(LAWS)
GROUPS = [NAMES[i : i + 6] for i in range(0, len(NAMES), 6)]


def acceleration(law, dt, exact=False):
    road, car = cosine_bump(0.05, start=0.02, duration=0.1), quarter_car_000(law)
    substeps = substeps_needed(car, 2e-3)  # of the longest step, in all runs, so that errors show the order
    engine = Adaptive(rtol=1e-7, atol=1e-9) if exact else Exponential(substeps=substeps)
    run = simulate(car, road, duration=STEPS * dt, dt=dt, engine=engine)
    return np.asarray(run["sprung_acceleration"])


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: f"{group[0]} to {group[-1]}")
def test_engines_agree(group):
    law = Sum(tuple(0.3 * LAWS[name]() for name in group))
    exact = acceleration(law, 5e-4, exact=True)
    size = np.max(np.abs(exact))
    errors = {}
    for every in (4, 2, 1):
        found = acceleration(law, 5e-4 * every)[: STEPS // every + 1]
        errors[every] = np.max(np.abs(found - exact[::every])) / size
    assert size > 1.0
    assert errors[2] < 0.02, f"errors {errors} at multiples of 0.5 ms"
    # where friction sticks or yields, the order is one: of the shortest steps at most a third of the largest error
    assert errors[1] < 5e-3 and errors[1] < max(errors[4], errors[2]) / 3, f"errors {errors} at multiples of 0.5 ms"
