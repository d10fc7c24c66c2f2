"""What the terminal shows: stages, tables, what the reader decided."""

import io
import re
import sys
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from jaxdamp import bench
from jaxdamp.bench import SineTest
from jaxdamp.cli import console, offers
from jaxdamp.cli.console import Screen
from jaxdamp.cli.records import decisions
from jaxdamp.cli.streams import write_plainly
from jaxdamp.dampers import Linear
from jaxdamp.report import Column, Table


def test_notes_of_one_kind_are_said_once() -> None:
    tests = [SineTest(0.01, f) for f in (1.0, 3.0)]
    runs = tuple(bench.VirtualDyno(Linear(2000.0), sampling_rate=1000.0, force_noise=5.0).run(tests))
    notes = decisions(runs)
    assert len(notes) == 2 and notes[0].endswith("(all records)")
    assert notes[1].endswith("(all records, numbers of the first)")
    assert decisions(runs[:1]) == list(runs[0].notes)


def test_assignments_may_hold_commas() -> None:
    assert offers.WRITTEN["columns"].read("columns", ["time=t_s,stroke=Displacement, in", "force=2,velocity=none"]) == {
        "time": "t_s",
        "stroke": "Displacement, in",
        "force": 2,
        "velocity": None,
    }


@pytest.mark.parametrize("terminal", [True, False])
def test_a_stage_shows_progress_and_keeps_its_time(terminal: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([100.0, 102.34])
    monkeypatch.setattr(console, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    screen = Screen()
    screen.live = terminal
    screen.console = Console(file=io.StringIO(), force_terminal=terminal, width=100)
    with screen.stage("Work [N]", 2) as advance:
        advance("[m/s]", 0)
        advance("", 2)
    file = screen.console.file
    assert isinstance(file, io.StringIO) and "done in 2.3 s" in file.getvalue()
    assert terminal or file.getvalue().count("Work [N]") == 1  # a log says nothing twice
    assert screen.times["Work [N]"] == pytest.approx(2.34)
    assert screen.times_table().rows[0][0] == "Work [N]"


def test_a_pipe_with_colours_gets_no_live_frames(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    clock = iter([100.0, 103.0])
    monkeypatch.setattr(console, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    screen = Screen()
    with screen.stage("Work", 2) as advance:
        advance("a part", 1)
    text = capsys.readouterr().out
    assert "\x1b[32m" in text  # colours are wanted
    assert "Work ..." in text and not any(mark in text for mark in ("⠋", "a part", "\x1b[2K", "\x1b[?25l"))


def test_brackets_are_not_taken_for_markup() -> None:
    screen = Screen()
    screen.console = Console(file=io.StringIO(), width=100)
    screen.table(Table("Title [m]", (Column("velocity", "m/s"),), (("[red]",),)))
    screen.points(["[bold]"])
    file = screen.console.file
    assert isinstance(file, io.StringIO)
    assert all(text in file.getvalue() for text in ("Title [m]", "velocity [m/s]", "[red]", "[bold]"))


def test_names_out_of_files_do_not_command_the_terminal() -> None:
    screen, out = Screen(), io.StringIO()
    screen.console = Console(file=out, force_terminal=True, width=100)
    screen.say("record \x1b[2J\x9b31m of 3\u00a0Hz")
    screen.points(["\x1b]0;title\x07"])
    assert "record \\x1b[2J\\x9b31m of 3\u00a0Hz" in out.getvalue() and "\x1b]0" not in out.getvalue()


def test_the_terminal_has_the_first_remarks_and_says_how_many_are_left() -> None:
    screen, out = Screen(), io.StringIO()
    screen.console = Console(file=out, width=100)
    table = Table("All", (Column("a"),), (("b",),))
    screen.remarks(list("abcde"))
    screen.details(table)
    assert "2 more in report.html" in out.getvalue() and "- d" not in out.getvalue() and "All" not in out.getvalue()
    screen.verbose = True
    screen.remarks(list("abcde"))
    screen.details(table)
    assert "- e" in out.getvalue() and "All" in out.getvalue()


def test_lines_are_as_wide_as_columns_say_and_hang_below_their_first_word(
    monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    Screen().points(["a force of 3 m/s^2 " + "and more words " * 4])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("  - a force of 3 m/s² and") and len(lines) > 1
    assert all(re.match("    [a-z]", line) for line in lines[1:])
    assert max(map(len, lines)) <= 40


@pytest.mark.parametrize(("encoding", "shown"), [("ascii", "<= -0.3 m/s^2"), ("utf-8", "≤ −0.3 m/s²")])
def test_characters_that_an_output_lacks_are_written_plainly(
    encoding: str, shown: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding))
    write_plainly()
    Screen().say("≤ −0.3 m/s²")
    sys.stdout.flush()
    assert raw.getvalue().decode(encoding) == f"{shown}\n"
