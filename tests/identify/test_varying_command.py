"""Fits of records whose command varies: the law by current and the actuator's lag, estimated together."""

from dataclasses import replace

import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import CommandStep, SineTest, VirtualDyno
from jaxdamp.dampers import AbstractDamper, Bilinear, Lag, Linear, Scheduled, with_command
from jaxdamp.rig import Rig


LAG = 8e-3
TRUTH = Scheduled((Bilinear(600.0, 400.0), Bilinear(2400.0, 1400.0), Bilinear(3000.0, 2000.0)), [0.0, 0.5, 1.0], 0.0)
START = Scheduled((Bilinear(900.0, 900.0), Bilinear(900.0, 900.0), Bilinear(900.0, 900.0)), [0.0, 0.5, 1.0], 0.0)
TRUE = [600.0, 400.0, 2400.0, 1400.0, 3000.0, 2000.0]
VARYING = [
    CommandStep(SineTest(0.02, 2.0, cycles=6), (0.0, 1.0, 0.5), hold=0.3),
    CommandStep.random(SineTest(0.01, 4.0, cycles=12), 0.0, 1.0, hold=0.15),
]


def records(tests, law: AbstractDamper = TRUTH, noise=15.0, lag=LAG, seed=0):
    return list(VirtualDyno(law, 1000.0, command_lag=lag, force_noise=noise, seed=seed).run(tests))


@pytest.fixture(scope="module")
def varying():
    return records(VARYING)


@pytest.fixture(scope="module")
def held():
    made = []
    for command in (0.0, 0.5, 1.0):
        test = SineTest(0.02, 2.0, name=f"held at {command}")
        made += [run.held_at(command) for run in records([test], with_command(TRUTH, command))]
    return made


def within(estimate, true):
    return abs(estimate.value - true) < 4.0 * estimate.standard_error


def test_law_and_lag_from_a_start_away_from_the_truth(varying):
    result = identify.fit(START, varying, rig="command_lag")
    assert result.rmse == pytest.approx(15.0, rel=0.03)
    assert all(within(e, true) for e, true in zip(result.parameters, [*TRUE, LAG], strict=True))
    assert result["command_lag"].standard_error < 2e-4 and result["command_lag"].unit == "s"
    assert result.law.fitted_to.command == (0.0, pytest.approx(1.0, abs=1e-9))
    fresh = records([CommandStep.random(SineTest(0.015, 3.0, cycles=6), 0.0, 1.0, hold=0.1, seed=9)], noise=0.0)
    assert result.score(fresh)[0] > 98.5
    np.testing.assert_allclose(result.respond(fresh[0])[500:-5], fresh[0].force[500:-5], atol=15.0)
    without = identify.fit(START, varying, starts=1)
    assert without.rmse > 1.5 * result.rmse  # what a fit without the lag misses


@pytest.mark.slow
def test_records_at_held_levels_and_varying_ones_together(varying, held):
    result = identify.fit(START, [*held, *varying], rig=Rig(command_lag=2e-3))
    assert all(within(e, true) for e, true in zip(result.parameters, [*TRUE, LAG], strict=True))
    assert result.score(held)[0] == pytest.approx(np.mean([s.fit_percent for s in result.score(held)[2]]), abs=5.0)


def test_settings_and_varying_records_become_one_law(varying, held):
    result = identify.fit_scheduled(Bilinear, [*held, *varying], rig=["command_lag"], blend="parameters")
    assert [float(level) for level in result.law.levels] == [0.0, 0.5, 1.0]
    assert all(within(e, true) for e, true in zip(result.result.parameters, [*TRUE, LAG], strict=True))
    assert any("Where the command varies: fit 9" in sentence for sentence in result.verdict)
    with pytest.raises(ValueError, match="`rig` must have no `command_lag` beside commands that are held"):
        identify.fit_scheduled(Bilinear, held, rig="command_lag")
    with pytest.raises(ValueError, match="have two commands or more that are held, but is records of none"):
        identify.fit_scheduled(Bilinear, varying)
    how = {"rig": "command_lag", "blend": "parameters", "bounds": {"command_lag": (1e-3, 5e-3), "*rate": (1.0, 1e5)}}
    bounded = identify.fit_scheduled(Bilinear, [*held, *varying], **how).result["command_lag"]
    assert bounded.value == pytest.approx(5e-3, rel=1e-3) and bounded.note == "at a bound"  # settings alone have none


@pytest.mark.parametrize(
    "initial_state",
    ["rest", "periodic", *(pytest.param(how, marks=pytest.mark.slow) for how in ("warm_up", "estimated"))],
)
def test_a_law_with_states_follows_the_command_however_it_starts(initial_state):
    law = Scheduled((Lag(Linear(600.0), 0.006), Lag(Linear(2400.0), 0.006)), [0.0, 1.0], 0.0)
    start = Scheduled((Lag(Linear(900.0), 0.003), Lag(Linear(1500.0), 0.003)), [0.0, 1.0], 0.0)
    sines = SineTest(0.02, 2.0, cycles=6, run_up=0.5), SineTest(0.01, 4.0, cycles=12, run_up=0.5)
    tests = [replace(test, test=sine) for test, sine in zip(VARYING, sines, strict=True)]
    result = identify.fit(start, records(tests, law), rig=Rig(command_lag=3e-3), initial_state=initial_state, starts=1)
    assert all(within(result[name], true) for name, true in (("command_lag", LAG), ("laws.1.law.rate", 2400.0)))


def test_what_the_records_cannot_tell_is_refused(varying, held):
    with pytest.raises(ValueError, match="`rig` must have no `command_lag` beside commands that are held"):
        identify.fit(START, held, rig="command_lag")
    silent = replace(held[0], name="silent", command=None)
    with pytest.raises(ValueError, match="`runs` must all state their commands, but is without one: silent"):
        identify.fit(START, [*varying, silent])
    volts = replace(varying[1], command_unit="V")
    with pytest.raises(ValueError, match=r"`runs` must have their commands in one unit, but is .* in A, .* in V"):
        identify.fit(START, [varying[0], volts])
    wide = replace(varying[0], command_channel=2.0 * varying[0].command_channel)
    with pytest.raises(ValueError, match="command of '20mm_2Hz_steps'` must stay between the levels 0 and 1"):
        identify.fit(START, [wide])


def test_a_law_without_a_command_takes_no_notice(varying):
    result = identify.fit(Bilinear, varying, bad_records="keep", starts=1)
    assert 600.0 < float(result.law.rebound_rate) < 3000.0 and result.rmse > 50.0


@pytest.mark.slow
def test_the_interval_of_the_lag_holds_the_truth():
    hits = 0
    for seed in range(40):
        result = identify.fit(START, records(VARYING, seed=seed), rig=Rig(command_lag=3e-3), starts=1)
        low, high = result["command_lag"].interval
        hits += low <= LAG <= high
    assert hits >= 34  # of 40; fewer once in 300 times if each holds it with 95 %
