"""`jaxdamp sweep --block`: parts of a sweep in any order, killed, repeated, at once are the sweep of one process."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import zarr

from jaxdamp.sweeps.block_program import BlockProgram
from tests.cli.invoking import jaxdamp, refused


AXES = ["--over", "sprung_mass=800:1200:20", "--over", "damper.rate=1000:4000:40"]  # four blocks
WORDS = ["sweep", "quarter_car_000", "white:C", *AXES]


class Killed(BaseException):
    """The end of a process, as far as a test can see it."""


def _marks(store: Path) -> np.ndarray:
    return np.asarray(zarr.open_group(store, mode="r")["done"])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> str:
    out = tmp_path_factory.mktemp("whole") / "run"
    jaxdamp(*WORDS, "--out", out)
    return (out / "sweep.csv").read_text()


@pytest.mark.slow
def test_parts_in_any_order_are_the_sweep_of_one_process(
    tmp_path: Path, whole: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, computed, compute = tmp_path / "run", list[int](), BlockProgram.compute

    def counted(work: BlockProgram, indices: np.ndarray) -> object:
        if len(computed) == 1:
            computed.append(0)
            raise Killed
        computed.append(indices.size)
        return compute(work, indices)

    monkeypatch.setattr(BlockProgram, "compute", counted)
    with pytest.raises(Killed):
        jaxdamp(*WORDS, "--out", out, "--block", "1/2")
    assert _marks(tmp_path / "run.zarr").tolist() == [0, -1, -1, -1]
    jaxdamp(*WORDS, "--out", out, "--block", "3/3")
    assert _marks(tmp_path / "run.zarr").tolist() == [0, -1, 0, -1]
    said = jaxdamp(*WORDS, "--out", out, "--block", "1/2").output
    assert "Part 1/2 is done. 400 of 800 points are in" in " ".join(said.split())
    assert "Part 6/6 has no block: the sweep has 4." in jaxdamp(*WORDS, "--out", out, "--block", "6/6").output
    assert not out.exists() and sum(computed) == 400
    jaxdamp(*WORDS, "--out", out)
    assert sum(computed) == 800 and (out / "sweep.csv").read_text() == whole
    said = jaxdamp(*WORDS, "--out", out, "--block", "2/2").output  # as a queue starts it again
    assert sum(computed) == 800 and "The same command without --block writes the results." in " ".join(said.split())


def test_a_part_of_another_sweep_is_told_what_differs(tmp_path: Path) -> None:
    out = ["--out", tmp_path / "run"]
    jaxdamp(*WORDS, *out, "--block", "2/4")
    other = ["sweep", "quarter_car_000", "white:D", *AXES, "--speed", "30", *out]
    for more in (["--block", "1/4"], []):
        said = refused(tmp_path, *other, *more)
        assert "run.zarr' holds another sweep: ROAD is white:D now, and was white:C; --speed is 30" in said
        assert "name another folder with --out, or delete the store" in said
    (tmp_path / "other.zarr").mkdir()
    said = refused(tmp_path, *WORDS, "--out", tmp_path / "other", "--block", "1/4")
    assert "The store: " in said and "is no store of jaxdamp's" in said and "Name another folder with --out" in said


@pytest.mark.slow
def test_parts_at_once_of_which_one_is_killed(tmp_path: Path, whole: str) -> None:
    def begun(part: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "jaxdamp", *WORDS, "--out", "run", "--block", part]
        return subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL)

    first, twin, other = begun("1/2"), begun("1/2"), begun("2/2")
    while first.poll() is None and not (tmp_path / "run.zarr").exists():
        time.sleep(0.01)
    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    assert (twin.wait(), other.wait()) == (0, 0)
    assert _marks(tmp_path / "run.zarr").tolist() == [0, 0, 0, 0]
    jaxdamp(*WORDS, "--out", tmp_path / "run")
    assert (tmp_path / "run" / "sweep.csv").read_text() == whole
