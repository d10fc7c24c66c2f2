"""Verdict, object, table, page and files name the same law, whatever the records."""

import json
from pathlib import Path

import pytest

from jaxdamp import bench, identify
from jaxdamp.bench import BenchSet, SineTest, VirtualDyno
from jaxdamp.cli.fitting import write_fits
from jaxdamp.dampers import Bilinear, Lag, Linear, PiecewiseLinear
from jaxdamp.export import from_json
from jaxdamp.report import Attempts, fit_report


NAMES = ["linear", "bilinear", "piecewise_linear", "linear_friction"]
TESTS = [SineTest(0.01, f, cycles=2) for f in (1.0, 2.0, 4.0, 6.0)]
KINKED = PiecewiseLinear([-0.2, -0.05, 0.05, 0.2], [2000.0, 9000.0, 3000.0, 12000.0, 1500.0])
SITUATIONS = {
    "several motions": (Bilinear(2600.0, 1200.0), TESTS, 0, 20.0),
    "one record": (Bilinear(2600.0, 1200.0), TESTS[2:3], 0, 20.0),
    "a record held out": (Bilinear(2600.0, 1200.0), TESTS, 1, 20.0),
    "no candidate is the truth": (Lag(KINKED, 0.005), TESTS, 0, 5.0),
    "no noise": (Linear(1500.0), TESTS[1:3], 0, 0.0),
    "nearly all noise": (Linear(1500.0), TESTS[:3], 0, 400.0),
}


@pytest.mark.parametrize("situation", SITUATIONS)
def test_verdict_object_file_and_page_never_disagree(situation: str, tmp_path: Path) -> None:
    law, tests, held, noise = SITUATIONS[situation]
    runs = VirtualDyno(law, sampling_rate=400.0, force_noise=noise).run(tests)
    fitted, unseen = tuple(runs)[held:], tuple(runs)[:held]
    comparison = identify.compare(identify.default_ladder(fitted, NAMES), fitted, held_out=unseen)
    best = comparison.best
    assert comparison.verdict[0].startswith(f"Recommended: {best.name}, ")
    assert repr(comparison).endswith(f"\nbest: {best.name}")
    assert json.loads(json.dumps(comparison.to_dict()))["best"] == best.name
    assert [r["law"] for r in comparison.table().records() if "recommended" in str(r["note"])] == [best.name]
    assert f"Recommended: {best.name}, " in fit_report(comparison).to_html()
    attempts = Attempts()
    write_fits(tmp_path, comparison, BenchSet(bench.as_runs(runs)), attempts)
    assert not attempts.troubles
    assert from_json(tmp_path / "best_law.json") == best.result.law == from_json(tmp_path / f"laws/{best.name}.json")
    marked = [line for line in (tmp_path / "tables/ladder.csv").read_text().splitlines() if "recommended" in line]
    assert len(marked) == 1 and marked[0].startswith(best.name)
    near = [rung for rung in comparison.rungs if not rung.doubt and rung.error <= best.error]
    assert not best.doubt or not near  # never one with doubt where one without predicts as well
