"""Records of the same motion with another force are named; repetitions and a little warmth are not."""

from dataclasses import replace

import numpy as np
import pytest

from jaxdamp.bench import (
    RandomTest,
    SineTest,
    VirtualDyno,
    contradictions,
    contradictions_in_words,
    preflight,
    read,
    settings_apart,
)
from jaxdamp.dampers import Heated, Linear, Scheduled
from jaxdamp.identify import compare, fit, fit_many, fit_scheduled
from jaxdamp.parameters import get


def record(name, rate=1500.0, *, amplitude=0.02, frequency=2.0, seed=0, noise=10.0, **more):
    dyno = VirtualDyno(Linear(rate), sampling_rate=500.0, force_noise=noise, stroke_noise=1e-5, seed=seed, **more)
    return dyno.run(SineTest(amplitude, frequency, name=name))[0]


def test_another_setting_is_named_with_its_size():
    soft, hard, other = record("soft"), record("hard", 2500.0, seed=1), record("slow", frequency=1.0)
    (found,) = contradictions([soft, other, hard])
    assert (found.first, found.second) == ("soft", "hard")
    # 1000 N s/m times the RMS velocity, of forces of 1500 and 2500 N s/m
    velocity = 2 * np.pi * 2.0 * 0.02 / np.sqrt(2)
    assert found.difference == pytest.approx(1000.0 * velocity, rel=0.02)
    assert found.share == pytest.approx(1000.0 / np.sqrt(0.5 * (1500.0**2 + 2500.0**2)), rel=0.02)
    assert 0.0 < found.scatter < 10.0
    (sentence,) = contradictions_in_words([found])
    assert "soft and hard by 177 N (49 % of their RMS force" in sentence


@pytest.mark.parametrize(
    ("names", "settings"),
    [
        (("soft_0A", "mid_0.5A", "hard_1.0A"), ["0A", "0.5A", "1.0A"]),
        (
            ("C2 R1", "C2 R4", "C9 R1"),
            [f"compression {c} rebound {r}" for c, r in ((2, 1), (2, 4), (9, 1))],
        ),
        (("first", "second", "third"), ["first", "second", "third"]),
    ],
    ids=["current", "two clickers", "nothing stated"],
)
def test_one_record_of_each_setting_is_told_apart_by_its_name_if_that_states_it(names, settings):
    runs = [record(name, rate) for name, rate in zip(names, (900.0, 1500.0, 2500.0), strict=True)]
    found, sentence = settings_apart(runs)
    assert [found[name] for name in names] == settings
    assert ("neither names nor settings tell them apart" in sentence) == (names[0] == "first")


def test_records_of_one_name_are_named_once():
    runs = [record("20mm_2Hz"), record("20mm_2Hz", 2500.0, seed=1)]
    (sentence,) = contradictions_in_words(contradictions(runs))
    assert ": two records 20mm_2Hz by 17" in sentence
    assert preflight(runs).named("contradiction")[0].record == "20mm_2Hz, 20mm_2Hz (2)"
    apart = [replace(run, settings={"clicks": number}) for number, run in enumerate(runs)]
    assert not preflight(apart).named("contradiction")  # what was set explains it


def test_a_gas_force_contradicts_too():
    assert len(contradictions([record("a"), record("b", gas_force=-100.0)])) == 1


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({}, {"seed": 1}),
        ({}, {"rate": 1500.0 * 0.94, "seed": 1}),
        ({}, {"rate": 2500.0, "amplitude": 0.024}),
        ({}, {"rate": 2500.0, "frequency": 2.3}),
        ({"rate": 3.0, "noise": 60.0}, {"rate": 4.0, "noise": 60.0, "seed": 1}),
    ],
    ids=["repetition", "warmth", "another amplitude", "another frequency", "noise"],
)
def test_what_does_not_contradict(one, other):
    pair = record("a", **one), record("b", **other)
    assert contradictions(pair) == [] == contradictions_in_words(contradictions(pair))


def test_the_phase_at_which_a_record_begins_does_not_matter():
    run = record("a")
    later = replace(run.between(0.13, 1.5), name="later")
    assert contradictions([run, later]) == []
    turned = replace(later, force=1.3 * later.force)
    assert len(contradictions([run, turned])) == 1


def test_motions_that_do_not_repeat_are_not_compared():
    test = RandomTest(duration=10.0)
    runs = [VirtualDyno(Linear(c), sampling_rate=200.0).run(test)[0] for c in (1000.0, 3000.0)]
    assert contradictions(runs) == []


REFUSED = (
    "must be records that one law can follow, .* soft and hard by 177 N .*`command`.*fit_scheduled.*fit_many.*keep"
)


@pytest.mark.parametrize("bad_records", ["refuse", "leave_out"])
def test_one_law_is_not_fitted_to_records_that_contradict_each_other(bad_records):
    runs = [record("soft"), record("hard", 2500.0, seed=1)]
    with pytest.raises(ValueError, match=REFUSED):
        fit(Linear, runs, bad_records=bad_records)
    with pytest.raises(ValueError, match=f"None of 2 laws could be fitted. Argument `runs` {REFUSED}"):
        compare({"linear": Linear, "again": Linear(1.0)}, runs, progress=lambda _: None, bad_records=bad_records)
    with pytest.raises(ValueError, match=r"Argument `dampers\['mixed'\]` " + REFUSED):
        fit_many(Linear, {"one": [record("one")], "mixed": runs}, bad_records=bad_records)
    settings = [replace(run, command=1.0) for run in runs]
    with pytest.raises(ValueError, match=REFUSED):
        fit_scheduled(Linear, [replace(record("other"), command=0.0), *settings], bad_records=bad_records)


def test_records_that_contradict_each_other_are_pooled_when_told():
    runs = [record("soft"), record("hard", 2500.0, seed=1)]
    words = "Records of the same motion differ in force"
    pooled = fit(Linear, runs, bad_records="keep")
    assert pooled["rate"].value == pytest.approx(2000.0, rel=0.01)
    assert any(words in w and "soft and hard" in w for w in pooled.warnings)
    ladder = compare({"linear": Linear, "again": Linear(1.0)}, runs, progress=lambda _: None, bad_records="keep")
    assert any(words in w for w in ladder.warnings) and words in repr(ladder)
    assert fit_many(Linear, {"mixed": runs}, bad_records="keep").values[0, 0] == pytest.approx(2000.0, rel=0.01)


def test_what_differs_from_record_to_record_does_not_contradict():
    """A record that is left out, numbers of each record, and a temperature that the law follows."""
    runs = [record("soft"), record("hard", 2500.0, seed=1)]
    assert not any("same motion" in w for w in fit(Linear, runs, weighting=[1.0, np.inf]).warnings)
    each = fit(Linear, runs, per_record=["rate"])
    np.testing.assert_allclose([get(law, "rate") for law in each.record_laws], [1500.0, 2500.0], rtol=0.01)
    warm = [replace(run, temperature=np.full(len(run), at)) for run, at in zip(runs, (330.0, 290.0), strict=True)]
    follows = fit(Heated(Linear(1500.0), reference_temperature=290.0), warm, freeze=["static_force_slope"])
    assert follows["rate"].value == pytest.approx(2500.0, rel=0.01)
    assert not any("same motion" in w for w in follows.warnings)


def test_a_comparison_keeps_the_laws_that_follow_the_command():
    runs = [replace(record("soft"), command=0.0), replace(record("hard", 2500.0, seed=1), command=1.0)]
    follows = Scheduled((Linear(1000.0), Linear(1000.0)), levels=[0.0, 1.0], command=0.0)
    ladder = compare({"linear": Linear, "scheduled": follows}, runs, progress=lambda _: None)
    assert ladder.best.name == "scheduled"
    assert [(f.name, "one law can follow" in f.reason) for f in ladder.failed] == [("linear", True)]


def test_a_law_that_follows_the_command_is_not_contradicted():
    runs = [replace(record("soft"), command=0.0), replace(record("hard", 2500.0, seed=1), command=1.0)]
    assert len(contradictions(runs)) == 1
    follows = Scheduled((Linear(1000.0), Linear(1000.0)), levels=[0.0, 1.0], command=0.0)
    result = fit(follows, runs)
    assert not any("same motion" in w for w in result.warnings)
    np.testing.assert_allclose([e.value for e in result.parameters], [1500.0, 2500.0], rtol=0.01)


def test_measured_currents_contradict_each_other_and_not_themselves(data):
    runs = list(read(sorted((data / "mr_damper").glob("*.csv")), sign="rebound-positive"))
    named = {frozenset((pair.first, pair.second)) for pair in contradictions(runs)}
    motions = ("25mm_0.25Hz", "25mm_0.5Hz", "2mm_5.0Hz", "5mm_3.0Hz")
    assert {frozenset((f"{m}_0A", f"{m}_1.0A")) for m in motions} <= named
    assert {frozenset((f"{m}_0A", f"{m}_0.5A")) for m in motions} <= named
    assert all(len({name.split("Hz")[0] for name in pair}) == 1 for pair in named)
    for current in ("0A", "0.5A", "1.0A"):
        assert contradictions([run for run in runs if run.name.endswith(f"_{current}")]) == []
