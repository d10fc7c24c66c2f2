"""`jaxdamp report`: the whole chain from records to a tuned damper on one page."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from jaxdamp import bench
from jaxdamp.bench import SineTest
from jaxdamp.cli.chaining import not_identified
from jaxdamp.dampers import Bilinear
from jaxdamp.export import from_json
from jaxdamp.identify import Estimate
from jaxdamp.tune import Outcome

from .invoking import jaxdamp, refused


@pytest.mark.slow
def test_the_chain_is_on_one_page_with_its_files(tmp_path: Path) -> None:
    dyno = bench.VirtualDyno(Bilinear(2600.0, 1200.0), sampling_rate=200.0, force_noise=5.0)
    for run in dyno.run([SineTest(0.02, f, name=f"{f:g}Hz") for f in (0.5, 1.0)]):
        rows = zip(run.time, 1e3 * run.stroke, run.force, strict=True)
        text = "\n".join(f"{t:.4f},{x:.5f},{f:.2f}" for t, x, f in rows)
        (tmp_path / f"{run.name}.csv").write_text(f"time [s],stroke [mm],force [N]\n{text}\n")
    out = tmp_path / "chain"
    files = [tmp_path / "0.5Hz.csv", tmp_path / "1Hz.csv"]
    words = ["--sign", "rebound-positive", "--force-sign", "same", "--law", "linear,bilinear", "--duration", "1.5"]
    words += ["--road", "bump:0.05:5", "--dt", "2e-3", "--limit", "travel=0.1", "--over", "damper.*_rate"]
    jaxdamp("report", *files, *words, "--out", out)
    fitted, tuned = from_json(out / "best_law.json"), from_json(out / "law.json")
    assert float(fitted.rebound_rate) == pytest.approx(2600.0, rel=0.01)
    assert float(tuned.rebound_rate) != pytest.approx(float(fitted.rebound_rate), rel=0.05)
    page = (out / "report.html").read_text()
    tuning = json.loads((out / "tuning.json").read_text())
    heading = Outcome[tuning["verdict"]].value  # the records are slower than the damper on this bump
    assert heading == "Not known to be better: outside the records" and "A better damper" not in page
    assert all(text in page for text in ("tuned law against vehicle as it is", "fitted law against", heading))
    assert tuning["summary"].replace(">", "&gt;") in page
    names = {file.name for file in out.iterdir()}
    assert names >= {"vehicle.json", "ride_metrics.csv", "ride_1_ride.png", "tuning.png", "laws", "tables"}


def test_a_white_road_is_refused(tmp_path: Path) -> None:
    assert "Option --road must be one to ride on" in refused(tmp_path, "report", "a.csv", "--road", "white:C")


def test_what_the_records_do_not_determine_is_not_tuned() -> None:
    def estimate(name: str, note: str = "") -> Estimate:
        return Estimate(name, 1.0, "N s/m", 0.1, (0.8, 1.2), "", note)

    fit: Any = SimpleNamespace(rig=None, record_starts=())
    unknown = "not identifiable"
    fit.parameters = [estimate("rate"), estimate("slopes[0]", unknown), estimate("slopes[1]"), estimate("n", unknown)]
    assert not_identified(fit) == ["n"]
    on_rig: Any = SimpleNamespace(rig=object(), record_starts=())
    on_rig.parameters = [estimate("law.law.rate", unknown), estimate("law.lag_time"), estimate("rig.friction", unknown)]
    assert not_identified(on_rig) == ["law.rate"]
