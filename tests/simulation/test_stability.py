"""How many substeps laws get, against the step that a velocity's error needs to die out, and that it does."""

import re

import jax
import numpy as np
import pytest

from jaxdamp import dampers, roads, simulate
from jaxdamp.simulation.stability import substeps_needed
from jaxdamp.vehicles.presets import quarter_car_000


BUMP = roads.cosine_bump(0.06, start=0.1, duration=0.25)
FELT = 1.0 / 1200.0 + 1.0 / 125.0  # 1/m of what the damper of this car acts on
STEEP = dampers.CoulombFriction(400.0, 0.002)  # 2e5 N s/m at standstill


@pytest.mark.parametrize("rate", [5e4, 2e5, 1e6])
def test_a_steep_law_gets_as_many_as_make_half_the_share(rate):
    expected = int(np.ceil(0.5 * 1e-3 * rate * FELT / 0.5))
    assert substeps_needed(quarter_car_000(dampers.Linear(rate)), 1e-3) == expected
    assert substeps_needed(quarter_car_000(0.5 * dampers.Linear(rate) + 0.5 * dampers.Linear(rate)), 1e-3) == expected
    assert substeps_needed(quarter_car_000(dampers.Linear(rate)), 1e-3 / expected) == 1


def test_a_lag_needs_them_only_where_it_is_shorter_than_the_step():
    law, needed = dampers.Linear(1e5), substeps_needed(quarter_car_000(dampers.Linear(1e5)), 1e-3)
    long, short = (substeps_needed(quarter_car_000(dampers.Lag(law, tau)), 1e-3) for tau in (5e-3, 1e-7))
    assert long == 1
    assert short == pytest.approx(2 * needed, abs=1)


@pytest.mark.parametrize(
    "law",
    [
        pytest.param(dampers.Linear(1.5e5), marks=pytest.mark.slow),
        pytest.param(dampers.Lag(dampers.Linear(1e5), 1e-6), marks=pytest.mark.slow),
        STEEP,
    ],
    ids=repr,
)
def test_as_many_as_needed_follow_the_law(law):
    car = quarter_car_000(law)
    assert substeps_needed(car, 1e-3) > 1
    fine = simulate(car, BUMP, duration=0.6, dt=1e-3, substeps=64)["sprung_acceleration"]
    found = simulate(car, BUMP, duration=0.6, dt=1e-3)["sprung_acceleration"]
    size = 0.1 if law is STEEP else 0.01  # friction lets go a little earlier or later
    assert float(abs(found - fine).max()) < size * float(abs(fine).max())


def test_smooth_laws_take_one_and_a_compiled_function_cannot_ask():
    assert substeps_needed(quarter_car_000(dampers.Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)), 1e-3) == 1
    with pytest.raises(ValueError, match=r"`vehicle` must have numbers that are known.*outside `jax.jit`"):
        jax.jit(lambda rate: substeps_needed(quarter_car_000(dampers.Linear(rate)), 1e-3))(2e5)


def test_a_law_too_steep_for_any_of_them_is_refused():
    car = quarter_car_000(dampers.CoulombFriction(400.0, 1e-6))
    expected = r"`damper` must have a slope that 64 steps in 0.001 s can follow.* Pass `dt=(\S+)` or less"
    with pytest.raises(ValueError, match=expected) as refused:
        simulate(car, BUMP, duration=0.5)
    found = re.search(expected, str(refused.value))
    assert found and substeps_needed(car, float(found[1])) <= 64
