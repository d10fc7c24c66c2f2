import csv
from pathlib import Path

import pytest

from jaxdamp import bench
from jaxdamp.bench import SineTest
from jaxdamp.cli.chaining import TRUE, Scenario, run_demo
from jaxdamp.cli.console import Screen
from jaxdamp.cli.jobs import Output
from jaxdamp.dampers import Besinger
from jaxdamp.export import from_json


NEAR = 1e-4  # of a bound, relative to it, where a value counts as at it


@pytest.mark.exhaustive
def test_the_demo_goes_through_the_whole_chain(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = Scenario(
        law=Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05),
        true_name="besinger",
        laws=("linear", "besinger"),
        tests=tuple(SineTest(0.015, f, cycles=2, name=f"30mm_{f:g}Hz") for f in (1.0, 3.0, 5.0)),
        held_out="30mm_3Hz",
        duration=10.0,
        fresh_roads=2,
    )
    out = tmp_path / "demo"
    run_demo(Screen(), scenario, Output(out))
    text = " ".join(capsys.readouterr().out.split())  # however long the lines are
    assert bench.read(out / "records").names == ("30mm_1Hz", "30mm_3Hz", "30mm_5Hz")
    assert isinstance(from_json(out / "best_law.json"), Besinger)
    assert from_json(out / "true_law.json") == scenario.law
    (truth,) = [p for p in (out / "tables").glob("parameters_and_truth.csv")]
    rows = list(csv.DictReader(truth.read_text(encoding="utf-8").splitlines()))
    sound = [row for row in rows if not row["note"]]
    assert len(sound) >= 4 and all(abs(float(row["(value − true)/se"])) < 4.5 for row in sound)
    rides = list(csv.reader((out / "tables" / "ride_1_metrics.csv").read_text(encoding="utf-8").splitlines()))
    assert rides[0][2:5] == [TRUE, "linear", "besinger"]
    tuned = list(csv.DictReader((out / "metrics.csv").read_text(encoding="utf-8").splitlines()))
    comfort = next(row for row in tuned if row["note"] == "minimised")
    grip = next(row for row in tuned if row["note"].startswith("limit"))
    assert float(comfort["after"]) < 0.9 * float(comfort["before"])
    assert grip["note"].endswith("reached")
    assert float(grip["after"]) == pytest.approx(1.1 * float(grip["before"]), rel=1e-5)
    numbers = list(csv.DictReader((out / "parameters.csv").read_text(encoding="utf-8").splitlines()))
    # The search moves a rate to a third or three times its value at most; one that ends there is named.
    for row in numbers:
        lower, after, upper = (float(row[name]) for name in ("lower", "after", "upper"))
        inside = lower * (1.0 + NEAR) < after < upper * (1.0 - NEAR)
        assert row["note"] == ("" if inside else f"at its {'lower' if after < 2.0 * lower else 'upper'} bound")
        assert lower <= after <= upper
        assert inside or f"{row['parameter']} {row['note']}" in text
    at_bounds = [row["parameter"] for row in numbers if row["note"]]
    assert len(at_bounds) < len(numbers)
    fresh = list(csv.DictReader((out / "fresh_roads.csv").read_text(encoding="utf-8").splitlines()))
    (held,) = [row for row in fresh if row["metric"] == comfort["metric"]]
    assert float(held["largest [%]"]) < -5.0
    assert len(list(out.glob("*.png"))) == 11
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png") == 11
    verdict = page.partition('<div class="verdict">')[2].partition("</div>")[0]
    assert "standard errors off" in verdict and "on 2 fresh roads" in verdict
    for said in (
        "standard errors off",
        "on 2 fresh roads",
        *([] if at_bounds else ["all parameters inside their bounds"]),
        "Tuning ...",
        "report.html",
    ):
        assert said in text
