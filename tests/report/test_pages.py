"""Pages of fits, rides and tunings: what stands on them, without the command line."""

import dataclasses
import pickle
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from jaxdamp import bench, identify, roads, simulate, tune, vehicles
from jaxdamp._display import Display, shown_in
from jaxdamp._words import first_upper, said
from jaxdamp.bench import SineTest
from jaxdamp.cli.wording import message
from jaxdamp.dampers import Bilinear, FittedRange, Linear, with_fitted_range
from jaxdamp.identify import Comparison
from jaxdamp.report import (
    Attempts,
    FitPart,
    Report,
    add_tuning,
    baseline_table,
    bench_report,
    bench_verdict,
    chain_report,
    chains,
    fit_report,
    fits,
    law_evaluation,
    ride_report,
    ride_verdict,
    tuning_report,
)
from jaxdamp.rig import Rig
from jaxdamp.simulation import Response, Ride
from jaxdamp.tune import TuneResult


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    dyno = bench.VirtualDyno(Bilinear(2600.0, 1200.0), sampling_rate=500.0, force_noise=2.0)
    runs = dyno.run([SineTest(0.01, f, name=f"10mm_{f:g}Hz") for f in (1.0, 2.0, 4.0)])
    return identify.compare({"linear": Linear, "bilinear": Bilinear}, runs[:2], held_out=runs[2:])


@pytest.fixture(scope="module")
def rides() -> dict[str, Response]:
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.2)
    firm = with_fitted_range(Linear(3000.0), FittedRange(velocity=(-0.1, 0.1)))
    laws = {"soft": Linear(1500.0), "firm": firm}
    cars = {name: vehicles.presets.quarter_car_000(law) for name, law in laws.items()}
    with pytest.warns(UserWarning, match="fitted to"):
        return {name: simulate(car, bump, duration=1.0, dt=0.002) for name, car in cars.items()}


@pytest.fixture(scope="module")
def tuned() -> TuneResult:
    road = roads.white("C", 20.0)
    return tune.minimise("rms_dynamic_tyre_load", vehicles.presets.quarter_car_000(), road)


def test_a_page_on_fits(comparison: Comparison, tmp_path: Path) -> None:
    page = fit_report(comparison, remarks=["positive stroke is rebound"], folder=tmp_path).to_html()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "best_law_held_out.png",
        "best_law_loops.png",
        "damper_sheet.pdf",
        "damper_sheet.png",
        "force_velocity.png",
        "ladder.png",
        "loops_by_law.png",
    ]
    assert page.count("data:image/png") == 6 and "could not be made" not in page
    for table in (comparison.table(), comparison["linear"].table(title="Parameters of linear")):
        assert table.to_html(words=True) in page
    body = re.sub("<nav>.*</nav>", "", page.partition("<main>")[2])
    order = [
        *map(said, comparison.verdict),
        ">Records</h2>",
        "<li>positive stroke is rebound",
        ">How good the laws are",
        ">The recommended law: bilinear",
        ">linear</h2>",
    ]
    places = [body.index(text) for text in order]
    assert places == sorted(places)


def test_the_picture_of_the_curves_names_the_friction_in_the_measured_points(comparison: Comparison) -> None:
    best = comparison.best
    held = best._replace(result=dataclasses.replace(best.result, rig=Rig(friction=12.3, force_offset=20.0)))
    report, pictures = Report("Fits"), []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "picture", lambda draw, *_: pictures.append(draw()))
        fits._add_curves(report, dataclasses.replace(comparison, rungs=(held,)), None)
    ((note,),) = [[figure.get_supxlabel()] for figure in pictures]
    assert "The measured points hold the friction of the machine, 12.3 N, the laws do not." in " ".join(note.split())
    assert "without the static force of 20 N: gas" in note


def test_each_law_is_drawn_with_the_static_force_of_its_own_machine(comparison: Comparison) -> None:
    """The points are drawn without that of the best; the curve of another law moves by the difference."""
    offsets = {comparison.best.name: 20.0, "linear": 50.0}
    rungs = (
        rung._replace(result=dataclasses.replace(rung.result, rig=Rig(force_offset=offsets[rung.name])))
        for rung in comparison.rungs
    )
    report, pictures = Report("Fits"), []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "picture", lambda draw, *_: pictures.append(draw()))
        fits._add_curves(report, dataclasses.replace(comparison, rungs=tuple(rungs)), None)
    (figure,) = pictures
    lines = {str(line.get_label()): line for line in figure.axes[0].get_lines()}
    velocity, force = (np.asarray(part, float) for part in lines["linear"].get_data())
    known = np.isfinite(force)
    rate = comparison["linear"].parameters[0].value
    np.testing.assert_allclose(force[known], rate * velocity[known] + 30.0, rtol=1e-6)
    assert "of 20 N, and each law with the difference of its own: gas" in " ".join(figure.get_supxlabel().split())


@pytest.mark.exhaustive
def test_a_page_on_fits_beside_a_baseline(comparison: Comparison) -> None:
    stiffer = Bilinear(2.0 * 2600.0, 2.0 * 1200.0)
    found = bench.preflight(comparison.best.result.runs)
    page = fit_report(comparison, baseline=stiffer, preflight=found)
    html = page.to_html()
    assert not page.attempts.troubles and f"<p>{found.summary}.</p>" in html
    (run,) = comparison.held_out
    share = np.sqrt(np.mean(run.force**2))  # the error of twice the force is the force
    rmse = float(re.findall(r"Baseline on the same records: RMSE ([\d.]+) N", html)[0])
    assert rmse == pytest.approx(share, rel=0.01)


def test_a_page_on_records_beside_a_law(comparison: Comparison) -> None:
    runs = comparison.best.result.runs
    evaluation = bench.evaluate(runs, velocities=[0.1])
    limits = evaluation.check([bench.Limit("rebound force", 250.0, 270.0, velocity=0.1), bench.Limit("friction", 90.0)])
    law = Bilinear(2600.0, 2400.0)
    report = bench_report(evaluation, bench.preflight(runs), limits, baseline=law)
    html = report.to_html()
    assert not report.attempts.troubles
    assert "<p>Limits: 1 of 2 are kept: NOT PASSED.</p>" in html
    assert re.search(r"<p>At 0.1 m/s: 260(\.\d+)? ± [\d.]+ N in rebound and −1(19|20)[^:]*, ratio 2.17, without", html)
    rows = {row["quantity"]: row for row in baseline_table(evaluation, law_evaluation(law, evaluation)).records()}
    changes = [rows[f"{side} force at 0.1 m/s"]["change"] for side in ("rebound", "compression")]
    assert changes == pytest.approx([0.0, -50.0], abs=0.5)


@pytest.mark.exhaustive
def test_a_page_on_the_whole_chain(comparison: Comparison, rides: dict[str, Response], tuned: TuneResult) -> None:
    runs = comparison.best.result.runs
    evaluation, found = bench.evaluate(runs), bench.preflight(runs)
    page = chain_report(comparison, {"a bump": rides}, tuned, evaluation=evaluation, preflight=found)
    html = page.to_html()
    assert not page.attempts.troubles and "damper_sheet.pdf" not in html
    verdict = html.partition('<div class="verdict">')[2].partition("</div>")[0]
    ridden = [f"a bump: {sentence}" for sentence in ride_verdict(rides)]
    for sentence in (found.summary, *comparison.verdict, *ridden, tuned.verdict.sentence, tuned.ending):
        assert first_upper(said(sentence)) in verdict
    sections = re.findall(r'<h2 id="part-\d+">(.*?)</h2>', html)
    assert sections == [
        *(("Records", "Preflight") if found.findings else ("Records",)),
        *("Evaluation", "How good the laws are", "The recommended law: bilinear"),
        *("Ride: a bump", "A better damper", "linear"),
    ]


@pytest.mark.slow
def test_the_part_on_laws_may_come_from_another_process(
    comparison: Comparison, rides: dict[str, Response], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent = []

    def elsewhere(compute: Callable[[], Report]) -> Callable[[], Report]:
        sent.append(pickle.dumps(compute))
        drawn = pickle.dumps(pickle.loads(sent[0])())
        return lambda: pickle.loads(drawn)

    (at_once := tmp_path / "at once").mkdir()
    (later := tmp_path / "later").mkdir()
    with shown_in(Display(units="imperial")):
        page = chain_report(comparison, {"a bump": rides}, folder=at_once).to_html()
        monkeypatch.setattr(chains, "elsewhere", elsewhere)
        laws = FitPart(comparison).begun(Attempts(message=message))
    monkeypatch.undo()
    with shown_in(Display(units="imperial")):
        assert chain_report(comparison, {"a bump": rides}, folder=later, laws=laws).to_html() == page
    assert len(sent) == 1
    files = sorted(file.name for file in at_once.iterdir())
    assert {"damper_sheet.pdf", "force_velocity.png", "ride_sheet.png"} <= set(files)
    assert sorted(file.name for file in later.iterdir()) == files


def test_a_page_on_one_ride_or_several(rides: dict[str, Response], tmp_path: Path) -> None:
    page = ride_report(rides, title="A bump", laws={"soft": Linear(1500.0)}, folder=tmp_path).to_html()
    files = ["damper.png", "ride.png", "ride_sheet.pdf", "ride_sheet.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == files
    assert "<h1>A bump</h1>" in page and "<p>soft: linear, rate 1500 N s/m.</p>" in page
    assert "Use of the dampers beside the records of their laws" in page and "<li>firm: damper: velocity" in page
    assert "change [%]" in page
    alone = ride_report(rides["soft"]).to_html()
    assert alone.count("data:image/png") == 3 and "Use of the dampers" not in alone and "change [%]" not in alone


def test_rides_in_words(rides: dict[str, Response]) -> None:
    (sentence,) = ride_verdict(rides)
    soft, firm = (float(run.metrics()["rms_dynamic_tyre_load"]) for run in rides.values())
    assert sentence.startswith("firm against soft: weighted RMS of the body acceleration ")
    assert f"RMS of the dynamic tyre load {100 * (firm / soft - 1):+.1f} %; not certain, as the law is" in sentence
    assert sentence.endswith(" % of the time.") and " times the velocity of its records" in sentence
    (same,) = ride_verdict({"soft": rides["soft"], "again": rides["soft"]})
    assert same.count(" 0.0 %") == 3  # nothing has no sign
    (alone,) = ride_verdict({"soft": rides["soft"]})
    assert f"tyre load {soft:.3g} N. ISO 2631-1 calls such an acceleration" in alone
    with shown_in(Display("imperial")):
        (shop,) = ride_verdict({"soft": rides["soft"]})
    travel = float(rides["soft"].metrics()["working_space_peak_to_peak"])
    assert f"suspension travel {travel / 0.0254:.3g} in," in shop and f"tyre load {soft / 4.4482216:.3g} lbf." in shop


def test_the_page_of_a_robust_tuning_has_the_cost_of_the_scatter(tuned: TuneResult, monkeypatch) -> None:
    monkeypatch.setattr(Report, "picture", lambda *_: None)
    (effect,) = tune.tolerance_effects(tuned.metric, tuned.vehicle, roads.white("C", 20.0), {"damper.rate": 0.1})
    robust = dataclasses.replace(tuned, tolerances=(effect,))
    page = Report("Tuning")
    add_tuning(page, robust)
    assert robust.tolerance_table().to_html(words=True) in page.to_html()


@pytest.mark.exhaustive
def test_a_page_on_a_tuning_beside_another_vehicle(tuned: TuneResult) -> None:
    other = vehicles.presets.quarter_car_000(Linear(900.0))
    html = tuning_report(tuned, baseline=other).to_html()
    assert "could not be made" not in html and html.count("data:image/png") == 3
    rows = html.partition("the change is from the baseline to the tuned vehicle")[2].partition("</table>")[0]
    words = 'title="(rms_dynamic_tyre_load)">tyre load variation, RMS'
    values = dict(re.findall(rf"<td {words}</td><td>N</td><td class=\"number\">([\d.]+)</td>", rows))
    road = roads.white("C", 20.0)
    expected = float(Ride(other, road, metrics=["rms_dynamic_tyre_load"])()["rms_dynamic_tyre_load"])
    assert float(values["rms_dynamic_tyre_load"]) == pytest.approx(expected, rel=1e-3)
    with pytest.raises(ValueError, match="QuarterCar"):
        tuning_report(tuned, baseline=vehicles.presets.half_car_002())


@pytest.mark.slow
def test_a_page_on_a_tuning(rides: dict[str, Response], tuned: TuneResult) -> None:
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.2)
    fresh = tune.rescore(tuned, [bump], duration=1.0, dt=0.002)
    page = tuning_report(tuned, rescored=fresh, rides=rides).to_html()
    assert page.count("data:image/png") == 3 and "could not be made" not in page
    tables = (tuned.table(), tuned.parameter_table(), fresh.table())
    assert all(table.to_html(words=True) in page for table in tables)
    assert said(fresh.summary) in page and "not an optimum" not in page


def test_a_static_force_that_rounds_to_zero_has_no_sign() -> None:
    dyno = bench.VirtualDyno(Linear(1500.0), sampling_rate=500.0, gas_force=-0.3)
    (said_of_all,) = bench_verdict(bench.evaluate(dyno.run([SineTest(0.02, f) for f in (0.2, 2.0)])))
    assert said_of_all.endswith("without the static force of 0 N.")


def test_the_forces_of_a_verdict_have_the_sign_that_is_shown() -> None:
    dyno = bench.VirtualDyno(Linear(1500.0), sampling_rate=500.0, gas_force=-30.0)
    found = bench.evaluate(dyno.run([SineTest(0.02, f) for f in (0.2, 2.0)]))
    with shown_in(Display(sign="compression-positive")):
        (words,) = bench_verdict(found)
    assert re.search(r" -[\d.]+ ± [\d.]+ N in rebound and \d[\d.]+ ± ", words) and words.endswith(" force of 30 N.")
