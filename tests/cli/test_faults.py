"""What can happen to a command from outside: signals at any moment, a full disk, folders from which nothing runs."""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from jaxdamp.export import from_json


NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?")
ROOT = Path(__file__).parents[2]
MOMENTS, SOME = 10, 3  # of each signal in each command before a release, and of one of them otherwise
COMMANDS = {
    "fit": "fit {records} --law linear,besinger",
    "sweep": "sweep quarter_car_000 iso:C --over damper.rate=1000:4000:40 --duration 2",
    "report": "report {records} --vehicle quarter_car_000 --road bump:0.05:5 --law linear --duration 2",
}


def _environment(tmp_path: Path, **more: str) -> dict[str, str]:
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    return os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONPATH": path} | more


def _command(*words: object, folder: Path, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "jaxdamp", *map(str, words)],
        cwd=folder,
        env=_environment(folder, **more),
        capture_output=True,
        text=True,
        timeout=1200,
    )


def _numbers(folder: Path) -> dict[str, str]:
    """The results of a command that may not depend on when it was run."""
    tables = {file.name: file.read_text() for file in sorted(folder.rglob("*.csv"))}
    return tables | {file.name: repr(from_json(file)) for file in sorted(folder.rglob("laws/*.json"))}


@pytest.mark.slow
@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.exhaustive_cases("fit-SIGINT", "fit-SIGTERM", "sweep-SIGINT", "report-SIGINT", "report-SIGTERM")
def test_a_signal_at_any_moment_loses_nothing(
    tmp_path: Path, records: Path, name: str, number: str, request: pytest.FixtureRequest
) -> None:
    words = COMMANDS[name].format(records=records).split()
    whole = _command(*words, "--out", "whole", folder=tmp_path)
    assert whole.returncode == 0, whole.stderr
    count = MOMENTS if "exhaustive" in str(request.config.getoption("-m")) else SOME
    moments = np.random.default_rng(sum(map(ord, name + number))).uniform(0.0, 6.0, count)
    moments = ",".join(f"{moment:.3f}" for moment in moments)
    driver = [sys.executable, "-m", "tests.cli.sudden_ends", number, moments, "--", *words, "--out", "{number}"]
    done = subprocess.run(
        driver, cwd=tmp_path, env=_environment(tmp_path), capture_output=True, text=True, timeout=3600
    )
    assert done.returncode == 0, done.stderr
    ends = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(ends) == count
    stopped = {"SIGINT": 130, "SIGTERM": 143}[number]
    assert any(end["code"] == stopped for end in ends), ends
    for end in ends:
        assert end["code"] in (0, stopped) and "Traceback" not in end["said"], end
        folder = tmp_path / str(end["number"])
        complete = folder.exists() and json.loads((folder / "manifest.json").read_text())["complete"]
        assert (folder.exists() and not complete) == (folder / "UNFINISHED.txt").exists(), end
        assert end["code"] == 0 or not complete, end
        assert not folder.exists() or all(from_json(law) for law in folder.rglob("laws/*.json"))
    assert not [path for path in tmp_path.iterdir() if path.name.endswith(".draft")]
    last = ends[-1]["number"]
    again = _command(*words, "--out", last, "--replace", folder=tmp_path)
    assert again.returncode == 0 and _numbers(tmp_path / str(last)) == _numbers(tmp_path / "whole"), again.stderr


@pytest.mark.slow
def test_a_command_that_was_killed_goes_on_from_what_it_had_finished(tmp_path: Path, records: Path) -> None:
    words = list(map(str, ["fit", records, "--law", "linear,besinger_lag,besinger_series_spring", "--out"]))
    command = [sys.executable, "-m", "jaxdamp", *words, "out"]
    process = subprocess.Popen(command, cwd=tmp_path, env=_environment(tmp_path), stdout=subprocess.DEVNULL)
    kept = tmp_path / "cache" / "jaxdamp" / "unfinished"
    while process.poll() is None and not list(kept.glob("*/*.piece")):
        time.sleep(0.01)
    process.kill()
    process.wait()
    assert list(kept.glob("*/*.piece")) and not (tmp_path / "out").exists()
    resumed = _command(*words, "out", "--resume", folder=tmp_path)
    whole = _command(*words, "whole", folder=tmp_path)
    assert (resumed.returncode, whole.returncode) == (0, 0), (resumed.stderr, whole.stderr)
    assert "Resumed with what" in resumed.stdout and not list(kept.iterdir())
    assert _numbers(tmp_path / "out") == _numbers(tmp_path / "whole")


@contextmanager
def _small_disk(folder: Path, options: str) -> Iterator[Path]:
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], capture_output=True).returncode:
        pytest.skip("no file system can be mounted here, which takes the rights of root")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.slow
@pytest.mark.parametrize("room", [20, 300])
def test_a_full_disk_is_named_and_leaves_what_was_there(tmp_path: Path, records: Path, room: int) -> None:
    """A disk of 2 MB of which some is left: results have 600 kB, tables and laws some 50."""
    with _small_disk(tmp_path / "disk", "size=2m") as disk:
        (disk / "others").write_bytes(bytes((2048 - room) * 1024))
        (disk / "notes").write_text("mine")
        done = _command("fit", records, "--law", "linear", "--out", disk / "out", folder=tmp_path)
        assert done.returncode == 2 and "Traceback" not in done.stderr, done.stderr
        assert "No space left on device" in done.stderr and str(disk / "out") in done.stderr
        assert (disk / "notes").read_text() == "mine"
        left = {path.name for path in disk.iterdir()} - {"notes", "others"}
        assert not left or (left == {"out"} and (disk / "out" / "UNFINISHED.txt").exists())
        (disk / "others").unlink()
        again = _command("fit", records, "--law", "linear", "--out", disk / "out", "--replace", folder=tmp_path)
        assert again.returncode == 0 and not (disk / "out" / "UNFINISHED.txt").exists(), again.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fit", "sweep"])
@pytest.mark.exhaustive_cases("sweep")
def test_where_nothing_runs_from_the_temporary_folder_results_are_the_same(
    tmp_path: Path, records: Path, name: str
) -> None:
    words = COMMANDS[name].format(records=records).replace("linear,besinger", "bilinear").split()
    with _small_disk(tmp_path / "temporary", "size=200m,noexec") as disk:
        more = {"TMPDIR": str(disk), "XDG_CACHE_HOME": str(disk / "cache")}
        plain = _command(*words, "--out", "plain", folder=tmp_path)
        done = _command(*words, "--out", "noexec", folder=tmp_path, **more)
        assert (plain.returncode, done.returncode) == (0, 0), (plain.stderr, done.stderr)
    ours, theirs = (_numbers(tmp_path / kind) for kind in ("plain", "noexec"))
    assert ours.keys() == theirs.keys()
    for name in ours:  # one by a program of C, the other by XLA
        assert NUMBER.sub("#", ours[name]) == NUMBER.sub("#", theirs[name])
        pairs = (np.array(NUMBER.findall(text), float) for text in (ours[name], theirs[name]))
        np.testing.assert_allclose(*pairs, rtol=1e-4, atol=1e-9, err_msg=name)
