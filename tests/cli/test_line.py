"""`jaxdamp fit --each`: the dampers of a production line, with control charts of their numbers."""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
import zarr

from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import Bilinear

from .invoking import jaxdamp, refused


LIMITS = ["--law", "bilinear", "--rig", "none", "--in-control", "9"]


@pytest.fixture
def line(tmp_path: Path) -> Path:
    """Ten dampers in folders of their own; the records of one are torn."""
    for i in range(10):
        made(tmp_path / "line", i)
    (tmp_path / "line" / "No 7" / "torn.csv").write_text("time,stroke\n1,abc\n")
    return tmp_path / "line"


def made(line: Path, i: int, more: float = 0.0) -> None:
    law = Bilinear(2600.0 + 10.0 * np.sin(12.9898 * i**2) + more, 1200.0)
    dyno = VirtualDyno(law, force_noise=4.0, sampling_rate=100.0, seed=i)
    dyno.run(SineTest(0.02, 1.0)).write(line / f"No {i + 1}")


def rows(path: Path) -> dict[str, dict[str, str]]:
    return {row["damper"]: row for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines())}


def test_a_line_is_fitted_and_charted_and_later_only_what_is_new(line: Path) -> None:
    out = line.with_name("results")
    words = ["fit", line, "--each", "folder", *LIMITS, "--out", out]
    text = " ".join(jaxdamp(*words).output.split())
    assert "Bilinear fitted to 10 dampers, 1 of them left out" in text and "--skip-bad leaves out what cannot" in text
    (line / "No 7" / "torn.csv").unlink()
    made(line, 10, more=300.0)
    text = " ".join(jaxdamp(*words, "--replace").output.split())
    assert "Bilinear fitted to 11 dampers: mean" in text and "rebound_rate since 'No 11'" in text
    names = zarr.open_group(line.with_name("results.zarr"), mode="r")["name"]
    assert [str(name) for name in np.asarray(names) if name][10:] == ["No 7", "No 11"]
    found = rows(out / "tables" / "dampers.csv")
    assert list(found) == [f"No {i + 1}" for i in range(11)]
    assert "individuals high" in found["No 11"]["signals"] and not found["No 7"]["remark"]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "out of control at the end" in page and "No 11" in page and (out / "result.png").is_file()


def test_another_damper_may_be_the_first_of_a_line_later(tmp_path: Path) -> None:
    line, out = tmp_path / "line", tmp_path / "out"
    for i in (1, 2):
        made(line, i)
    words = ["fit", line, "--each", "folder", "--law", "bilinear", "--out", out]
    jaxdamp(*words)
    made(line, 0, more=200.0)
    assert "Bilinear fitted to 3 dampers: mean" in " ".join(jaxdamp(*words, "--replace").output.split())
    names = zarr.open_group(tmp_path / "out.zarr", mode="r")["name"]
    assert [str(name) for name in np.asarray(names) if name] == ["No 2", "No 3", "No 1"]
    said = " ".join(jaxdamp(*words, "--replace", "--cycles", "1", code=2).output.split())
    assert "holds other work: start is Bilinear" in said


def test_without_the_library_of_stores_it_says_so_before_it_reads(line: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zarr", None)
    said = jaxdamp("fit", line, "--each", "folder", *LIMITS, "--out", line.with_name("out"), code=2).output
    assert "pip install 'jaxdamp[cluster]'" in " ".join(said.split()) and "Reading" not in said


def test_what_a_line_does_not_take_is_refused(line: Path, tmp_path: Path) -> None:
    words = ["fit", line, "--each", "folder", "--out", tmp_path / "out"]
    assert "--law must be one law for all dampers, but is left out" in refused(tmp_path, *words)
    assert "--each must be one of 'folder', 'file', but is 'name'" in refused(
        tmp_path, "fit", line, "--each", "name", "--law", "linear"
    )
    assert "--held-out must be left out where each" in refused(tmp_path, *words, "--law", "linear", "--held-out", "x")
    said = refused(tmp_path, *words, "--law", "linear", "--in-control", "3")
    assert "--in-control must be from 8 to 10 dampers, but is 3" in said
    assert "--in-control must be given with --each" in refused(tmp_path, "fit", line / "No 7", *LIMITS)
    said = refused(tmp_path, *words, "--law", "linear", "--over", "rate")
    assert "--over must be left out where each damper is fitted" in said
