"""`jaxdamp report`: the whole chain from records to a tuned damper on one page."""

import json
from pathlib import Path

import pytest

from jaxdamp import bench
from jaxdamp._words import first_upper, said
from jaxdamp.bench import SineTest
from jaxdamp.dampers import Bilinear
from jaxdamp.export import from_json
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
    first, _, last = tuning["summary"].partition(". ")  # the verdict, and how the search ended
    assert said(first) in page and first_upper(said(last)) in page
    names = {file.name for file in out.iterdir()}
    assert names >= {"vehicle.json", "ride_metrics.csv", "ride_1_ride.png", "tuning.png", "laws", "tables"}


def test_a_white_road_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("")
    words = ("report", tmp_path / "a.csv", "--road", "white:C")
    assert "Option --road must be one to ride on" in refused(tmp_path, *words)


def test_records_at_several_commands_are_not_pooled(tmp_path: Path) -> None:
    for name, law in {"soft": Bilinear(2600.0, 1200.0), "hard": Bilinear(5200.0, 2400.0)}.items():
        bench.VirtualDyno(law).run([SineTest(0.02, f, name=f"{name}_{f:g}Hz") for f in (1.0, 2.0)]).write(tmp_path)
    words = ("report", tmp_path, "--law", "bilinear", "--out", tmp_path / "out")
    said = refused(tmp_path, *words, "--sign", "rebound-positive", "--command", "soft*=0,hard*=1")
    assert "name the records of one. These state 2 commands: jaxdamp fit makes one law of them" in said
    said = refused(tmp_path, *words, "--sign", "rebound-positive")
    error = said.partition("Error: ")[2]
    assert error.endswith("taken as settings hard, soft, by a word of their names.") and "--command" not in error
