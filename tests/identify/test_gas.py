"""Records at several gas pressures as one law: valves in common, the gas by the pressure that the records state."""

import dataclasses
import functools

import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.bench import BenchRun, SineTest, VirtualDyno
from jaxdamp.dampers import (
    CoulombFriction,
    GasSpring,
    MonoTube,
    PiecewiseLinear,
    Scheduled,
    Spring,
    TwinTube,
    with_command,
)
from jaxdamp.identify import ManyFits, fit, fit_scheduled
from jaxdamp.parameters import get, replace
from jaxdamp.rig import Rig


NOISE = 5.0  # N
PRESSURES = (1e6, 2e6, 3.5e6)  # Pa, absolute
VALVES = PiecewiseLinear([-0.05, 0.05], [1200.0, 3000.0, 1500.0])
DAMPER = VALVES + GasSpring(2e6, 6e-5, 1e-4, 1.3) + CoulombFriction(30.0, 0.01)
BEGIN = replace(DAMPER, {"slopes": [2000.0, 2000.0, 2000.0], "volume": 5e-5, "rod_area": 8e-5, "friction_force": 20.0})
HELD = ["exponent", "knots", "friction_velocity"]
TESTS = [SineTest(0.05, 0.1, cycles=1, name="slow"), SineTest(0.03, 1.5, cycles=3, name="fast")]


def at(
    pressure: float, seed: int, damper=DAMPER, zero: float = 0.0, tests=TESTS, rate: float = 200.0
) -> list[BenchRun]:
    """Records at a gas pressure, which they state in bar and have as command in Pa."""
    name = "gas.pressure" if isinstance(damper, MonoTube | TwinTube) else "terms.1.pressure"
    dyno = VirtualDyno(replace(damper, {name: pressure}), rate, force_noise=NOISE, seed=seed)
    settings = {name.replace("terms.1.", ""): f"{pressure / 1e5:g} bar"}
    return [
        dataclasses.replace(run, force=run.force + zero, settings=settings, command=pressure, name=f"{run.name} {seed}")
        for run in dyno.run(tests)
    ]


@pytest.fixture(scope="module")
def runs():
    return [run for seed, pressure in enumerate(PRESSURES) for run in at(pressure, seed, zero=25.0)]


@pytest.fixture(scope="module")
def one_law(runs):
    return fit(BEGIN, runs, freeze=HELD, rig="offset", starts=1)


def test_valves_are_common_and_the_gas_follows_the_pressure(one_law):
    true = {"rod_area": 1e-4, "volume": 6e-5, "friction_force": 30.0, "force_offset": 25.0, "slopes[1]": 3000.0}
    for name, value in true.items():
        assert abs(one_law[name].value - value) < 4.0 * one_law[name].standard_error
    assert one_law["rod_area"].standard_error < 2e-7 and one_law["volume"].standard_error < 2e-6
    assert "stated by the records: law.terms.1.pressure 1e+06 to 3.5e+06" in one_law.criterion
    assert not one_law.warnings


@pytest.mark.parametrize("pressure", [0.4e6, 2.7e6, 6e6])
def test_records_at_other_pressures_are_predicted_between_and_beyond(one_law, pressure):
    new = at(pressure, 9, zero=25.0)
    assert one_law.score(new)[1] < 1.1 * NOISE
    law = replace(one_law.law, {"terms.1.pressure": pressure})
    still = np.zeros(20)
    at_rest = respond(law, np.arange(20) / 100.0, still, still)[-1]
    np.testing.assert_allclose(at_rest, -(pressure - 101_325.0) * 1e-4, atol=1.0)  # pressure times rod area


def test_records_at_one_pressure_do_not_tell_it_from_area_preload_or_zero(runs):
    one = [dataclasses.replace(run, settings={}) for run in runs[2:4]]
    cases = [
        (BEGIN, ["volume"], None, r"tell terms.1.pressure, terms.1.rod_area apart"),
        (BEGIN + Spring(0.0, -10.0), ["volume", "rod_area", "stiffness"], None, r"pressure, terms.3.preload apart"),
        (BEGIN, ["volume", "rod_area"], Rig(force_offset=1.0), r"law.terms.1.pressure, rig.force_offset apart"),
    ]
    for law, known, rig, words in cases:
        result = fit(law, one, freeze=[*HELD, *known], rig=rig, starts=1)
        said = [warning for warning in result.main_warnings if "at one gas pressure" in warning]
        assert len(said) == 1 and words.replace("\\", "") in said[0] and '{"terms.1.pressure": "20 bar"}' in said[0]
    stated = [dataclasses.replace(run, settings={"pressure": "20 bar"}) for run in one]
    known = fit(BEGIN, stated, freeze=[*HELD, "volume"], starts=1)
    assert not [warning for warning in known.warnings if "one gas pressure" in warning]


def test_many_dampers_have_the_gas_at_the_pressures_that_their_records_state(runs):
    dampers = {"A": [*runs[:2], *runs[2:4]], "B": [*runs[2:4], *runs[4:]]}
    many = fit(BEGIN, dampers, freeze=HELD, rig="offset")
    for place, (name, records) in enumerate(dampers.items()):
        single = fit(BEGIN, records, freeze=HELD, rig="offset", starts=1)
        assert isinstance(many, ManyFits) and many.parameters == tuple(e.name for e in single.parameters)
        np.testing.assert_allclose(many.values[place], [e.value for e in single.parameters], rtol=1e-3)
        for path in ("terms.1.pressure", "terms.1.volume"):
            assert float(get(many[name], path)) == pytest.approx(float(get(single.law, path)), rel=1e-3)


@pytest.mark.slow
def test_a_number_that_the_pressure_changes_has_a_value_for_each():
    frictions = (20.0, 30.0, 45.0)
    dampers = [replace(DAMPER, {"friction_force": friction}) for friction in frictions]
    runs = [run for k, (p, law) in enumerate(zip(PRESSURES, dampers, strict=True)) for run in at(p, k, law)]
    by_pressure = fit_scheduled(
        BEGIN, runs, common=["terms.0.**", "terms.1.**"], freeze=HELD, rig=None, starts=1, blend="parameters"
    )
    law = by_pressure.law
    assert [float(get(level, "terms.1.pressure")) for level in law.laws] == list(PRESSURES)
    found = [float(get(level, "terms.2.friction_force")) for level in law.laws]
    np.testing.assert_allclose(found, frictions, atol=2.0)
    between = with_command(law, 2.7e6)
    assert isinstance(between, Scheduled)
    np.testing.assert_allclose(get(between.at_command(), "terms.1.pressure"), 2.7e6)
    (left,) = by_pressure.between
    assert left.setting == 2e6 and left.rmse < 1.2 * NOISE


def test_records_that_do_not_state_it_well_are_refused(runs):
    for settings, words in [
        ({}, "must all state their pressure, but is without one: fast 1"),
        ({"pressure": "20"}, "state pressure of 'fast 1' in a unit of it, but is '20'"),
        ({"pressure": "20 mm"}, "state pressure of 'fast 1' in a unit of it, but is '20 mm'"),
        ({"pressure": "-20 bar"}, "have pressure"),
        ({"terms.1.presure": "20 bar"}, "Did you mean 'terms.1.pressure'"),
    ]:
        wrong = [dataclasses.replace(run, settings=settings) if run.name == "fast 1" else run for run in runs]
        with pytest.raises(ValueError, match=words):
            fit(BEGIN, wrong, freeze=HELD, starts=1)
    with pytest.raises(ValueError, match=r"name numbers that the records do not state, but is terms\.1\.pressure"):
        fit(BEGIN, runs, freeze=HELD, per_record=["pressure"], starts=1)
    with pytest.raises(ValueError, match="must all state their pressure, but is without one: slow 1, fast 1"):
        silent = [dataclasses.replace(run, settings={}) for run in runs[2:4]]
        fit(BEGIN, {"A": runs[:2], "B": silent}, freeze=HELD)
    other = dataclasses.replace(runs[1], force=1.3 * runs[1].force, name="another")
    with pytest.raises(ValueError, match=r"be records that one law can follow, but is .*fast 0 and another"):
        fit(BEGIN, [*runs, other], freeze=HELD, starts=1)


@pytest.mark.slow
def test_a_cavity_follows_the_pressure_too():
    tube = MonoTube.reference()
    tests = [SineTest(0.04, 0.1, cycles=1), SineTest(0.03, 3.0, cycles=3), SineTest(0.006, 12.0, cycles=6)]
    runs = [run for k, p in enumerate((6e5, 1.5e6, 3e6)) for run in at(p, k, tube, tests=tests, rate=1000.0)]
    geometry = {"piston_diameter": 0.044, "rod_diameter": 0.011, "rebound_volume": 1.1e-4}
    result = fit(functools.partial(MonoTube.guess, **geometry), runs, freeze=["exponent"], rig="offset", starts=1)
    np.testing.assert_allclose(result["rod_area"].value, 1e-4, rtol=0.005)
    fast = [SineTest(0.035, 2.0, cycles=3), SineTest(0.008, 9.0, cycles=6)]
    for pressure in (3e5, 1e6, 5e6):  # of which the lowest has cavities in every cycle
        for score in result.score(at(pressure, 9, tube, tests=fast, rate=1000.0))[2]:
            assert score.fit_percent > 96.0
    cavity = at(3e5, 9, tube, tests=fast[:1], rate=1000.0)[0]
    assert result.score(dataclasses.replace(cavity, settings={"gas.pressure": "20 bar"}))[1] > 100.0  # N, without them


@pytest.mark.slow
def test_a_twin_tube_between_and_beyond_the_pressures():
    tube = TwinTube.reference()
    tests = [SineTest(0.05, 0.1, cycles=1), SineTest(0.03, 1.6, cycles=3), SineTest(0.005, 10.0, cycles=6)]
    runs = [run for k, p in enumerate((3e5, 1.2e6)) for run in at(p, k, tube, zero=20.0, tests=tests, rate=1000.0)]
    geometry = {"piston_diameter": 0.05, "rod_diameter": 0.0206, "rebound_volume": 3.3e-4, "compression_volume": 3.9e-4}
    held = ["exponent", "base.rebound_*", "piston.compression_opening_pressure"]
    start = functools.partial(TwinTube.guess, **geometry)
    result = fit(start, runs, freeze=held, rig="offset", starts=1, max_steps=100)
    np.testing.assert_allclose(result["rod_area"].value, 3.1416e-4, rtol=0.005)  # from a rod 3 % too thick
    np.testing.assert_allclose(result["force_offset"].value, 20.0, atol=2.0)
    others = [SineTest(0.02, 0.5, cycles=2), SineTest(0.01, 5.0, cycles=4)]
    for pressure in (1.5e5, 6e5, 2e6):
        for score in result.score(at(pressure, 9, tube, zero=20.0, tests=others, rate=1000.0))[2]:
            assert score.fit_percent > 98.5, (pressure, score)
