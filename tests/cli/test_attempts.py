"""A law that fails costs itself alone: its fit, its files, its picture."""

from pathlib import Path

import numpy as np
import pytest

from jaxdamp import export, plots, rig
from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import AbstractDamper, Bilinear, Linear
from jaxdamp.export import from_json
from jaxdamp.identify import ladder

from .invoking import jaxdamp


def test_a_delay_that_is_fitted_is_no_finding_of_the_preflight(tmp_path: Path) -> None:
    """It advised the option that the command had."""
    dyno = VirtualDyno(Bilinear(2600.0, 1200.0), sampling_rate=500.0, force_noise=2.0, force_delay=0.004)
    dyno.run([SineTest(0.01, f, name=f"{f:g} Hz") for f in (1.0, 2.0, 4.0)]).write(tmp_path / "late")
    words = ("fit", tmp_path / "late", "--law", "bilinear", "--out", tmp_path / "fit")
    assert "fit with --rig offset,delay" in " ".join(jaxdamp(*words).output.split())
    words = (*words[:-1], tmp_path / "delayed", "--rig", "offset,delay")
    assert "Preflight" not in jaxdamp(*words).output


def test_a_law_that_cannot_be_started_or_fitted_is_named_and_the_others_are_complete(
    records: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_guess(velocity: np.ndarray, force: np.ndarray) -> AbstractDamper:
        raise ValueError("too few knees")

    monkeypatch.setitem(ladder._MEMORYLESS, "table", no_guess)
    monkeypatch.setitem(ladder._MEMORYLESS, "polynomial", lambda velocity, force: Linear(np.nan))
    out = tmp_path / "fit"
    text = " ".join(jaxdamp("fit", records, "--law", "table,linear,polynomial,bilinear", "--out", out).output.split())
    assert "table could not be fitted. No start can be computed from these records: too few knees" in text
    assert "polynomial could not be fitted." in text
    assert sorted(path.stem for path in (out / "laws").iterdir()) == ["bilinear", "linear"]
    report = (out / "report.html").read_text(encoding="utf-8")
    assert "table could not be fitted" in report and report.count("data:image/png") == 5
    rows = (out / "tables" / "ladder.csv").read_text(encoding="utf-8").splitlines()
    assert [row.split(",")[0] for row in rows[1:]] == ["linear", "bilinear", "table", "polynomial"]
    assert rows[3].endswith(",failed")


def test_laws_and_tables_are_in_place_whatever_the_pictures_do(
    records: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "fit"
    seen: list[str] = []

    def no_picture(*arguments: object, **options: object) -> None:
        seen[:] = sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
        raise RuntimeError("no font")

    hold = rig.quasi_static

    def not_for_linear(law: AbstractDamper, velocities: np.ndarray) -> rig.QuasiStatic:
        if isinstance(law, Linear):
            raise FloatingPointError("overflow")
        return hold(law, velocities)

    monkeypatch.setattr(plots, "ladder", no_picture)
    monkeypatch.setattr(rig, "quasi_static", not_for_linear)
    text = " ".join(jaxdamp("fit", records, "--law", "linear,bilinear", "--out", out).output.split())
    assert {"best_law.json", "laws/linear.json", "laws/bilinear.json", "tables/ladder.csv", "UNFINISHED.txt"} <= set(
        seen
    )
    assert not [name for name in seen if name.endswith(".png")]
    assert "The picture ladder.png could not be made: no font" in text
    assert "The curve of linear in force_velocity.png could not be made: overflow" in text
    assert (out / "force_velocity.png").exists() and not (out / "UNFINISHED.txt").exists()
    assert "no font" in (out / "report.html").read_text(encoding="utf-8")


def test_an_export_that_fails_costs_its_file_alone(
    records: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = export.to_json

    def not_linear(law: AbstractDamper, path: Path) -> object:
        if isinstance(law, Linear):
            raise ValueError("has no name")
        return write(law, path)

    monkeypatch.setattr(export, "to_json", not_linear)
    out = tmp_path / "fit"
    text = jaxdamp("fit", records, "--law", "linear,bilinear", "--out", out).output
    assert "The files of the law linear could not be made: has no name" in " ".join(text.split())
    assert isinstance(from_json(out / "laws" / "bilinear.json"), Bilinear)
