"""Held-out scores are those of laws that never saw the record."""

import dataclasses
import json
import re

import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import SineTest, VirtualDyno, evaluate, read
from jaxdamp.dampers import Bilinear, Lag, Linear


@pytest.fixture(scope="module")
def runs():
    dyno = VirtualDyno(Lag(Bilinear(2600.0, 1200.0), 0.004), sampling_rate=400.0, force_noise=10.0)
    return list(dyno.run([SineTest(0.01, f, cycles=3) for f in (1.0, 3.0, 5.0)]))


@pytest.mark.exhaustive
def test_an_infinite_weighting_leaves_a_record_out(runs):
    start = Lag(Bilinear(2000.0, 1000.0), 0.002)
    without = identify.fit(start, runs[:2], force_noise=10.0)
    beside = identify.fit(start, runs, weighting=[1.0, 1.0, np.inf], force_noise=10.0)
    for a, b in zip(without.parameters, beside.parameters, strict=True):
        np.testing.assert_allclose((b.value, b.standard_error), (a.value, a.standard_error), rtol=1e-4)
    np.testing.assert_allclose(beside.fit_percent, without.fit_percent, rtol=1e-6)
    assert beside.scores[2].fit_percent == pytest.approx(without.score(runs[2:])[0], rel=1e-4)
    with pytest.raises(ValueError, match="`weighting` must leave at least one record"):
        identify.fit(start, runs, weighting=[np.inf] * 3)


def test_each_record_is_predicted_by_a_law_fitted_to_the_others(runs):
    found = identify.cross_validate({"linear": Linear, "bilinear": Bilinear}, runs)
    assert [(f.law, f.held_out) for f in found.folds] == [(n, r.name) for n in ("linear", "bilinear") for r in runs]
    for out, fold in enumerate(found.folds[3:]):
        expected = identify.fit(Bilinear, [r for i, r in enumerate(runs) if i != out], rig="offset").score([runs[out]])
        np.testing.assert_allclose((fold.fit_percent, fold.rmse), expected[:2], rtol=1e-5)
    assert found.best == "bilinear"
    assert found.fit_percent("linear") == pytest.approx(np.mean([f.fit_percent for f in found.folds[:3]]))
    assert found.rmse("linear") == pytest.approx(np.sqrt(np.mean([f.rmse**2 for f in found.folds[:3]])))
    assert repr(found).splitlines()[-1] == "best: bilinear"


def test_groups_are_fitted_on_their_own(runs):
    soft = VirtualDyno(Bilinear(500.0, 500.0), sampling_rate=400.0, force_noise=1.0, seed=3)
    both = [*runs[:2], *soft.run([SineTest(0.011, f, cycles=3) for f in (1.0, 3.0)])]

    def group(run):
        return "soft" if run.force.max() < 150.0 else "firm"

    found = identify.cross_validate({"bilinear": Bilinear}, both, by=group)
    assert found.groups == ("firm", "soft")
    assert found.fit_percent("bilinear", "soft") > 95.0
    (row,) = found.table().records()
    assert list(row) == ["law", "firm", "soft", "all", "RMSE"] and row["RMSE"] == found.rmse("bilinear")
    plain = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert plain["folds"][0]["rmse"] == {"value": found.folds[0].rmse, "unit": "N"}
    assert plain["folds"][0]["group"] == "firm" and len(plain["folds"]) == 4
    more = found + identify.cross_validate({"linear": Linear}, both, by=group)
    assert more.laws == ("bilinear", "linear")
    with pytest.raises(ValueError, match="two records or more"):
        identify.cross_validate({"bilinear": Bilinear}, both[:3], by=group)
    with pytest.raises(KeyError, match="No folds of 'bi'"):
        found.fit_percent("bi")


def test_the_law_for_a_record_is_chosen_without_it(runs):
    laws = {"linear": Linear, "bilinear": Bilinear}
    found = identify.cross_validate(laws, runs, nested=True, weighting="runs")
    assert len(found.folds) == 6 and len(found.inner) == 12
    names = [run.name for run in runs]
    for fold in found.inner:
        known = [i for i, name in enumerate(names) if name not in (fold.held_out, fold.also_out)]
        assert len(known) == 1 and fold.held_out != fold.also_out
    fold = next(f for f in found.inner if (f.law, f.held_out, f.also_out) == ("bilinear", names[1], names[0]))
    expected = identify.fit(Bilinear, runs[2:], rig="offset").score([runs[1]])
    np.testing.assert_allclose((fold.fit_percent, fold.rmse), expected[:2], rtol=1e-5)
    assert [(c.held_out, c.law) for c in found.choices] == [(name, "bilinear") for name in names]
    assert found.chosen_fit_percent == pytest.approx(found.fit_percent("bilinear"))
    # Scores in the record that is scored do not matter: with them turned round, the same laws are chosen.
    turned = dataclasses.replace(found, folds=tuple(f._replace(fit_percent=-f.fit_percent) for f in found.folds))
    assert [choice.law for choice in turned.choices] == ["bilinear"] * 3
    assert "Chosen without the record that is scored (bilinear)" in found.verdict[-1]
    with pytest.raises(ValueError, match="three records or more"):
        identify.cross_validate(laws, runs[:2], nested=True)
    with pytest.raises(ValueError, match="nested=True"):
        _ = identify.cross_validate({"linear": Linear}, runs[:2]).choices


def test_records_without_a_group_values_per_record_and_bad_records(runs):
    commanded = [dataclasses.replace(run, command=1.0) for run in runs[:2]]
    found = identify.cross_validate({"linear": Linear}, [*commanded, *runs[1:]], by=lambda run: run.command)
    assert found.groups == (1.0, "None") and len(found.folds) == 4
    assert found.fit_percent("linear", "None") == pytest.approx(np.mean([f.fit_percent for f in found.folds[2:]]))
    own = {"rig": "gas", "per_record": ["rig.gas_force"]}
    first = identify.cross_validate({"linear": Linear}, runs, **own).folds[0]
    expected = identify.fit(Linear, runs[1:], **own).score([runs[0]])
    assert (first.fit_percent, first.rmse) == pytest.approx(expected[:2], rel=1e-6)
    (bad,) = VirtualDyno(Bilinear(2600.0, 1200.0), force_limit=300.0).run([SineTest(0.02, 1.5)])
    spared = identify.cross_validate({"linear": Linear}, [bad, *runs], bad_records="leave_out")
    assert [fold.held_out for fold in spared.folds] == [run.name for run in runs]
    weighed = identify.fit(Linear, [bad, *runs[:2]], bad_records="leave_out", weighting=[3.0, 1.0, 2.0])
    same = identify.fit(Linear, runs[:2], weighting=[1.0, 2.0])
    assert weighed["rate"].value == same["rate"].value and weighed.runs == same.runs


@pytest.mark.slow
def test_records_of_one_name_are_told_apart(runs):
    more = VirtualDyno(Lag(Bilinear(2600.0, 1200.0), 0.004), sampling_rate=400.0, force_noise=10.0, seed=1)
    again = list(more.run([SineTest(0.01, f, cycles=3) for f in (1.0, 3.0)]))
    both = [*runs[:2], *again]
    names = (runs[0].name, runs[1].name, f"{runs[0].name} (2)", f"{runs[1].name} (2)")
    result = identify.fit(Bilinear, both)
    assert tuple(score.name for score in result.scores) == names and tuple(r.name for r in result.runs) == names
    assert result.runs[2].notes[-1] == f"called {names[2]!r}, as another record is called {names[0]!r}"
    assert again[0].name == names[0]  # the caller's record stays as it is
    assert result.score(both) == result.score(result.runs)
    nested = identify.cross_validate({"linear": Linear, "bilinear": Bilinear}, both, nested=True)
    assert tuple(choice.held_out for choice in nested.choices) == names
    evaluation = evaluate(both)
    assert evaluation.cycles[names[0]].force[0, 0] != evaluation.cycles[names[2]].force[0, 0]


def test_a_record_that_is_read_again_is_one_of_the_fit(runs, tmp_path):
    result = identify.fit(Linear, runs, per_record=["rate"])
    files = [run.to_csv(tmp_path / f"{number}.csv") for number, run in enumerate(runs)]
    again = read(files)
    assert result.score(again)[1] == pytest.approx(result.rmse, rel=1e-12)
    other = dataclasses.replace(runs[0], force=1.1 * runs[0].force)
    mean = float(result.law.rate)  # of a record that is new
    np.testing.assert_allclose(result.respond(other), mean * other.velocity, atol=1e-6)
    own = float(result.record_laws[0].rate)
    np.testing.assert_allclose(result.respond(again[0]), own * runs[0].velocity, atol=1e-6)
    assert abs(mean / own - 1.0) > 1e-3
    assert result.respond([]) == []
    with pytest.raises(ValueError, match="`runs` must hold at least one record, but is empty"):
        result.score([])


def test_several_commands_that_a_law_does_not_follow_are_said(runs):
    soft = VirtualDyno(Bilinear(1500.0, 700.0), sampling_rate=400.0, force_noise=10.0).run([SineTest(0.02, 2.0)])
    apart = [dataclasses.replace(run, command=float(i > 0)) for i, run in enumerate([runs[0], *soft])]
    said = r"several commands \(0 to 1\), which this law does not follow"
    assert any(re.search(said, text) for text in identify.fit(Bilinear, apart).warnings)
    own = identify.fit(Bilinear, apart, per_record=["rebound_rate", "compression_rate"])
    assert not any(re.search(said, text) for text in own.warnings)
    assert not any(re.search(said, text) for text in identify.fit(Bilinear, apart[1:]).warnings)
