"""Records that begin at other temperatures: prediction of a new one, stated starts, and whether heat helps."""

import dataclasses
from typing import TypedDict

import numpy as np
import pytest

from jaxdamp.bench import BenchRun, SineTest, VirtualDyno, initial_temperature, read
from jaxdamp.dampers import AbstractDamper, Bilinear, CoulombFriction, Heated, Linear, TemperatureScaled
from jaxdamp.identify import compare, cross_validate, fit
from jaxdamp.identify.held_out import on_records
from jaxdamp.identify.record_starts import first_samples, warmed
from jaxdamp.parameters import get, replace
from jaxdamp.rig import Rig
from jaxdamp.solve import BoundedLevenbergMarquardt


class How(TypedDict):
    """Keywords of all fits here."""

    freeze: list[str]
    samples_per_cycle: int
    starts: int


NOISE = 10.0  # N
COLD = Bilinear(2600.0, 1500.0) + CoulombFriction(60.0, 0.02)
DAMPER = Heated(COLD, sensitivity=0.004, cooling_time=300.0, heat_capacity=400.0)
BEGIN = Heated(Bilinear(2000.0, 2000.0) + CoulombFriction(30.0, 0.02), 0.002, 200.0, heat_capacity=400.0)
HOW: How = {"freeze": ["static_force_slope", "friction_velocity"], "samples_per_cycle": 50, "starts": 1}
MOTIONS = [(0.0, 0.03, 1.0), (15.0, 0.03, 2.0), (30.0, 0.02, 3.0), (8.0, 0.015, 1.5)]  # K, m, Hz
TRUE = {"rebound_rate": 2600.0, "compression_rate": 1500.0, "friction_force": 60.0, "sensitivity": 0.004}


def record(rise: float, amplitude: float, frequency: float, seed: int, damper: AbstractDamper = DAMPER) -> BenchRun:
    """A record of 40 s that begins so many kelvin above the reference."""
    damper = replace(damper, {"initial_rise": rise}) if isinstance(damper, Heated) else damper
    test = SineTest(amplitude, frequency, cycles=int(40 * frequency))
    return VirtualDyno(damper, 100.0, force_noise=NOISE, seed=seed).run(test)[0]


def at(celsius: float, run: BenchRun) -> BenchRun:
    """The record with a stated temperature."""
    return dataclasses.replace(run, settings={"temperature": f"{celsius} degC"})


@pytest.fixture(scope="module")
def runs():
    return [record(*motion, seed) for seed, motion in enumerate(MOTIONS)]


@pytest.fixture(scope="module")
def hot():
    return record(42.0, 0.025, 2.5, 9)


@pytest.fixture(scope="module")
def each(runs):
    """A start of its own for every record."""
    return fit(BEGIN, runs, per_record=["initial_rise"], **HOW)


def test_a_new_record_begins_as_warm_as_its_first_cycles_show(each, hot):
    for name, true in TRUE.items():
        assert abs(each[name].value - true) < 4.0 * each[name].standard_error
    percent, rmse, _ = each.score(hot)
    assert percent > 97.0 and rmse < 1.1 * NOISE
    assert abs(float(get(each.models_of([hot])[0][0], "initial_rise")) - 42.0) < 8.0
    assert 5.0 < float(each.law.initial_rise) < 25.0  # with which the record would be predicted 10 % too high
    judged = on_records(each, [hot])
    assert judged is not None and judged.rmse < 1.1 * NOISE


def test_only_the_first_cycles_tell_the_temperature_and_they_are_not_scored(each, hot):
    told = first_samples(hot)
    assert 0.03 < told / len(hot) < 0.06
    later, first = hot.force.copy(), hot.force.copy()
    later[told + 5 :] = 0.0
    first[:told] *= 1.1
    begin, otherwise = (dataclasses.replace(hot, force=force) for force in (later, first))
    np.testing.assert_allclose(each.respond(begin), each.respond(hot), atol=0.5)
    cooler = each.score(otherwise)[2][0]
    assert cooler.largest_error < 0.1 * np.ptp(hot.force)  # that of the first samples would be larger
    assert np.max(each.respond(otherwise) - each.respond(hot)) > 10.0


@pytest.mark.parametrize("rise", [0.0, 750.0, 1250.0])
def test_the_temperature_is_found_however_far_the_mean_of_fitted_ones_is(hot, rise):
    """Newton's whole step goes far beyond where the force has nearly vanished: none was left, or no finite one."""
    found = warmed(replace(DAMPER, {"initial_rise": rise}), hot, ["initial_rise"], NOISE, "warm_up").model
    assert float(get(found, "initial_rise")) == pytest.approx(42.0, abs=2.0)


def test_a_fitted_record_is_predicted_by_its_own_values(each, runs):
    np.testing.assert_allclose(each.score(runs)[:2], (each.fit_percent, each.rmse), rtol=1e-9)
    assert each.score(runs[2])[1] < 1.1 * NOISE


@pytest.mark.slow
def test_held_out_records_say_that_heat_helps(runs, hot):
    laws = {"cold": BEGIN.law, "heated": BEGIN}
    comparison = compare(laws, runs, per_record=["initial_rise"], **HOW)  # the machine has one too
    assert comparison.best.name == "heated" and "each of 4 records" in comparison.best.judged_on
    cold, heated = (rung.held_out_rmse for rung in comparison.rungs)
    assert heated < 1.1 * NOISE < 2.0 * NOISE < cold
    assert comparison["cold"].score(hot)[1] > 3.0 * NOISE


@pytest.mark.slow
def test_held_out_records_of_a_damper_that_stays_cold_say_that_heat_does_not_help():
    cold = [record(*motion, seed, COLD) for seed, motion in enumerate(MOTIONS)]
    laws = {"cold": BEGIN.law, "heated": BEGIN}
    assert compare(laws, cold, rig=None, per_record=["initial_rise"], **HOW).best.name == "cold"


def test_names_that_no_law_of_a_comparison_has_are_refused(runs):
    with pytest.raises(ValueError, match="no_such"):
        compare({"cold": BEGIN.law, "linear": Linear}, runs, rig=None, per_record=["no_such"], starts=1)


def test_records_that_state_their_temperature_begin_with_it(runs, hot):
    stated = [at(20.0 + rise, run) for (rise, *_), run in zip(MOTIONS, runs, strict=True)]
    result = fit(BEGIN, stated, **HOW)
    for name, true in TRUE.items():
        assert abs(result[name].value - true) < 4.0 * result[name].standard_error
    assert "initial_rise" not in {e.name for e in result.parameters}
    assert result.law.fitted_to is not None
    assert result.law.fitted_to.temperature == pytest.approx((293.15, 323.15))
    assert result.score(at(62.0, hot))[1] < 1.05 * NOISE < 2.0 * NOISE < result.score(at(20.0, hot))[1]
    assert result.score(hot)[1] < 1.1 * NOISE  # by its first cycles
    assert cross_validate({"heated": BEGIN}, stated, rig=None, **HOW).rmse("heated") < 1.1 * NOISE
    many = fit(BEGIN, {"A": stated[:2], "B": stated[2:]}, **HOW)
    assert not [name for name in many.free.names if "rise" in name] and max(many.rmse) < 1.1 * NOISE
    with pytest.raises(ValueError, match="not state, but is initial_rise"):
        fit(BEGIN, stated, per_record=["initial_rise"], **HOW)
    with pytest.raises(ValueError, match=rf"all state their temperature, but is without one: {runs[1].name}"):
        fit(BEGIN, [stated[0], runs[1]], **HOW)


@pytest.mark.parametrize(("text", "kelvin"), [("80 degC", 353.15), ("300K", 300.0), ("68 degF", 293.15)])
def test_a_stated_temperature_has_a_unit(text, kelvin, hot):
    run = dataclasses.replace(hot, settings={"temperature": text})
    assert initial_temperature(run) == pytest.approx(kelvin)
    assert initial_temperature(hot) is None
    for wrong in (80, "warm", "80 mm"):
        run = dataclasses.replace(hot, settings={"temperature": wrong})
        with pytest.raises(ValueError, match=r"temperature of .* with its unit, but is .*80 degC"):
            fit(BEGIN, run, **HOW)
    assert fit(Linear(1000.0), run).fit_percent > 50.0  # it says nothing of a law that follows no temperature


@pytest.mark.parametrize("tolerance", [1e-3, 1e4])
def test_a_fit_whose_numbers_are_all_unknown_does_not_converge_far_from_the_minimum(runs, tolerance):
    """Steps of a billion kelvin, which change nothing, were refused until none was left; all errors were large."""
    how = {**HOW, "freeze": ["sensitivity", "friction_velocity"]}
    insensitive = replace(BEGIN, {"sensitivity": 1e-12})
    result = fit(insensitive, runs[0], rig=None, solver=BoundedLevenbergMarquardt(tolerance=tolerance), **how)
    assert (result.rmse < 1.1 * NOISE) == result.converged == (tolerance < 1.0)
    assert result.converged or "sum of squares by more than 10 %" in result.warnings[0]


def test_settings_with_units_are_read_from_manifests_and_names(tmp_path, hot):
    hot.to_csv(tmp_path / "run_80degC_20bar.csv")
    (tmp_path / "jaxdamp.toml").write_text('settings = "run_{temperature}_{pressure}"')
    run = read(tmp_path)[0]
    assert run.settings == {"temperature": "80degC", "pressure": "20bar"}
    assert initial_temperature(run) == pytest.approx(353.15)
    again = read(run.to_csv(tmp_path / "again.csv"), manifest=False)[0]
    assert initial_temperature(again) == pytest.approx(353.15)


def test_a_scaled_law_takes_one_temperature_a_record_a_channel_or_its_own():
    def scaled(celsius):
        return TemperatureScaled(Bilinear(2600.0, 1500.0), 273.15 + celsius, sensitivity=0.003)

    def warm(celsius, frequency, seed):
        return VirtualDyno(scaled(celsius), 200.0, force_noise=5.0, seed=seed).run(SineTest(0.02, frequency))[0]

    known = [at(20.0, warm(20.0, 1.0, 0)), at(60.0, warm(60.0, 3.0, 1))]
    result = fit(TemperatureScaled(Bilinear(2000.0, 2000.0), 313.15, sensitivity=0.001), known)
    for name, true in {"rebound_rate": 2600.0, "compression_rate": 1500.0, "sensitivity": 0.003}.items():
        assert abs(result[name].value - true) < 4.0 * result[name].standard_error
    other = warm(90.0, 2.0, 2)
    channel = dataclasses.replace(other, temperature=np.full(len(other), 363.15))
    assert result.score(at(90.0, other))[1] < 6.0 and result.score(channel)[1] < 6.0
    assert result.score(other)[1] > 30.0 and result.score(warm(40.0, 2.0, 2))[1] < 6.0  # its own is 40 °C


def test_a_measured_temperature_in_celsius_is_refused():
    """Two records at 20 and 60 °C, given so, had a sixth of the rates: a law at 293 K that is told of 20 K."""
    run = record(0.0, 0.02, 1.0, 0, Linear(2000.0))
    cold, warm = (dataclasses.replace(run, temperature=np.full(len(run), celsius)) for celsius in (20.0, 60.0))
    for law in (TemperatureScaled(Linear(1500.0), 293.15), Heated(Linear(1500.0))):
        with pytest.raises(ValueError, match=r"`temperature of '20mm_1Hz'` must be in kelvin.* write it plus 273\.15"):
            fit(law, [cold, warm], bad_records="keep")


@pytest.mark.slow
def test_a_machine_that_tells_heat_begins_with_the_stated_temperature_too():
    machine = Rig(temperature_slope=0.004, heating=1 / 400, cooling=1 / 300)
    damper = Bilinear(2600.0, 1500.0)
    runs = []
    for seed, (rise, amplitude, frequency) in enumerate(MOTIONS[:3]):
        rig = dataclasses.replace(machine, initial_rise=rise)
        test = SineTest(amplitude, frequency, cycles=int(30 * frequency))
        runs.append(at(20.0 + rise, VirtualDyno(damper, 100.0, rig=rig, force_noise=NOISE, seed=seed).run(test)[0]))
    result = fit(Bilinear(2000.0, 2000.0), runs, rig="heat", samples_per_cycle=50, starts=1)
    assert abs(result["temperature_slope"].value - 0.004) < 4.0 * result["temperature_slope"].standard_error
    assert abs(result["rebound_rate"].value - 2600.0) < 4.0 * result["rebound_rate"].standard_error
