"""One law for records at several settings, scored at settings that it was not fitted to."""

import dataclasses
import json
from typing import Any

import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import Bilinear, Lag, Linear, ModifiedBoucWen, Scaled, Scheduled, Spring, with_command
from jaxdamp.identify.rungs import cannot_choose, not_worse
from jaxdamp.parameters import get
from jaxdamp.rig import Rig


@pytest.fixture(scope="module")
def runs():
    """A bilinear damper whose rates are straight lines in the current, at three currents."""
    records = []
    for current in (0.0, 1.0, 2.0):
        dyno = VirtualDyno(Bilinear(1000.0 + 500.0 * current, 600.0), 200.0, force_noise=5.0, seed=int(current))
        records += [dataclasses.replace(r, command=current) for r in dyno.run([SineTest(0.01, 4.0, cycles=3)])]
    return records


def test_a_setting_between_others_is_predicted_without_its_records(runs):
    found = identify.fit_scheduled(Bilinear, runs)
    assert isinstance(found.law, Scheduled) and list(found.law.levels) == [0.0, 1.0, 2.0]
    (left,) = found.between
    assert left.setting == 1.0 and all(run.command != 1.0 for run in left.result.runs)
    law = with_command(left.result.law, 1.0)
    assert float(law.force(0.0, 1.0, law.initial_state())) == pytest.approx(1500.0, rel=0.01)
    assert (left.fit_percent, left.rmse) == left.result.score(left.runs)[:2]
    assert found.score(runs) == found.result.score(runs)
    assert len(found.respond(runs[0])) == len(runs[0])
    assert 1.0 <= left.rmse / left.own_rmse < 1.1
    assert found.choice.blend == found.law.blend == "parameters"  # both are as good, and this is one law
    assert found.verdict[1].startswith("Parameters are interpolated") and found.verdict[1] == found.choice.reason
    assert "interpolated to 1, whose records" in found.verdict[2]
    row = found.table().records()[1]
    assert row["setting"] == 1.0 and row["interpolated"] == pytest.approx(left.fit_percent)
    json.dumps(found.to_dict(), allow_nan=False)
    assert found.plot().axes
    with pytest.raises(ValueError, match="all state their command"):
        identify.fit_scheduled(Bilinear, [dataclasses.replace(runs[0], command=None), *runs[1:]])
    with pytest.raises(ValueError, match="two commands or more"):
        identify.fit_scheduled(Bilinear, runs[:1])


def test_each_record_has_a_zero_error_of_its_own(runs):
    more = [dataclasses.replace(run, name=f"{run.name} again", force=run.force + 80.0) for run in runs]
    found = identify.fit_scheduled(Bilinear, [*runs, *more], rig="offset", per_record=["force_offset"], starts=1)
    offsets = [e.value for e in found.result.parameters if "force_offset" in e.name]
    assert len(offsets) == 6 and sorted(offsets) == pytest.approx([0.0] * 3 + [80.0] * 3, abs=2.0)
    assert found.result.rmse < 5.5
    with pytest.raises(ValueError, match="name numbers of the machine for a law at settings"):
        identify.fit_scheduled(Bilinear, runs, per_record=["rebound_rate"])


@pytest.mark.parametrize(
    "said",
    [
        {"freeze": ["law.rebound_rate"]},
        {"over": ["law.compression_rate"]},
        {"bounds": {"law.rebound_rate": (900.0, 2100.0)}, "common": ["law.rebound_rate"]},
        {"priors": {"law.rebound_rate": (1000.0, 1e5)}, "common": ["law.rebound_rate"]},
    ],
    ids=lambda said: "-".join(said),
)
def test_names_of_a_law_beside_the_machine_hold_at_all_settings(runs, said):
    """They were refused after the fits of every setting, where the paths are longer."""
    found = identify.fit_scheduled(Bilinear(1500.0, 1500.0), runs, starts=1, **said)
    rates = [f"law.laws.{k}.rebound_rate" for k in range(3)]
    free = rates[:1] if "common" in said else []
    assert [e.name for e in found.result.parameters if e.name in rates] == free


def test_wrong_names_are_refused_before_any_fit(runs):
    shown: list[str] = []
    wrong: list[Any] = [{"common": ["rate"]}, {"freeze": ["law.rate"]}]
    for said in wrong:
        with pytest.raises(ValueError, match="No parameter is named"):
            identify.fit_scheduled(Bilinear, runs, progress=shown.append, **said)
    assert set(shown) == {"0 alone"}


def test_a_name_means_at_all_settings_what_it_means_at_one(runs):
    """The last part of a longer path counts too, so that the lag inside was held in the common fit."""
    some, law = [run for run in runs if run.command != 2.0], Lag(Lag(Linear(1000.0), 1e-3), 2e-3)
    result = identify.fit_scheduled(law, some, rig=None, freeze=["lag_time"], starts=1).result
    free = [f"laws.{k}.law.{name}" for k in range(2) for name in ("law.rate", "lag_time")]
    assert sorted(e.name for e in result.parameters) == sorted(free)


FACTORS = {0.0: 4.0, 1.0: 1.0, 2.0: 0.25}


def of_arbitrary_numbers(runs):
    """A start whose rate times factor is the damping: the rate means something else at every setting."""
    factor = FACTORS[runs[0].command]
    return Scaled(Linear(800.0 / factor), factor)


@pytest.mark.parametrize("settings", [(0.0, 2.0), pytest.param((0.0, 1.0, 2.0), marks=pytest.mark.slow)])
def test_forces_are_blended_where_the_numbers_of_the_settings_do_not_belong_together(runs, settings):
    some = [run for run in runs if run.command in settings]
    found = identify.fit_scheduled(of_arbitrary_numbers, some, freeze=["factor"])
    assert found.choice.blend == found.law.blend == "force" and found.choice.reason in found.verdict
    low, half, high = (with_command(found.law, u).force(0.0, 0.1, found.law.initial_state()) for u in (0.0, 0.5, 1.0))
    assert float(half) == pytest.approx(0.5 * float(low + high))
    # the forces at the settings are those of the common fit, whose evidence has the blended law too
    with_parameters = identify.fit_scheduled(of_arbitrary_numbers, some, freeze=["factor"], blend="parameters")
    assert found.result.fit_percent == pytest.approx(with_parameters.result.fit_percent, abs=1e-9)
    at_half = found.result.propagate(lambda law: with_command(law, 0.5).force(0.0, 0.1, law.initial_state()))
    assert float(at_half.value) == pytest.approx(float(half))
    said = [warning for warning in with_parameters.result.warnings if "leaves the span" in warning]
    assert len(said) == len(settings) - 1 and not any("leaves the span" in w for w in found.result.warnings)
    if found.between:
        assert found.between[0].fit_percent > 60.0 > with_parameters.between[0].fit_percent


def test_laws_of_different_structure_are_blended(runs):
    def start(runs):
        return Linear(1000.0) if runs[0].command == 0.0 else Bilinear(1500.0, 600.0)

    found = identify.fit_scheduled(start, [run for run in runs if run.command != 2.0])
    assert found.law.blend == "force" and "different structures" in found.choice.reason
    assert [type(law) for law in found.law.laws] == [Linear, Bilinear]


@pytest.mark.slow
def test_common_parameters_have_one_value_at_all_settings(runs):
    found = identify.fit_scheduled(Bilinear, runs, common=["compression_rate"])
    assert len(found.result.parameters) == 5  # three rebound rates, one compression rate, the offset of the load cell
    rates = [float(get(law, "compression_rate")) for law in found.law.laws]
    assert rates == [rates[0]] * 3 and rates[0] == pytest.approx(600.0, rel=0.01)


@pytest.mark.parametrize("common", [(), ("rebound_rate",), ("compression_rate",)])
@pytest.mark.parametrize("rig", [None, "offset"])
def test_tied_parameters_have_one_value_at_each_setting(runs, rig, common):
    inside = "law." if rig else ""
    tie = {f"{inside}compression_rate": f"{inside}rebound_rate"}
    found = identify.fit_scheduled(Bilinear, runs, tie=tie, common=common, rig=rig, starts=1)
    sums = [
        np.sum([[r.velocity @ r.force, r.velocity @ r.velocity] for r in at.runs], 0) for at in found.alone.values()
    ]
    rates = [force / square for force, square in ([np.sum(sums, 0)] * 3 if common else sums)]
    for name in ("rebound_rate", "compression_rate"):
        assert [float(get(law, name)) for law in found.law.laws] == pytest.approx(rates, rel=1e-3)
    assert len(found.result.parameters) == len(set(rates)) + bool(rig)


def test_a_common_force_of_the_machine_is_tied_once(runs):
    some = [run for run in runs if run.command != 2.0]
    start, how = Linear(1000.0) + Spring(0.0, 1.0), {"rig": Rig(force_offset=1.0), "freeze": ["stiffness"], "starts": 1}
    found = identify.fit_scheduled(start, some, tie={"force_offset": "preload"}, **how)
    assert found.result.rig is not None
    offset = float(found.result.rig.force_offset)
    assert [float(get(law, "terms.1.preload")) for law in found.law.laws] == [offset] * 2
    assert 2.0 * offset == pytest.approx(np.mean([run.force for run in some]), rel=0.01)


def test_a_comparison_counts_tied_numbers_once(runs):
    some, tie = [run for run in runs if run.command != 1.0], {"compression_rate": "rebound_rate"}
    tied, linear = identify.compare({"tied": Bilinear, "linear": Linear}, some, scheduled=True, tie=tie).rungs
    assert tied.parameters == linear.parameters == 3  # two rates, the offset of the load cell
    assert tied.rmse == pytest.approx(linear.rmse, rel=1e-6)


@pytest.mark.slow
def test_a_comparison_of_laws_that_depend_on_the_setting(runs):
    laws = {"bilinear": Bilinear, "modified": ModifiedBoucWen.prototype()}
    comparison = identify.compare(laws, runs, scheduled=True)
    assert "take no command itself" in comparison.failed[0].reason
    assert list(comparison.best.laws()) == ["bilinear at 0", "bilinear at 1", "bilinear at 2"]
    assert "bilinear interpolated to 1" in comparison.verdict[-1]


@pytest.mark.slow
def test_the_laws_alone_are_judged_from_the_states_that_they_were_fitted_with():
    """Twelve cycles on, cut in motion: from rest a lag of half a second is far off."""
    runs = []
    for command in (0.0, 1.0):
        dyno = VirtualDyno(Lag(Linear(1500.0 + 500.0 * command), 0.5), sampling_rate=200.0, force_noise=1.0)
        (run,) = dyno.run(SineTest(0.02, 2.0, cycles=12)).process(between=(4.8, 5.95))
        runs.append(dataclasses.replace(run, command=command, name=f"{command:g}"))
    start, how = Lag(Linear(1500.0), 0.4), {"initial_state": "periodic", "rig": None}
    together = identify.fit_scheduled(start, runs, starts=1, **how)
    for run, alone in zip(runs, together.alone.values(), strict=True):
        assert alone.rmse == pytest.approx(identify.fit(start, [run], **how).rmse, rel=0.02)


def test_laws_that_the_records_cannot_tell_apart_are_named():
    errors = {"linear": [20.0, 41.0, 29.0], "bilinear": [11.0, 18.0, 16.0], "table": [10.0, 20.0, 15.0]}
    (said,) = cannot_choose(errors, "table", {"linear": 2, "bilinear": 3, "table": 9})
    assert "cannot choose between table and bilinear:" in said and "is bilinear, with 3 numbers" in said
    assert not cannot_choose({name: errors[name] for name in ("linear", "table")}, "table", {"linear": 2, "table": 9})
    assert not_worse({"a": [10.0], "b": [10.05], "c": [10.2]}, "a") == ["b"]  # one record: what varies is unknown


@pytest.mark.slow
def test_a_comparison_says_that_its_records_cannot_choose(sines):
    runs = sines(Linear(1500.0), noise=20.0)
    laws = identify.default_ladder(runs, ["linear", "bilinear"])
    said = identify.compare(laws, runs).verdict[1]
    assert said.startswith("With 2 numbers it is the simplest of linear and bilinear, which predict alike")


def test_without_settings_a_fit_is_one_of_a_law() -> None:
    runs = VirtualDyno(Linear(1500.0), sampling_rate=100.0).run(SineTest(0.01, 1.0))
    how: Any = {"scheduled": False}
    assert float(identify.fit(Linear, runs, **how).law.rate) == pytest.approx(1500.0)
