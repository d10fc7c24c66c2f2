import errno
import json
import os
from pathlib import Path

import pytest

from jaxdamp.cli import resuming
from jaxdamp.cli.interrupt import Interrupted
from jaxdamp.cli.results import results_folder, written


def _fill(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)


def _write(target: Path, *names: str, replace: bool = False) -> None:
    with results_folder(target, "test", replace=replace) as results:
        _fill(results.draft, *names)


def test_files_appear_with_a_manifest(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "out"
    _write(target, "a.txt", "sub/b.txt")
    assert written(target) == ["a.txt", "manifest.json", "sub/b.txt"]
    manifest = json.loads((target / "manifest.json").read_text())
    assert manifest["command"] == "test" and manifest["files"] == ["a.txt", "sub/b.txt", "manifest.json"]
    assert [path.name for path in target.parent.iterdir()] == ["out"]


def test_a_failure_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), results_folder(tmp_path / "out", "test") as results:
        _fill(results.draft, "a.txt")
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_a_failure_leaves_earlier_results_as_they_were(tmp_path: Path) -> None:
    target = tmp_path / "out"
    _write(target, "a.txt")
    with pytest.raises(RuntimeError), results_folder(target, "test", replace=True) as results:
        (results.draft / "a.txt").write_text("half")
        raise RuntimeError
    assert (target / "a.txt").read_text() == "a.txt"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_second_run_is_refused(tmp_path: Path) -> None:
    _write(tmp_path / "out", "a.txt")
    with pytest.raises(ValueError, match="earlier run of jaxdamp test: name another one with --out, or pass --replace"):
        _write(tmp_path / "out", "b.txt")
    assert written(tmp_path / "out") == ["a.txt", "manifest.json"]


def test_what_is_published_stays_and_says_that_it_is_not_all(tmp_path: Path) -> None:
    target = tmp_path / "out"
    with pytest.raises(RuntimeError), results_folder(target, "test") as results:
        _fill(results.draft, "law.json", "sub/table.csv")
        results.publish("the pictures")
        assert json.loads((target / "manifest.json").read_text())["complete"] is False
        assert "Missing: the pictures." in (target / "UNFINISHED.txt").read_text()
        _fill(results.draft, "half.png")
        raise RuntimeError
    assert written(target) == ["UNFINISHED.txt", "law.json", "manifest.json", "sub/table.csv"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_the_note_that_something_is_missing_goes_at_the_end(tmp_path: Path) -> None:
    target = tmp_path / "out"
    _write(target, "old.txt", "law.json")
    with results_folder(target, "test", replace=True) as results:
        assert (target / "old.txt").exists()
        _fill(results.draft, "law.json")
        results.publish("the pictures")
        assert not (target / "old.txt").exists()
        _fill(results.draft, "picture.png")
    assert written(target) == ["law.json", "manifest.json", "picture.png"]
    assert results.published == ["law.json", "picture.png"]
    manifest = json.loads((target / "manifest.json").read_text())
    assert manifest["complete"] and manifest["files"] == ["law.json", "picture.png", "manifest.json"]


def test_a_resumed_run_drops_what_it_did_not_write_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target, old = tmp_path / "out", ["law.json", "bilinear.csv", "settings/bilinear.csv", "notes.csv"]
    with pytest.raises(RuntimeError), results_folder(target, "test") as results:
        _fill(results.draft, *old)
        results.publish("the pictures")
        raise RuntimeError
    monkeypatch.setattr(resuming, "kept", lambda folder: 1)
    with results_folder(target, "test", resume=True) as results:
        _fill(results.draft, "law.json")
        results.publish("the pictures")
        assert {*old} <= {*written(target)}  # they may still come
        (target / "notes.csv").write_text("mine")
        _fill(results.draft, "picture.png")
    assert written(target) == ["law.json", "manifest.json", "notes.csv", "picture.png"]
    assert not (target / "settings").exists() and results.published == ["law.json", "picture.png"]
    manifest = json.loads((target / "manifest.json").read_text())
    assert manifest["complete"] and manifest["files"] == ["law.json", "picture.png", "manifest.json"]
    assert manifest["sha256"].keys() == {"law.json", "picture.png"}


def test_an_interruption_keeps_what_is_finished(tmp_path: Path) -> None:
    target = tmp_path / "out"
    with (
        pytest.raises(Interrupted, match=r"holds what was finished: law\.json, one\.png") as stop,
        results_folder(target, "test") as results,
    ):
        _fill(results.draft, "law.json")
        results.publish("the pictures")
        _fill(results.draft, "one.png")
        raise Interrupted
    assert "Not written: the pictures" in str(stop.value)
    assert written(target) == ["UNFINISHED.txt", "law.json", "manifest.json", "one.png"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    with pytest.raises(Interrupted, match="Nothing was written"), results_folder(tmp_path / "two", "test"):
        raise Interrupted
    assert not (tmp_path / "two").exists()


def test_a_folder_that_cannot_be_made_is_named_as_the_user_named_it(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match=r"/file/out' cannot be written \(.*\): name another") as error:
        _write(tmp_path / "file" / "out", "a.txt")
    assert "draft" not in str(error.value)


def test_a_full_disk_is_told_of_the_users_folder(tmp_path: Path) -> None:
    with (
        pytest.raises(ValueError, match=r"/out/laws/a.json' cannot be written \(No space left on device\)"),
        results_folder(tmp_path / "out", "test") as results,
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(results.draft / "laws" / "a.json"))


def test_replacing_takes_away_its_own_files_and_keeps_those_of_others(tmp_path: Path) -> None:
    target = tmp_path / "out"
    _write(target, "a.txt", "old/b.txt", "kept/c.txt")
    (target / "kept" / "notes.txt").write_text("mine")
    _write(target, "a.txt", "new/d.txt", replace=True)
    assert written(target) == ["a.txt", "kept/notes.txt", "manifest.json", "new/d.txt"]
    assert not (target / "old").exists()


def test_an_empty_folder_is_taken(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    _write(tmp_path / "out", "a.txt")
    assert written(tmp_path / "out") == ["a.txt", "manifest.json"]


@pytest.mark.parametrize("manifest", ["", "[]", '{"format": "other"}'])
def test_a_folder_of_others_is_refused_and_only_files_of_the_same_name_are_replaced(
    tmp_path: Path, manifest: str
) -> None:
    target = tmp_path / "out"
    target.mkdir()
    (target / "manifest.json").write_text(manifest)
    (target / "mine.txt").write_text("mine")
    with pytest.raises(ValueError, match="was not written by jaxdamp"):
        _write(target, "a.txt")
    _write(target, "a.txt", replace=True)
    assert written(target) == ["a.txt", "manifest.json", "mine.txt"]


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(ValueError, match="is a file"):
        _write(tmp_path / "out", "a.txt", replace=True)


def test_a_manifest_cannot_point_outside_the_folder(tmp_path: Path) -> None:
    target = tmp_path / "out"
    _write(target, "a.txt")
    (tmp_path / "precious.txt").write_text("mine")
    files = ["../precious.txt", str(tmp_path / "precious.txt"), "a.txt"]
    (target / "manifest.json").write_text(json.dumps({"format": "jaxdamp results", "command": "test", "files": files}))
    _write(target, "b.txt", replace=True)
    assert (tmp_path / "precious.txt").exists() and not (target / "a.txt").exists()


def _texts(folder: Path) -> dict[str, str]:
    return {file.relative_to(folder).as_posix(): file.read_text() for file in folder.rglob("*") if file.is_file()}


def test_the_results_before_are_kept(tmp_path: Path) -> None:
    target = tmp_path / "out"
    for run in ("one", "two", "three"):
        with results_folder(target, "test", replace=True) as results:
            for name in ("law.json", f"{run}/table.csv"):
                (results.draft / name).parent.mkdir(exist_ok=True)
                (results.draft / name).write_text(run)
    texts = {name: text for name, text in _texts(target).items() if not name.endswith("manifest.json")}
    assert texts == {
        "law.json": "three",
        "three/table.csv": "three",
        ".previous/law.json": "two",
        ".previous/two/table.csv": "two",
    }


def test_results_of_another_command_are_never_replaced(tmp_path: Path) -> None:
    target = tmp_path / "out"
    _write(target, "best_law.json", "laws/linear.json")
    with (
        pytest.raises(ValueError, match="results of jaxdamp test, which jaxdamp ride does not replace"),
        results_folder(target, "ride", replace=True),
    ):
        pass
    assert written(target) == ["best_law.json", "laws/linear.json", "manifest.json"]


def test_a_link_in_the_folder_leads_nowhere_else(tmp_path: Path) -> None:
    target, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    _write(target, "a.txt", "laws/b.txt")
    (target / "laws").rename(elsewhere)
    (target / "laws").symlink_to(elsewhere)
    (elsewhere / "mine.txt").write_text("mine")
    _write(target, "c.txt", replace=True)
    assert written(elsewhere) == ["b.txt", "mine.txt"]


@pytest.mark.parametrize("staged", [False, True])
def test_nothing_is_written_through_a_link(tmp_path: Path, staged: bool) -> None:
    target, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "b.txt").write_text("precious")
    for _ in range(2):
        _write(target, "a.txt", replace=True)
        if not (target / "laws").exists():
            (target / "laws").symlink_to(elsewhere)
        with results_folder(target, "test", replace=True) as results:
            if staged:
                _fill(results.draft, "a.txt")
                results.publish("the laws")
            _fill(results.draft, "laws/b.txt", "laws/deep/c.txt")
        assert written(elsewhere) == ["b.txt"] and (elsewhere / "b.txt").read_text() == "precious"
        assert not (target / "laws").is_symlink() and (target / "laws/b.txt").read_text() == "laws/b.txt"
    (target / ".previous").rename(tmp_path / "moved")
    (target / ".previous").symlink_to(elsewhere)
    with pytest.raises(ValueError, match="previous' is a link"):
        _write(target, "a.txt", replace=True)


def test_a_changed_file_that_is_replaced_late_is_kept(tmp_path: Path) -> None:
    target = tmp_path / "out"
    _write(target, "law.json", "report.html")
    (target / "report.html").write_text("with notes")
    with results_folder(target, "test", replace=True) as results:
        _fill(results.draft, "law.json")
        results.publish("the report")
        _fill(results.draft, "report.html")
        results.publish("the pictures")
        _fill(results.draft, "report.html")
    texts = _texts(target)
    assert texts["report.html"] == "report.html" and texts[".previous/report.html"] == "with notes"


def test_a_file_that_was_changed_stays(tmp_path: Path) -> None:
    target = tmp_path / "out"
    _write(target, "law.json", "table.csv")
    (target / "law.json").write_text("corrected by hand")
    (target / "table.csv").write_text("too")
    _write(target, "law.json", replace=True)
    assert (target / "table.csv").read_text() == "too"
    _write(target, "law.json", replace=True)
    assert "law.json" in _texts(target).values()


@pytest.mark.parametrize("staged", [False, True])
def test_a_sudden_end_while_files_are_moved_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, staged: bool
) -> None:
    """Whenever it comes: all old files are somewhere, and none stands beside a new one unless a note says so."""

    class Killed(BaseException):
        pass

    replace, ended, steps = os.replace, False, 0
    while not ended:
        target = tmp_path / str(steps) / "out"
        with results_folder(target, "test") as results:
            for name in ("law.json", "report.html"):
                (results.draft / name).write_text(f"old {name}")
        left = steps

        def interrupted(source: Path, place: Path) -> None:
            nonlocal left
            if left == 0:
                raise Killed
            left -= 1
            replace(source, place)

        monkeypatch.setattr(os, "replace", interrupted)
        ended = True
        try:
            with results_folder(target, "test", replace=True) as results:
                (results.draft / "law.json").write_text("new law.json")
                if staged:
                    results.publish("the report")
                (results.draft / "report.html").write_text("new report.html")
        except Killed:
            ended = False
        monkeypatch.setattr(os, "replace", replace)
        texts = _texts(target)
        assert {"old law.json", "old report.html"} <= set(texts.values())
        ages = {text[:3] for name, text in texts.items() if name in ("law.json", "report.html")}
        assert ended or ages <= {"old"} or "UNFINISHED.txt" in texts
        with results_folder(target, "test", replace=True) as results:
            (results.draft / "law.json").write_text("new law.json")
        assert written(target) == ["law.json", "manifest.json"]
        steps += 1
    assert steps > 5


def test_a_second_writer_is_refused(tmp_path: Path) -> None:
    with (
        results_folder(tmp_path / "out", "test"),
        pytest.raises(ValueError, match="Another command is writing"),
        results_folder(tmp_path / "out", "test"),
    ):
        pass


def test_what_a_killed_run_left_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / ".out.x1.draft").mkdir()
    _write(tmp_path / "out", "a.txt")
    assert ".out.x1.draft' was left by a run that was killed" in capsys.readouterr().err
