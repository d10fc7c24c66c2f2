"""Ctrl-C in processes of their own: 130 and a message at every moment, and what is finished stays."""

import signal
import subprocess
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

import pytest

from jaxdamp.export import from_json


LIMIT = 300  # s, for a process that hangs
AS_FROM_A_TERMINAL = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"


def _interrupted(words: Sequence[str | Path], *marks: str, number: signal.Signals = signal.SIGINT) -> tuple[int, str]:
    """Exit code and output of a Python program that gets a signal as soon as each of the marks was printed."""
    program, *arguments = map(str, words)
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", AS_FROM_A_TERMINAL + program, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None
    output = ""
    for mark in marks:
        for line in process.stdout:
            output += line
            if mark in line:
                break
        process.send_signal(number)
    rest, _ = process.communicate(timeout=LIMIT)
    output += rest
    assert "Traceback" not in output, output
    return process.returncode, output


def _script(folder: Path, body: str) -> list[str]:
    text = """
        import sys, time
        from pathlib import Path
        from jaxdamp.cli import interrupt
        from jaxdamp.cli.results import results_folder

        def work(results):
        {body}

        with interrupt.watched():
            try:
                with results_folder(Path({folder!r}), "test") as results:
                    work(results)
            except interrupt.Interrupted as stop:
                print(stop)
                sys.exit(interrupt.exit_code())
    """
    body = textwrap.indent(textwrap.dedent(body), "    ").strip()
    return [textwrap.dedent(text).format(body="    " + body, folder=str(folder))]


def test_with_nothing_to_keep_it_stops_in_the_middle_of_the_work(tmp_path: Path) -> None:
    words = _script(tmp_path / "out", "(results.draft / 'a').write_text('half')\nprint('ready')\ntime.sleep(600)")
    code, output = _interrupted(words, "ready")
    assert (code, list(tmp_path.iterdir())) == (130, []) and "Stopped. Nothing was written." in output


FINISHED = """
    (results.draft / 'law.json').write_text('law')
    interrupt.keep()
    results.publish('the pictures')
    print('ready')
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_is_finished_is_kept_and_the_work_stops_at_the_next_check(tmp_path: Path, number: signal.Signals) -> None:
    wait = "    while True:\n        interrupt.check()\n        time.sleep(0.01)\n"
    code, output = _interrupted(_script(tmp_path / "out", FINISHED + wait), "ready", number=number)
    assert code == 128 + number and "Stopping as soon as this computation is done" in output
    assert "holds what was finished: law.json. Not written: the pictures" in output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["UNFINISHED.txt", "law.json", "manifest.json"]


def test_what_a_shell_script_started_in_the_background_ends_by_sigterm_with_a_word(tmp_path: Path) -> None:
    ignoring, *more = _script(tmp_path / "out", FINISHED + "    time.sleep(600)\n")
    ignoring = f"import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n{ignoring}"
    marks = ("ready", "Stopping as soon")
    code, output = _interrupted([ignoring, *more], *marks, number=signal.SIGTERM)
    assert code == 143 and "Stopped." in output and "Not written: the pictures" in output
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_second_time_stops_at_once(tmp_path: Path) -> None:
    code, output = _interrupted(
        _script(tmp_path / "out", FINISHED + "    time.sleep(600)\n"), "ready", "Stopping as soon"
    )
    assert code == 130 and "Stopped." in output and "Not written: the pictures" in output
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_nothing_stops_what_is_being_saved(tmp_path: Path) -> None:
    body = """
        interrupt.keep()
        with interrupt.saving():
            print('ready')
            while not interrupt._watch.asked:
                time.sleep(0.01)
            interrupt.check()
            (results.draft / 'law.json').write_text('law')
            results.publish('the pictures')
        interrupt.check()
    """
    code, output = _interrupted(_script(tmp_path / "out", body), "ready")
    assert code == 130 and (tmp_path / "out" / "law.json").exists() and "holds what was finished: law.json" in output


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mark", "kept"),
    [
        ("Reading the records ...", None),
        ("Fitting 2 laws", None),
        ("Laws and tables ...", ["besinger_lag", "linear"]),
        ("Pictures and report ...", ["besinger_lag", "linear"]),
    ],
)
@pytest.mark.exhaustive_cases("Pictures and report ...-kept3")
def test_a_fit_can_be_stopped_at_any_stage(records: Path, tmp_path: Path, mark: str, kept: list[str] | None) -> None:
    out = tmp_path / "fit"
    program = "import runpy; runpy.run_module('jaxdamp', run_name='__main__')"
    words = [program, "fit", records, "--law", "linear,besinger_lag", "--out", out]
    code, output = _interrupted(words, mark)
    assert code == 130 and ("Interrupted." in output or "Stopped." in output)
    if out.exists():  # even an early Ctrl-C may come when a law is finished already
        assert "complete" in (out / "UNFINISHED.txt").read_text() and not (out / "report.html").exists()
        assert all(from_json(path) is not None for path in (out / "laws").iterdir())
    if kept is not None:  # and what is left of a law in doubt, if it was finished
        assert sorted({path.stem.removesuffix("_reduced") for path in (out / "laws").iterdir()}) == kept
    assert not [path for path in tmp_path.iterdir() if path.name.endswith(".draft")]
