"""What a command had finished when it was stopped is taken up by `--resume`, and the end is the same.

Fits are the same to the bit, and tunings of two processes. Within one process, as here, two uninterrupted tunings were
seen to differ in the eighth digit.
"""

import itertools
import json
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jaxdamp._pieces import kept_in, piece
from jaxdamp.cli import resuming
from jaxdamp.identify import comparing
from jaxdamp.sweeps import sweeping
from jaxdamp.tune import measuring, rescoring
from tests.cli.invoking import jaxdamp, refused


NUMBER = re.compile(r"-?\d[\d.]*(?:e[-+]?\d+)?")
NUMBERS = ("best_law.json", "laws/*.json", "law.json", "vehicle.json", "tuning.json", "**/*.csv")
TUNE = ["tune", "quarter_car_000", "iso:C", "--duration", "1", "--fresh-roads", "8"]


class Killed(BaseException):
    """The end of a process, as far as a test can see it."""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "cache" / "jaxdamp" / "unfinished"


def _numbers(folder: str) -> dict[str, str]:
    files = {file for pattern in NUMBERS for file in Path(folder).glob(pattern)}
    return {str(file.relative_to(folder)): file.read_text() for file in sorted(files)}


def _assert_same(ours: dict[str, str], theirs: dict[str, str], *, exact: bool) -> None:
    assert ours.keys() == theirs.keys()
    for name in ours:
        if exact or "laws/" in name:
            assert ours[name] == theirs[name]
        pairs = [np.array(NUMBER.findall(text), float) for text in (ours[name], theirs[name])]
        np.testing.assert_allclose(*pairs, rtol=1e-5, atol=1e-8, err_msg=name)


def _counted(monkeypatch: pytest.MonkeyPatch, owner: Any, name: str, last: int | None = None) -> list[int]:
    """Count the calls of a function; the process ends in the call after the last one."""
    plain, calls = getattr(owner, name), list[int]()

    def call(*args: Any, **options: Any) -> Any:
        if len(calls) == last:
            raise Killed
        calls.append(1)
        return plain(*args, **options)

    monkeypatch.setattr(owner, name, call)
    return calls


def _killed(*words: str | Path) -> None:
    with pytest.raises(Killed):
        jaxdamp(*words)


def _resumed(words: list[str | Path], kill: Callable[[pytest.MonkeyPatch], object], cache: Path) -> str:
    """The output of a command that was killed and resumed, and has given the numbers of an uninterrupted one."""
    with pytest.MonkeyPatch.context() as patch:
        kill(patch)
        _killed(*words, "--out", "out")
    with pytest.MonkeyPatch.context() as patch:
        calls = {name: _counted(patch, *place) for name, place in COUNTED.items()}
        output = jaxdamp(*words, "--out", "out", "--resume").output
        resumed = {name: len(made) for name, made in calls.items()}
    assert not list(cache.iterdir())
    with pytest.MonkeyPatch.context() as patch:
        calls = {name: _counted(patch, *place) for name, place in COUNTED.items()}
        jaxdamp(*words, "--out", "whole")
        whole = {name: len(made) for name, made in calls.items()}
    _assert_same(_numbers("out"), _numbers("whole"), exact=words[0] == "fit")
    assert {name: whole[name] - resumed[name] for name in whole if whole[name] > resumed[name]} == DONE[str(words[0])]
    return output


COUNTED = {"fits": (comparing, "fit"), "tuning": (measuring.BatchProgram, "at"), "roads": (rescoring, "rescored")}
DONE = {"fit": {"fits": 2}, "tune": {"tuning": 4}, "report": {"fits": 2, "tuning": 3}}  # before the end, not again


def test_a_fit_goes_on_after_its_finished_laws(records: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 1)  # one law after the other
    words = ["fit", records, "--law", "linear,bilinear,besinger"]
    output = _resumed(words, lambda patch: _counted(patch, comparing, "fit", last=2), cache)
    assert "Resumed with what an interrupted run had finished." in output


@pytest.mark.slow
def test_a_tuning_goes_on_after_its_last_step(cache: Path) -> None:
    _resumed([*TUNE], lambda patch: _counted(patch, measuring.BatchProgram, "at", last=4), cache)


def test_a_sweep_goes_on_after_its_finished_points(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = [
        "sweep",
        "quarter_car_000",
        "iso:C",
        "--over",
        "damper.rate=1000:4000:40",
        "--duration",
        "1",
        "--chunk",
        "16",
    ]
    with pytest.MonkeyPatch.context() as patch:
        _counted(patch, sweeping, "tell", last=0)
        _killed(*words, "--out", "out")
    left = list[int]()
    runner = sweeping.Computation.runner
    monkeypatch.setattr(sweeping.Computation, "runner", lambda self, count: left.append(count) or runner(self, count))
    jaxdamp(*words, "--out", "out", "--resume")
    output = jaxdamp(*words, "--out", "whole").output
    assert "the first 30 of 40 rows" in output and "sweep.csv has all 40 points" in output
    assert "Smallest body acceleration" in " ".join(output.split())
    assert 0 < left[0] < left[1] == 40 and not list(cache.iterdir())
    _assert_same(_numbers("out"), _numbers("whole"), exact=False)


@pytest.mark.slow
def test_a_report_goes_on_in_its_tuning(records: Path, cache: Path) -> None:
    words = ["report", records, "--law", "linear,bilinear", "--road", "iso:C", "--duration", "1"]
    _resumed(words, lambda patch: _counted(patch, measuring.BatchProgram, "at", last=3), cache)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda folder: ["--law", "linear"], "--law is linear now, and was bilinear"),
        (lambda folder: ["--law", "bilinear", "--weighting", "runs"], "--weighting is runs now, and was not given"),
        (lambda folder: _longer(folder / "10mm_1Hz.csv") or ["--law", "bilinear"], "10mm_1Hz.csv has changed"),
    ],
)
def test_what_differs_from_the_interrupted_run_is_named(
    tmp_path: Path, runs: Any, cache: Path, change: Callable[[Path], list[str]], said: str
) -> None:
    runs.write(tmp_path / "records")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jaxdamp.cli.fitting.write_fits", _raise)
        _killed("fit", "records", "--law", "bilinear", "--out", "out")
    more = change(tmp_path / "records")
    assert said in refused(tmp_path, "fit", "records", *more, "--out", "out", "--resume")


def test_other_versions_are_named(cache: Path, records: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    words = ["fit", records, "--law", "linear", "--out", "out"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jaxdamp.cli.fitting.write_fits", _raise)
        _killed(*words)
    monkeypatch.setattr(resuming, "version", lambda name: "99")
    assert "jax is 99 now, and was" in refused(tmp_path, *words, "--resume")


def test_unfinished_results_are_completed_in_place(cache: Path, records: Path) -> None:
    """What was there before the interrupted run is still in `.previous`."""
    words = ["fit", records, "--out", "out", "--law"]
    jaxdamp(*words, "linear")
    earlier = _numbers("out")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jaxdamp.cli.jobs.Job.page", _raise)
        _killed(*words, "bilinear", "--replace")
    assert "The same command with --resume goes on from there." in Path("out/UNFINISHED.txt").read_text()
    jaxdamp(*words, "bilinear", "--resume")
    assert json.loads(Path("out/manifest.json").read_text())["complete"] and not Path("out/UNFINISHED.txt").exists()
    assert _numbers("out/.previous") == earlier
    assert "earlier run" in jaxdamp(*words, "bilinear", "--resume", code=2).output


def test_a_changed_file_of_unfinished_results_is_not_replaced(cache: Path, records: Path, tmp_path: Path) -> None:
    words = ["fit", records, "--law", "linear", "--out", "out"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jaxdamp.cli.jobs.Job.page", _raise)
        _killed(*words)
    Path("out/best_law.json").write_text("mine")
    assert "best_law.json' was changed since" in refused(tmp_path, *words, "--resume")


def test_pieces_are_of_their_inputs_and_damage_is_seen(tmp_path: Path) -> None:
    numbers = itertools.count()
    assert [piece(("a", 1), lambda: next(numbers)) for _ in range(2)] == [0, 1]
    with kept_in(tmp_path):
        inputs = [("a", 1), ("a", 1), ("a", 2), ("b", np.arange(2)), ("b", np.arange(2)), ("b", np.arange(3))]
        assert [piece(one, lambda: next(numbers)) for one in inputs] == [2, 2, 3, 4, 4, 5]
        for file in tmp_path.iterdir():
            file.write_bytes(file.read_bytes()[:-1] + b"x")
        assert [piece(one, lambda: next(numbers)) for one in inputs] == [6, 6, 7, 8, 8, 9]


def _longer(file: Path) -> None:
    file.write_text(file.read_text() + "\n")


def _raise(*args: object, **options: object) -> None:
    raise Killed


def test_what_cannot_be_kept_is_computed_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with kept_in(tmp_path), pytest.warns(UserWarning, match="could not be kept for --resume"):
        assert piece((lambda: 1,), lambda: 5) == 5
    with kept_in(tmp_path), pytest.warns(UserWarning, match="could not be kept for --resume"):
        assert callable(piece(("function",), lambda: lambda: 5))
    monkeypatch.setattr("shutil.disk_usage", lambda folder: SimpleNamespace(free=1000))
    with kept_in(tmp_path), pytest.warns(UserWarning, match="more than a tenth of the free disk"):
        assert piece(("much",), lambda: bytes(200)) == bytes(200)
    assert not list(tmp_path.glob("*.piece"))
