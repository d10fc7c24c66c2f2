"""Control charts: average run lengths beside closed forms, published ones and runs of the charts; lines of dampers."""

from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import norm

from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import Bilinear
from jaxdamp.identify import Cusum, Ewma, Shewhart, control_charts, fit_many
from jaxdamp.identify.control_charts import AbstractChart, signals


NAMES = [str(i + 1) for i in range(30)]


@pytest.mark.parametrize("shift", [0.0, 0.4, 1.5])
def test_run_lengths_that_have_a_closed_form(shift):
    individuals = 1.0 / (norm.sf(3.0 - shift) + norm.cdf(-3.0 - shift))
    assert Shewhart().average_run_length(shift) == pytest.approx(individuals, rel=1e-12)
    assert Ewma(1.0, 3.0).average_run_length(shift) == pytest.approx(individuals, rel=1e-8)
    sums = 1.0 / (norm.sf(2.0 - shift) + norm.sf(2.0 + shift))  # without a memory
    assert Cusum(2.0, 1e-9).average_run_length(shift) == pytest.approx(sums, rel=1e-6)


@pytest.mark.parametrize("shift", [0.5, 1.0, 1.5])
def test_run_lengths_of_sums_are_near_those_of_siegmund(shift):
    def one_side(drift):
        b = 5.0 + 1.166
        return (np.exp(-2.0 * drift * b) + 2.0 * drift * b - 1.0) / (2.0 * drift**2) if drift else b**2

    expected = 1.0 / (1.0 / one_side(shift - 0.5) + 1.0 / one_side(-shift - 0.5))
    assert Cusum().average_run_length(shift) == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(
    ("chart", "published"),  # Montgomery, Statistical Quality Control, 7th ed., tables 9.3 and 9.11
    [
        (Cusum(0.5, 5.0), {0.0: 465.0, 0.5: 38.0, 1.0: 10.4, 2.0: 4.01}),
        (Cusum(0.5, 4.0), {0.0: 168.0, 0.5: 26.6, 1.0: 8.38, 2.0: 3.34}),
        (Ewma(0.2, 2.962), {0.0: 500.0, 0.5: 41.8, 1.0: 10.5, 2.0: 3.7}),
        (Ewma(0.1, 2.814), {0.0: 500.0, 0.5: 31.3, 1.0: 10.3, 2.0: 4.4}),
    ],
)
def test_published_run_lengths(chart, published):
    for shift, length in published.items():
        assert chart.average_run_length(shift) == pytest.approx(length, rel=0.012)


@pytest.mark.parametrize("chart", [Shewhart(2.0), Ewma(0.2, 2.2), Cusum(0.5, 3.0)], ids=lambda chart: chart.name)
def test_charts_run_as_long_as_they_say(chart: AbstractChart):
    rng, lengths = np.random.default_rng(5), []
    for _ in range(400):
        out = np.flatnonzero(signals(chart, 0.3 + rng.standard_normal(400)))
        lengths.append(out[0] + 1)  # raises if none
    mean, spread = np.mean(lengths), np.std(lengths) / np.sqrt(len(lengths))
    assert abs(mean - chart.average_run_length(0.3)) < 4.0 * spread


def test_numbers_that_are_missing_change_nothing():
    scores = np.array([1.0, np.nan, 4.0, -9.0, np.nan, 0.2, 3.0, 3.0])
    for chart in (Shewhart(), Ewma(0.5, 2.0), Cusum(0.5, 4.0)):
        there = np.isfinite(scores)
        np.testing.assert_array_equal(signals(chart, scores)[there], signals(chart, scores[there]))
        assert not signals(chart, scores)[~there].any()


def test_a_drift_is_found_and_a_mended_cause_ends_the_signals():
    rng = np.random.default_rng(2)
    force = 1500.0 + 6.0 * rng.standard_normal(400)
    force[200:260] += 9.0
    found = control_charts({"force": force, "other": -force}, baseline=100)
    assert found.deviation[0] == pytest.approx(6.0, rel=0.15) and found.since("force") == ""
    cusum = found.signals["force"][2]
    assert cusum[215:260].all() and np.all(cusum[215:260] == 1) and not cusum[300:].any()
    np.testing.assert_array_equal(cusum, -found.signals["other"][2])
    late = control_charts({"force": force[:250]}, baseline=100)
    assert 199 <= int(late.since("force")) <= 204 and f"force since '{late.since('force')}'" in late.summary
    assert len(found.table().rows) == 400 and "force: " in str(found.table().rows[230][3])
    rates = sum(1.0 / chart.average_run_length() for chart in found.charts)
    assert found.false_alarms == pytest.approx(800 * rates)


@pytest.mark.slow
def test_a_line_of_fitted_dampers_is_charted_as_it_grows(tmp_path):
    def made(i):
        law = Bilinear(2000.0 + (150.0 if i == 35 else 0.0) + 7.0 * np.sin(12.9898 * i**2), 1200.0)
        return VirtualDyno(law, force_noise=4.0, sampling_rate=100.0, seed=i).run(SineTest(0.02, 1.0))

    records, file = {f"No. {i}": made(i) for i in range(40)}, tmp_path / "line.zarr"
    morning = fit_many(Bilinear, {name: records[name] for name in list(records)[:30]}, file=file)
    before = control_charts(morning, baseline=30)
    found = control_charts(fit_many(Bilinear, records, file=file), baseline=list(morning.names))
    np.testing.assert_array_equal(found.centre, before.centre)
    assert found.names[35] == "No. 35" and found.quantities == {"rebound_rate": "N s/m", "compression_rate": "N s/m"}
    assert found.signals["rebound_rate"][0, 35] == 1 and not found.signals["rebound_rate"][0, :35].any()
    assert found.fit_share[0] < 0.5 < found.fit_share[1] and "compression_rate: the error of the fits" in " ".join(
        found.warnings
    )
    page = found.report(tmp_path / "line.html").read_text()
    assert "No. 35" in page and "individuals high" in page and "until a signal" in page


def test_an_infinite_number_is_a_missing_one_and_the_baseline_any_whole_number():
    force = np.random.default_rng(3).standard_normal(120)
    force[80:] -= 2.0
    missing, infinite = (np.where(np.arange(120) == 60, value, force) for value in (np.nan, np.inf))
    expected = control_charts({"force": missing}, baseline=50)
    found = control_charts({"force": infinite}, baseline=cast(int, np.int64(50)))
    np.testing.assert_array_equal(found.signals["force"], expected.signals["force"])
    assert found.summary == expected.summary and "force since '8" in found.summary
    assert found.warnings == expected.warnings and "without some number" in found.warnings[-1]
    assert not signals(Cusum(), infinite[:80])[65:].any()


def test_a_damper_of_the_baseline_that_widens_the_limits_is_named():
    force = 100.0 + np.random.default_rng(3).standard_normal(60)
    assert not control_charts({"force": force}, baseline=30).warnings
    force[3] += 40.0
    found = control_charts({"force": force, "other": np.flip(force)}, baseline=30)
    assert found.deviation[0] > 2.0
    (said,) = found.warnings
    assert (
        "force: dampers of the baseline lie far" in said
        and "deviations): '4' (+" in said
        and "baseline` of names without" in said
    )
    mended = control_charts({"force": force}, baseline=[name for name in NAMES if name != "4"])
    assert not mended.warnings and mended.deviation[0] == pytest.approx(1.0, rel=0.25)


@pytest.mark.parametrize("missing", [25, 29])
def test_a_shift_lasts_beside_a_damper_without_the_number(missing):
    force = 100.0 + np.random.default_rng(1).standard_normal(30)
    force[20:] += 4.0
    force[missing] = np.nan
    assert control_charts({"force": force}, baseline=20).since("force") == "21"
    assert control_charts({"force": force}, baseline=20, charts=[Ewma()]).since("force") == "22"


def test_two_charts_of_a_kind_are_told_apart():
    force = np.random.default_rng(3).standard_normal(30)
    force[20:] += 3.0
    found = control_charts({"force": force}, baseline=20, charts=[Ewma(0.1, 2.8), Shewhart(), Ewma(0.4, 2.8)])
    slow, fast = "Ewma(weight=0.1, width=2.8)", "Ewma(weight=0.4, width=2.8)"
    (row,) = found.tables()["limits"].records()
    for place, name in enumerate([slow, "individuals", fast]):
        assert row[f"{name}, signals"] == np.count_nonzero(found.signals["force"][place]) > 0
    assert slow in (text := str(found.table())) and fast in text
    assert [length["chart"] for length in found.tables()["run_lengths"].records()] == [slow, "individuals", fast]


def test_labels_that_repeat_outside_the_baseline_do_no_harm():
    force = np.random.default_rng(3).standard_normal(30)
    found = control_charts({"force": force}, baseline=NAMES[9:19], names=[*NAMES[:28], "3", "4"])
    np.testing.assert_array_equal(found.baseline, np.arange(9, 19))
    assert found.centre[0] == pytest.approx(force[9:19].mean())


def test_what_cannot_be_charted_is_refused():
    force = np.random.default_rng(0).standard_normal(30)
    cases: list[tuple[Any, Any, dict[str, Any], str]] = [
        ([1.0], 10, {}, "`dampers` must be the result of `fit_many`"),
        ({"a": force, "b": force[1:]}, 10, {}, r"dampers\['b'\]` must be one number for each of 30"),
        ({"a": force}, 3, {}, "`baseline` must be from 8 to 30 dampers"),
        ({"a": force}, ["7", "x"], {}, "`baseline` must be one of"),
        ({"a": force}, [*NAMES[:10], "9"], {}, "`baseline` must name each damper once, but is '9' repeatedly"),
        ({"a": force}, NAMES[:10], {"names": [*NAMES[:28], "3", "4"]}, "is '3', of numbers 3, 29. Give labels that"),
        ({"a": force * 0.0}, 10, {}, "8 or more dampers that determine 'a' and are not all alike"),
        ({"a": force}, 10, {"names": ["a"]}, "`names` must be one for each of 30 dampers"),
        ({"a": force}, 10, {"charts": []}, "`charts` must hold one or more"),
        ({"a": force}, 10, {"charts": ["EWMA"]}, r"`charts\[0\]` must be a chart"),
    ]
    for dampers, baseline, options, message in cases:
        with pytest.raises(ValueError, match=message):
            control_charts(dampers, baseline, **options)
    with pytest.raises(ValueError, match="`weight` must be above 0 and at most 1"):
        Ewma(1.2)
    with pytest.raises(ValueError, match="`decision`"):
        Cusum(0.5, 0.0)
