"""`jaxdamp bench` and the processing options of `jaxdamp fit`, called as a user does."""

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jaxdamp.bench import BenchSet, SineTest, VirtualDyno
from jaxdamp.cli import fitting
from jaxdamp.dampers import Bilinear, Scheduled
from jaxdamp.export import from_json, to_json

from .invoking import jaxdamp, refused


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Records with rest, and one of them clipped."""
    ends: dict[str, Any] = {"rest_before": 0.5, "run_up": 1.0, "run_down": 1.0, "rest_after": 0.5}
    tests = [SineTest(0.01, f, cycles=5, name=f"10mm_{f:g}Hz", **ends) for f in (1.0, 2.0, 4.0)]
    settings: dict[str, Any] = {"sampling_rate": 500.0, "force_noise": 2.0}
    runs = VirtualDyno(Bilinear(2600.0, 1200.0), **settings).run(tests)
    clipped = VirtualDyno(Bilinear(2600.0, 1200.0), force_limit=150.0, **settings)
    bad = clipped.run(SineTest(0.01, 2.0, cycles=5, name="clipped", **ends))
    folder = tmp_path_factory.mktemp("bench")
    BenchSet([*runs, *bad]).write(folder)
    return folder


def rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


@pytest.mark.pictures
def test_bench_prints_and_writes_preflight_evaluation_and_limits(folder: Path, tmp_path: Path) -> None:
    limits, out = tmp_path / "limits.csv", tmp_path / "out"
    limits.write_text(
        "quantity,velocity,minimum,maximum\nrebound force,0.131,330,350\ncompression force,0.131,-150,-100\n"
    )
    to_json(Bilinear(1300.0, 1200.0), tmp_path / "softer.json")
    words = ["--limits", limits, "--baseline", tmp_path / "softer.json", "--cycles", "last:4"]
    text = jaxdamp("bench", folder, *words, "--out", out, code=1).output
    flat = " ".join(text.split())
    answer, table = flat.index("are kept: NOT PASSED."), flat.index("Forces at stated velocities")
    assert answer < table and flat.index(" N in rebound and ") < table
    assert "rest before" not in flat  # it is cut off
    for said in (
        "1 error,",
        "error, force clipped: clipped",
        "rest cut off",
        "Limits: not all passed",
        "Forces beside the baseline",
    ):
        assert said in flat, said
    written = {row["quantity"]: row for row in rows(out / "tables" / "velocities.csv")}
    assert float(written["rebound force at 0.131 m/s"]["value"]) == pytest.approx(2600 * 0.131, rel=0.01)
    assert {row["record"] for row in rows(out / "tables" / "peak_forces.csv")} == {"10mm_1Hz", "10mm_2Hz", "10mm_4Hz"}
    verdicts = [row["verdict"] for row in rows(out / "tables" / "limits.csv")]
    assert verdicts == ["passed", "FAILED"]
    findings = rows(out / "tables" / "preflight.csv")
    assert findings[0]["severity"] == "error" and findings[0]["record"] == "clipped"
    for name in ("evaluation.png", "preflight.png", "gas_and_friction_1.png"):
        assert (out / name).read_bytes().startswith(b"\x89PNG")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 4 and "Forces at stated velocities" in page and "FAILED" in page
    beside = page.partition("Forces beside the baseline")[2].partition("</tr>")[2].partition("</tr>")[0]
    change = float(re.findall(r"\+[\d.]+", beside)[-1])  # of the rebound force, with twice the rate of the baseline
    assert change == pytest.approx(100.0, abs=2.0)


def test_fit_refuses_records_with_an_error_or_leaves_them_out(folder: Path, tmp_path: Path) -> None:
    said = refused(tmp_path, "fit", folder, "--law", "bilinear", "--out", tmp_path / "none")
    assert "clipped: the force is clipped" in said and "With --skip-bad" in said and not (tmp_path / "none").exists()
    text = jaxdamp("fit", folder, "--skip-bad", "--law", "bilinear", "--out", tmp_path / "out").output
    text = " ".join(text.split())
    assert "error, force clipped" in text and "left out, with an error: clipped" in text
    assert "note, run-up" not in text
    assert [row["record"] for row in rows(tmp_path / "out/tables/records.csv")] == ["10mm_1Hz", "10mm_2Hz", "10mm_4Hz"]
    assert rows(tmp_path / "out/tables/preflight.csv")[0]["finding"] == "force clipped"
    assert "force clipped" in (tmp_path / "out/report.html").read_text(encoding="utf-8")
    only = refused(tmp_path, "fit", folder / "clipped.csv", "--law", "linear", "--out", tmp_path / "none")
    assert "the force is clipped at 150 N" in only


def test_fit_refuses_a_wrong_unit_unless_it_is_said_or_told_to_keep_it(tmp_path: Path) -> None:
    run = VirtualDyno(Bilinear(2600.0, 1200.0), force_noise=2.0, sampling_rate=500.0).run(SineTest(0.01, 2.0))[0]
    np.savetxt(
        tmp_path / "run.csv",
        np.stack([run.time, 1e3 * run.stroke, run.force], axis=1),
        delimiter=",",
        header="t_s,x_m,F_N",
        comments="",
    )
    words = ["fit", tmp_path / "run.csv", "--law", "bilinear", "--out", tmp_path / "out"]
    said = refused(tmp_path, *words)
    assert "the stroke looks 1000 times too large, mm taken for m" in said and "amplitude 10 m" in said
    assert "--units stroke=mm" in said and "With --keep-bad" in said and "error: run" not in said
    jaxdamp(*words, "--units", "stroke=mm")
    assert from_json(tmp_path / "out/best_law.json").rebound_rate == pytest.approx(2600.0, rel=0.01)
    jaxdamp(*words, "--keep-bad", "--replace")
    assert from_json(tmp_path / "out/best_law.json").rebound_rate == pytest.approx(2.6, rel=0.01)


def test_settings_in_names_are_not_pooled(tmp_path: Path) -> None:
    """Two settings in the names of four records: a column each, the last word of the name as its heading."""
    runs = []
    for name, rate in (("0A", 1000.0), ("0.5A", 3000.0)):
        tests = [SineTest(0.01, f, cycles=5, name=f"10mm_{f:g}Hz_{name}") for f in (1.0, 2.0)]
        runs += VirtualDyno(Bilinear(rate, 0.5 * rate), sampling_rate=500.0, force_noise=2.0).run(tests)
    BenchSet(runs).write(tmp_path / "records")
    text = jaxdamp("bench", tmp_path / "records", "--velocities", "0.1", "--out", tmp_path / "out").output
    assert "they are taken as settings 0A, 0.5A, by a word of their names" in " ".join(text.split())
    (header, *_) = (tmp_path / "out" / "tables" / "velocities.csv").read_text().splitlines()
    assert header == "quantity,unit,0A,0.5A,change [%]"
    fits = jaxdamp("fit", tmp_path / "records", "--law", "bilinear", "--out", tmp_path / "fits").output
    assert "they are taken as settings 0A, 0.5A, by a word of their names" in " ".join(fits.split())
    laws = [from_json(tmp_path / "fits" / f"setting_{name}" / "best_law.json") for name in ("0A", "0.5A")]
    assert [float(law.rebound_rate) for law in laws] == [pytest.approx(r, rel=0.02) for r in (1000.0, 3000.0)]
    page = ("--report", tmp_path / "page.html")
    assert "fitted apart" in refused(tmp_path, "fit", tmp_path / "records", "--law", "bilinear", *page)
    assert "name the records of one" in refused(tmp_path, "report", tmp_path / "records", "--law", "bilinear")
    for number, run in enumerate(runs):
        run.to_csv(tmp_path / f"{'abcd'[number]}.csv")
    other = [tmp_path / f"{letter}.csv" for letter in "abcd"]
    flat = " ".join(jaxdamp("bench", *other, "--out", tmp_path / "other").output.split())
    assert "they are not pooled but stand one by one" in flat
    said = refused(tmp_path, "fit", *other, "--law", "bilinear", "--out", tmp_path / "pooled")
    assert "Records of the same motion differ in force" in said and "a and c by" in said and "--keep-bad" in said
    assert "Records of the same motion differ" in refused(tmp_path, "report", *other, "--law", "bilinear")
    jaxdamp("fit", *other, "--law", "bilinear", "--keep-bad", "--out", tmp_path / "pooled")
    assert 1500.0 < from_json(tmp_path / "pooled" / "best_law.json").rebound_rate < 2500.0


def test_settings_stated_on_the_command_line(folder: Path, tmp_path: Path) -> None:
    words = ("--command", "*_1Hz=1,*_2Hz=2,*_4Hz=2,clipped=3", "--velocities", "0.03,0.05")
    text = jaxdamp("bench", folder, *words, "--keep-rest", "--out", tmp_path / "out").output
    assert "rebound force at 0.05 m/s" in text and "rest cut off" not in text
    (header, *_) = (tmp_path / "out" / "tables" / "velocities.csv").read_text().splitlines()
    assert header == "quantity,unit,1,2,change [%]"


@pytest.mark.parametrize(
    ("words", "columns"),
    [(("--command", "0.5"), "0.5"), (("--settings", "*mm_{speed}Hz", "--command", "speed"), "1,2")],
)
def test_one_command_for_all_records_or_that_of_a_setting(
    words: tuple[str, ...], columns: str, folder: Path, tmp_path: Path
) -> None:
    files = [folder / f"10mm_{speed}Hz.csv" for speed in (1, 2)]
    jaxdamp("bench", *files, *words, "--velocities", "0.05", "--out", tmp_path / "out")
    (header, *_) = (tmp_path / "out" / "tables" / "velocities.csv").read_text().splitlines()
    assert header.startswith(f"quantity,unit,{columns}")


def test_records_are_compared_by_a_setting_of_the_manifest(folder: Path, tmp_path: Path) -> None:
    manifest = tmp_path / "bench.toml"
    manifest.write_text('sign = "rebound-positive"\nsettings = "*mm_{speed}Hz"\n')
    files = [folder / f"10mm_{speed}Hz.csv" for speed in (1, 2, 4)]
    words = ("--manifest", manifest, "--group-by", "speed", "--velocities", "0.05", "--out", tmp_path / "out")
    jaxdamp("bench", *files, *words)
    (header, *_) = (tmp_path / "out" / "tables" / "velocities.csv").read_text().splitlines()
    assert header.startswith("quantity,unit,1,2,4")
    said = refused(tmp_path, "bench", *files, "--group-by", "clicks", "--out", tmp_path / "none")
    assert "Option --group-by must name a setting that every record states" in said


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--cycles", "all"), "Option --cycles must read like 3, last:3 or skip:2, but is 'all'"),
        (("--cycles", "99"), "Option --cycles must be between 1 and the number of full cycles"),
        (("--between", "2"), "Option --between must read like 2:10"),
        (("--between", "50:60"), "The beginning in --between must leave some of the record"),
        (("--filter", "400"), "Option --filter must be less than 0.45 times the sampling rate"),
        (("--command", "warm"), "Option --command must name a setting that is a number"),
        (("--command", "*_1Hz=warm"), "Option --command must read like 0.5, '*_0.5A=0.5,*_1A=1' or the name of a"),
        (("--command", "0.5,1"), "Option --command must read like 0.5"),
        (("--velocities", "fast"), "Option --velocities must read like"),
        (("--velocities", "-1"), "Option --velocities must be positive"),
    ],
)
def test_wrong_options_are_refused_in_words(words: tuple[str, ...], message: str, folder: Path, tmp_path: Path) -> None:
    assert message in refused(tmp_path, "bench", folder / "10mm_2Hz.csv", *words, "--out", tmp_path / "out")


def test_records_with_errors_only_are_refused(folder: Path, tmp_path: Path) -> None:
    said = refused(tmp_path, "bench", folder / "clipped.csv", "--out", tmp_path / "out")
    assert "the force is clipped at" in said


def test_fit_processes_the_records_first(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("--law", "bilinear,linear", "--cycles", "last:3", "--filter", "100", "--between", "0:6", "--out", out)
    flat = " ".join(jaxdamp("fit", folder / "10mm_1Hz.csv", folder / "10mm_2Hz.csv", *words).output.split())
    for said in ("rest cut off", "filtered at 100 Hz with zero phase", "cut to", "of"):
        assert said in flat
    law = from_json(out / "best_law.json")
    assert isinstance(law, Bilinear) and float(law.rebound_rate) == pytest.approx(2600.0, rel=0.01)
    assert all(int(row["cycles"]) == 3 for row in rows(out / "tables" / "records.csv"))


def test_fits_of_each_value_of_a_setting(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    files = [folder / f"10mm_{speed}Hz.csv" for speed in (1, 2, 4)]
    words = ("--command", "*_1Hz=0.5,*_2Hz=1,*_4Hz=1", "--group-by", "command", "--law", "linear", "--out", out)
    text = jaxdamp("fit", *files, "--held-out", "10mm_4Hz", *words).output
    assert "command_0.5" in text and "command_1" in text
    for name, records in (("command_0.5", ["10mm_1Hz"]), ("command_1", ["10mm_2Hz", "10mm_4Hz"])):
        assert (out / name / "report.html").is_file() and (out / name / "best_law.json").is_file()
        assert [row["record"] for row in rows(out / name / "tables" / "records.csv")] == records
    assert not (out / "best_law.json").exists() and not (out / "UNFINISHED.txt").exists()
    said = refused(tmp_path, "fit", *files, "--held-out", "10mm_1Hz", *words[:-1], tmp_path / "none")
    assert "Option --held-out leaves no record of command_0.5 to fit" in said
    said = refused(tmp_path, "fit", *files, "--group-by", "clicks", "--out", tmp_path / "none")
    assert "Option --group-by must name a setting that every record states" in said


@pytest.mark.slow
def test_records_of_several_currents_are_fitted_as_one_law(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    files = [folder / f"10mm_{speed}Hz.csv" for speed in (1, 2, 4)]
    words = ("--command", "*_1Hz=0,*_2Hz=1,*_4Hz=2", "--law", "linear", "--out", out)
    said = " ".join(jaxdamp("fit", *files, *words, "--verbose").output.split())
    assert "linear interpolated to 1, whose records it was not fitted to: RMSE" in said
    law = from_json(out / "best_law.json")
    assert isinstance(law, Scheduled) and [float(level) for level in law.levels] == [0.0, 1.0, 2.0]
    between = rows(out / "tables" / "settings.csv")[1]
    assert float(between["setting"]) == 1.0 and float(between["interpolated [%]"]) > 50.0
    assert {path.name for path in out.glob("*_velocity_*.csv")} == {
        f"best_law_force_velocity_{level}.csv" for level in (0, 1, 2)
    }
    assert "best_law_interpolated_to_1.png" in {path.name for path in out.rglob("*.png")}


def test_a_group_that_cannot_be_fitted_costs_that_group_alone(folder: Path, tmp_path: Path, monkeypatch) -> None:
    original = fitting.fit_laws

    def failing(screen, names, runs, held_out, **options):
        if [run.name for run in runs] == ["10mm_1Hz"]:
            raise ValueError("The law linear could not be fitted.")
        return original(screen, names, runs, held_out, **options)

    monkeypatch.setattr(fitting, "fit_laws", failing)
    files = [folder / f"10mm_{speed}Hz.csv" for speed in (1, 2)]
    words = ("--command", "*_1Hz=0.5,*_2Hz=1", "--group-by", "command", "--law", "linear", "--out", tmp_path / "out")
    text = " ".join(jaxdamp("fit", *files, *words).output.split())
    assert "command_0.5: The law linear could not be fitted." in text
    assert (tmp_path / "out" / "command_1" / "best_law.json").is_file()


def test_files_without_a_stroke(folder: Path, tmp_path: Path) -> None:
    lines = (folder / "10mm_2Hz.csv").read_text().splitlines()
    cells = [line.split(",") for line in lines if not line.startswith("#")]
    (tmp_path / "v.csv").write_text("\n".join(",".join([row[0], *row[2:]]) for row in cells))
    said = refused(tmp_path, "bench", tmp_path / "v.csv", "--out", tmp_path / "none")
    assert "Or integrate the velocity, if the law needs no place of the stroke: --stroke-from-velocity." in said
    words = ("--stroke-from-velocity", "--out", tmp_path / "out")
    flat = " ".join(jaxdamp("bench", tmp_path / "v.csv", *words).output.split())
    assert "the stroke was integrated from the velocity" in flat and "stroke integrated from the velocity, less" in flat


def test_a_broken_file_among_others_names_the_option_that_leaves_it_out(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "broken.csv").write_text("t_s,x_mm,F_N\n0,1,x\n1,2\n")
    words = ("bench", folder / "10mm_2Hz.csv", tmp_path / "broken.csv", "--out", tmp_path / "out")
    assert "The other file can be read: --skip-bad leaves out what cannot." in refused(tmp_path, *words)
    assert "left out: " in jaxdamp(*words, "--skip-bad").output
