"""Held-out scores are those of laws that never saw the record."""

import dataclasses
import json

import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import SineTest, VirtualDyno
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
