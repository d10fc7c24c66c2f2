import json
from pathlib import Path

import pytest

from jaxdamp.cli.results import results_folder, written


def _write(target: Path, *names: str, force: bool = False) -> None:
    with results_folder(target, "test", force=force) as folder:
        for name in names:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(name)


def test_files_appear_with_a_manifest(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "out"
    _write(target, "a.txt", "sub/b.txt")
    assert written(target) == ["a.txt", "manifest.json", "sub/b.txt"]
    manifest = json.loads((target / "manifest.json").read_text())
    assert manifest["command"] == "test" and manifest["files"] == ["a.txt", "sub/b.txt", "manifest.json"]
    assert [path.name for path in target.parent.iterdir()] == ["out"]


def test_a_failure_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), results_folder(tmp_path / "out", "test") as folder:
        (folder / "a.txt").write_text("half")
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_a_failure_leaves_earlier_results_as_they_were(tmp_path: Path) -> None:
    target = tmp_path / "out"
    _write(target, "a.txt")
    with pytest.raises(RuntimeError), results_folder(target, "test") as folder:
        (folder / "a.txt").write_text("half")
        raise RuntimeError
    assert (target / "a.txt").read_text() == "a.txt"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_second_run_replaces_its_own_files_and_keeps_those_of_others(tmp_path: Path) -> None:
    target = tmp_path / "out"
    _write(target, "a.txt", "old/b.txt", "kept/c.txt")
    (target / "kept" / "notes.txt").write_text("mine")
    _write(target, "a.txt", "new/d.txt")
    assert written(target) == ["a.txt", "kept/notes.txt", "manifest.json", "new/d.txt"]
    assert not (target / "old").exists()


def test_an_empty_folder_is_taken(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    _write(tmp_path / "out", "a.txt")
    assert written(tmp_path / "out") == ["a.txt", "manifest.json"]


@pytest.mark.parametrize("manifest", ["", "[]", '{"format": "other"}'])
def test_a_folder_of_others_is_refused_and_force_replaces_only_files_of_the_same_name(
    tmp_path: Path, manifest: str
) -> None:
    target = tmp_path / "out"
    target.mkdir()
    (target / "manifest.json").write_text(manifest)
    (target / "mine.txt").write_text("mine")
    with pytest.raises(ValueError, match="was not written by jaxdamp"):
        _write(target, "a.txt")
    _write(target, "a.txt", force=True)
    assert written(target) == ["a.txt", "manifest.json", "mine.txt"]


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(ValueError, match="is a file"):
        _write(tmp_path / "out", "a.txt", force=True)


def test_a_manifest_cannot_point_outside_the_folder(tmp_path: Path) -> None:
    target = tmp_path / "out"
    _write(target, "a.txt")
    (tmp_path / "precious.txt").write_text("mine")
    files = ["../precious.txt", str(tmp_path / "precious.txt"), "a.txt"]
    (target / "manifest.json").write_text(json.dumps({"format": "jaxdamp results", "files": files}))
    _write(target, "b.txt")
    assert (tmp_path / "precious.txt").exists() and not (target / "a.txt").exists()
