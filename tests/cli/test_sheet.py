"""From a manufacturer's sheet to the best click, in the units of the shop."""

import csv
from pathlib import Path

import pytest

from jaxdamp.export import from_json

from .invoking import draw_nothing, jaxdamp, refused


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    """A sheet of three clicks in lbf at in/s."""
    rows = ["velocity [in/s],R1 [lbf],R2 [lbf],R3 [lbf],C1 [lbf],C2 [lbf],C3 [lbf]"]
    rows += [f"{v},{5 * v},{8 * v},{11 * v},{3 * v},{4 * v},{5 * v}" for v in (1, 5, 10)]
    (tmp_path / "sheet.csv").write_text("\n".join(rows))
    return tmp_path / "sheet.csv"


@pytest.mark.pictures
def test_a_sheet_becomes_a_family_and_a_best_click(sheet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = sheet.parent
    monkeypatch.chdir(folder)
    (folder / "jaxdamp.toml").write_text('[show]\nunits = "metric"\n')
    said = jaxdamp("fit", sheet, "--units", "imperial", "--out", folder / "fit").output
    assert "Shown in units imperial" in said and "8 settings" not in said
    rows = list(csv.reader((folder / "fit/tables/forces.csv").read_text().splitlines()))
    assert rows[0] == ["velocity [in/s]", "force at 1 [lbf]", "force at 2 [lbf]", "force at 3 [lbf]"]
    assert [float(cell) for cell in rows[-1]] == pytest.approx([10.0, 50.0, 80.0, 110.0])
    assert (
        (folder / "fit/sheet.pdf").read_bytes()[:4] == b"%PDF"
        and (folder / "fit/family.png").is_file()
        and (folder / "fit/laws/3.json").is_file()
    )
    draw_nothing(monkeypatch)
    ride = ("quarter_car_000", "iso:A", "--law", folder / "fit/best_law.json", "--duration", "1")
    few = ("--fresh-roads", "2")
    said = " ".join(jaxdamp("tune", *ride, *few, "--limit", "grip=+20%", "--out", folder / "tune").output.split())
    assert (
        "is the best of 3 combinations" in said and "beside the next, damper.command = " in said and "2 fresh" in said
    )
    assert "Shown in units metric" in said and "(from jaxdamp.toml)" in said
    rows = list(csv.DictReader((folder / "tune/combinations.csv").read_text().splitlines()))
    assert float(from_json(folder / "tune/law.json").command) == float(rows[0]["damper.command"])
    assert {float(row["damper.command"]) for row in rows} == {1.0, 2.0, 3.0}
    name = next(name for name in rows[0] if name.startswith("weighted_rms_sprung_acceleration"))
    comfort = [float(row[name]) for row in rows if row["limits"] == "met"]
    assert comfort == sorted(comfort) and len(comfort) > 1
    none = jaxdamp("tune", *ride, *few, "--limit", "grip=0.001", "--out", folder / "none", code=1).output
    assert "Limit not met" in none and "the nearest to the limits of 3" in " ".join(none.split())


def test_what_says_nothing_of_a_sheet_is_refused(sheet: Path) -> None:
    words = ("fit", sheet, "--out", sheet.parent / "a")
    assert "without hysteresis" in refused(sheet.parent, *words, "--law", "bouc_wen")
    assert "force-velocity table" in refused(sheet.parent, *words, "--cross-validate")
    assert "'imperial'" in refused(sheet.parent, *words, "--units", "imperal")
    for option in (
        ["--filter", "50"],
        ["--cycles", "3"],
        ["--keep-bad"],
        ["--command", "3"],
        ["--rig", "gas"],
        ["--bound", "force=0:3"],
        ["--starts", "4"],
        ["--resume"],
    ):
        said = refused(sheet.parent, *words, *option)
        assert f"Option {option[0]} must be left out with a force-velocity table" in said, option
    for option in (["--gains", "force=2"], ["--keep-rest"], ["--drop-bad-rows"], ["--mean-cycle"]):
        said = refused(sheet.parent, *words, "--sign", "rebound-positive", "--law", "linear", *option)
        assert f"Option {option[0]} must be left out with a force-velocity table" in said, option


def test_all_laws_are_those_that_a_sheet_can_tell(sheet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    draw_nothing(monkeypatch)
    points = [f"{v},{4000 * v if v > 0 else 2000 * v}" for v in (-0.5, -0.3, -0.1, 0.1, 0.3, 0.5)]
    sheet.write_text("\n".join(["velocity [m/s],force [N]", *points]))
    words = ("fit", sheet, "--sign", "rebound-positive", "--law", "all", "--out", sheet.parent / "fit")
    said = " ".join(jaxdamp(*words).output.split())
    assert "Recommended: bilinear" in said and "besinger_lag" not in said and "--law all" not in said
    assert "table could not be fitted. 6 points are too few for its 13 numbers: measure more points, or" in said
    assert from_json(sheet.parent / "fit" / "best_law.json").rebound_rate == pytest.approx(4000.0, rel=1e-6)


def test_a_table_has_its_page_where_it_is_asked_for(sheet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    draw_nothing(monkeypatch)
    jaxdamp("fit", sheet, "--out", sheet.parent / "fit", "--report", sheet.parent / "page.html")
    assert "Forces of sheet" in (sheet.parent / "page.html").read_text()


def test_units_outside_their_table_are_not_overlooked(sheet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(sheet.parent)
    (sheet.parent / "jaxdamp.toml").write_text('units = "imperial"\n')
    said = refused(sheet.parent, "fit", sheet, "--units", "imperial", "--out", sheet.parent / "a")
    assert "must stand under [show], but is 'imperial' above all tables in jaxdamp.toml" in said
