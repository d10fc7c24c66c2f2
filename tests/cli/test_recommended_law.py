"""Verdict, object, table, page and files name the same law, whatever the records."""

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from jaxdamp import bench, identify
from jaxdamp._words import said
from jaxdamp.bench import BenchSet, SineTest, VirtualDyno
from jaxdamp.cli import application
from jaxdamp.cli.console import Screen
from jaxdamp.cli.fitting import Fitted, show, write_fits
from jaxdamp.cli.wording import in_command_line
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


@pytest.mark.parametrize(
    "situation",
    [
        pytest.param(each, marks=[pytest.mark.slow] * (each not in ("one record", "nearly all noise")))
        for each in SITUATIONS
    ],
)
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
    assert said(f"Recommended: {best.name}, ") in fit_report(comparison).to_html()
    screen, text = Screen(), io.StringIO()
    screen.console = Console(file=text, width=400)
    show(screen, Fitted(comparison, []))
    assert text.getvalue().strip().startswith(f"Recommended: {best.name}, ")
    assert ("--law all tries" in text.getvalue()) == (bool(best.doubt) or best.result.left_out.of_law)
    attempts = Attempts()
    write_fits(tmp_path, comparison, BenchSet(bench.as_runs(runs)), attempts)
    assert not attempts.troubles
    assert from_json(tmp_path / "best_law.json") == best.result.law == from_json(tmp_path / f"laws/{best.name}.json")
    marked = [line for line in (tmp_path / "tables/ladder.csv").read_text().splitlines() if "recommended" in line]
    assert len(marked) == 1 and marked[0].startswith(best.name)
    near = [rung for rung in comparison.rungs if not rung.doubt and rung.error <= best.error]
    assert not best.doubt or not near  # never one with doubt where one without predicts as well


def test_further_laws_are_offered_where_the_residual_shows_that_the_law_misses_something() -> None:
    runs = tuple(VirtualDyno(KINKED, sampling_rate=400.0, force_noise=5.0).run(TESTS))
    comparison = identify.compare({"linear": Linear, "bilinear": Bilinear}, runs)
    screen, text = Screen(), io.StringIO()
    screen.console = Console(file=text, width=400)
    show(screen, Fitted(comparison, []))
    assert not comparison.best.doubt and "--law all tries 15 further laws" in text.getvalue()


@pytest.mark.parametrize(
    ("said", "option"),
    [
        (
            '80 % look like a delay: add "delay" to the machine (`rig`), or take a law with hysteresis.',
            "--rig offset,delay",
        ),
        ('Which it imitates: compare beside a "delay" of the machine (`rig`).', "compare with --rig offset,delay."),
        ('Add "gas" or "offset": add "gas" or "offset" to the machine (`rig`).', "--rig gas or --rig offset"),
        ("If a channel is late, `process(delay=0.002)`; hysteresis needs a law with a lag.", "--rig offset,delay"),
        ("Mend the earthing, or filter: `process(low_pass=25)` if the motion allows it.", "--filter 25 "),
        (
            "Laws of velocity have none: subtract it, `process(without=bench.separate_gas_and_friction(run))`.",
            "--rig gas",
        ),
        (
            "80 % is shape, of the curve: try piecewise_linear or table, which follow any",
            "--law piecewise_linear,table",
        ),
        ("Laws with memory and means suffer: `process(moving=True)` cuts it off.", "--keep-rest"),
        ('If it is mm, read the file with `units={"stroke": "mm"}`.', "--units stroke=mm"),
        ('Or fit the heat beside the law, `rig="heat"`.', "--rig offset,heat"),
        ('Name the columns: `columns={"stroke": ..., "force": ...}`.', "--columns stroke=...,force=..."),
        (
            "They lie at rate = 1. Look at them with `data.where(data.failed, drop=True)`, and at `data.reason`.",
            "sweep.csv",
        ),
        ("It has no peaks. Drive over `roads.iso8608(...)`.", "Take iso:CLASS."),
        ("State it as held, `run.held_at(0.5)`, so that the record has one setting.", "--command NAME=0.5"),
        ("Argument `bounds['rate']` must increase.", "Option --bound of 'rate' must"),
        ("Argument `law.rate` must be above 0.", "law.rate must"),
        ("Pass `dt=0.0005`, or more.", "--dt 0.0005,"),
        ("Average more samples, such as by `samples_per_cycle=50`.", "such as by --samples-per-cycle 50."),
        (
            "Set them equal first, with `jaxdamp.parameters.replace(..., {'damper.rebound_rate': ...})`.",
            "with damper.rebound_rate = NUMBER below [parameters] of VEHICLE.toml",
        ),
    ],
)
def test_the_command_line_names_options_instead_of_calls(
    monkeypatch: pytest.MonkeyPatch, said: str, option: str
) -> None:
    monkeypatch.setitem(application.own_words(), "bounds", "Option --bound")
    for argument in ("units", "columns", "dt", "samples_per_cycle"):
        monkeypatch.setitem(application.own_words(), argument, f"Option --{argument.replace('_', '-')}")
    words = in_command_line(said)
    assert option in words and "`" not in words and "process(" not in words
