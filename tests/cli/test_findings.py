import io
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from jaxdamp import bench, identify
from jaxdamp.bench import BenchSet, SineTest
from jaxdamp.cli import console
from jaxdamp.cli.console import Screen
from jaxdamp.cli.findings import ladder_table, parameter_table, verdict
from jaxdamp.cli.options import assignments, column_numbers, decisions
from jaxdamp.cli.residual import residual_shares
from jaxdamp.dampers import AbstractDamper, Bilinear, Lag, Linear
from jaxdamp.report import Column, Report, Table


TESTS = [SineTest(0.01, f) for f in (1.0, 3.0, 6.0)]


def _runs(law: AbstractDamper, noise: float) -> BenchSet:
    return bench.VirtualDyno(law, sampling_rate=1000.0, force_noise=noise).run(TESTS)


def test_the_error_of_the_true_law_is_noise() -> None:
    shares = residual_shares(identify.fit(Linear, tuple(_runs(Linear(2000.0), 5.0))))
    assert shares.rest > 0.93 and sum(shares) == pytest.approx(1.0)


def test_the_error_of_a_wrong_curve_is_shape() -> None:
    shares = residual_shares(identify.fit(Linear, tuple(_runs(Bilinear(3000.0, 1000.0), 5.0))))
    assert shares.shape > 0.9 and shares.hysteresis < 0.02


def test_the_error_of_a_static_law_on_a_lagging_damper_is_hysteresis() -> None:
    runs = tuple(_runs(Lag(Linear(2000.0), 0.008), 5.0))
    shares = residual_shares(identify.fit(Linear, runs))
    # The fitted coefficient is one for three frequencies, between which the lag changes it: a little shape is left.
    assert shares.hysteresis > 0.75 and shares.hysteresis > 5 * shares.shape
    with_lag = residual_shares(identify.fit(Lag(Linear(1800.0), 0.005), runs))
    assert with_lag.rest > 0.9


def test_the_shares_can_be_taken_on_other_records() -> None:
    result = identify.fit(Linear, tuple(_runs(Linear(2000.0), 5.0)))
    assert residual_shares(result, tuple(_runs(Bilinear(3000.0, 1000.0), 5.0))).shape > 0.9


def test_the_verdict_says_that_hysteresis_is_left() -> None:
    runs = tuple(_runs(Lag(Linear(2000.0), 0.008), 5.0))
    comparison = identify.compare({"linear": Linear, "bilinear": Bilinear}, runs)
    shares = {rung.name: residual_shares(rung.result) for rung in comparison.rungs}
    text = " ".join(verdict(comparison, shares))
    assert "is hysteresis" in text and "Try a law with hysteresis" in text
    assert ladder_table(comparison, shares).rows[0][0] == "linear"


def test_fitted_numbers_stand_beside_the_true_ones() -> None:
    truth = Bilinear(2600.0, 1200.0)
    result = identify.fit(Bilinear, tuple(_runs(truth, 5.0)))
    table = parameter_table("bilinear", result, truth)
    names = [column.name for column in table.columns]
    (row, _) = table.rows
    cells = dict(zip(names, row, strict=True))
    assert cells["true"] == 2600.0 and cells["unit"] == "N s/m"
    e = result["rebound_rate"]
    assert cells["(value − true)/se"] == pytest.approx((e.value - 2600.0) / e.standard_error)


def test_notes_of_one_kind_are_said_once() -> None:
    runs = tuple(_runs(Linear(2000.0), 5.0))
    notes = decisions(runs)
    assert len(notes) == 2 and notes[0].endswith("(all records)")
    assert notes[1].endswith("(all records, numbers of the first)")
    assert decisions(runs[:1]) == list(runs[0].notes)


def test_assignments_may_hold_commas() -> None:
    found = assignments("columns", ["time=t_s,stroke=Displacement, in", "force=2,velocity=none"])
    assert found == {"time": "t_s", "stroke": "Displacement, in", "force": "2", "velocity": "none"}
    assert column_numbers(found) == {"time": "t_s", "stroke": "Displacement, in", "force": 2, "velocity": None}


def test_tables_are_written_with_all_digits_and_read_with_few() -> None:
    table = Table("T", (Column("name"), Column("force", "N", ".1f")), (("a, b", np.pi), ("<c>", None)))
    assert table.to_csv() == 'name,force [N]\n"a, b",3.141592653589793\n<c>,\n'
    assert table.texts() == [("a, b", "3.1"), ("<c>", "")]
    assert "&lt;c&gt;" in table.to_html() and '<td class="number">3.1</td>' in table.to_html()


def test_a_report_escapes_what_it_is_told() -> None:
    report = Report("a < b")
    report.text("x", "& y")
    report.points([])
    assert report._blocks == ["<h1>a &lt; b</h1>", "<p>x &amp; y</p>"]


@pytest.mark.parametrize("terminal", [True, False])
def test_a_stage_shows_progress_and_keeps_its_time(terminal: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([100.0, 102.34])
    monkeypatch.setattr(console, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    screen = Screen()
    screen.console = Console(file=io.StringIO(), force_terminal=terminal, width=100)
    with screen.stage("Work [N]", 2) as advance:
        advance("[m/s]", 0)
        advance("", 2)
    file = screen.console.file
    assert isinstance(file, io.StringIO) and "Work [N]: done in 2.3 s" in file.getvalue()
    assert screen.times["Work [N]"] == pytest.approx(2.34)
    assert screen.times_table().rows[0][0] == "Work [N]"


def test_brackets_are_not_taken_for_markup() -> None:
    screen = Screen()
    screen.console = Console(file=io.StringIO(), width=100)
    screen.table(Table("Title [m]", (Column("velocity", "m/s"),), (("[red]",),)))
    screen.points(["[bold]"])
    file = screen.console.file
    assert isinstance(file, io.StringIO)
    assert all(text in file.getvalue() for text in ("Title [m]", "velocity [m/s]", "[red]", "[bold]"))
