import csv
import json
import re
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from jaxdamp import bench, identify
from jaxdamp.bench import BenchSet
from jaxdamp.cli import app
from jaxdamp.cli.records import law_names, split
from jaxdamp.cli.vehicle_words import presets
from jaxdamp.dampers import Bilinear, Linear
from jaxdamp.export import from_json, to_json

from .invoking import jaxdamp, refused


def _rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


# ---- help


def test_help_states_units_and_signs() -> None:
    text = " ".join(jaxdamp("--help").output.split())
    assert "SI everywhere" in text and '"stroke [mm]"' in text
    assert "positive in rebound" in text and "positive when it resists extension" in text
    assert all(command in text for command in ("fit", "demo", "ride", "laws", "vehicles", "--version"))


def test_version_is_that_of_the_package() -> None:
    assert jaxdamp("--version").output == f"jaxdamp {version('jaxdamp')}\n"


def test_vehicles_are_listed_with_a_line_of_meaning() -> None:
    lines = {line.split()[0]: line for line in jaxdamp("vehicles").output.splitlines() if line.strip()}
    assert all(len(lines[name].split()) > 4 for name in presets())


@pytest.mark.parametrize(
    ("command", "options"),
    [
        (
            "fit",
            "--law --held-out --sign --force-sign --columns --units --sampling-rate --weighting --rig --out --replace",
        ),
        ("demo", "--out --seed --replace --debug"),
        ("fit-vehicle", "--law --columns --road --reversed --over --sensor --guide --bench --rig --report --replace"),
    ],
)
def test_help_of_a_command_names_its_options(command: str, options: str) -> None:
    text = jaxdamp(command, "--help").output
    assert [option for option in options.split() if option not in text] == []


@pytest.mark.parametrize("words", ["export adams whole", "tune comfort", "sweep comfort", "report comfort"])
def test_help_writes_words_as_they_are_given(words: str) -> None:
    """They are refused with a capital letter, with which sentences begin."""
    command, *names = words.split()
    text = re.findall(r"[\w-]+", jaxdamp(command, "--help").output)
    assert {*names} <= {*text} and not {name.capitalize() for name in names} & {*text}


def test_laws_lists_every_law_with_a_line() -> None:
    text = jaxdamp("laws").output
    lines = {line.split()[0]: line for line in text.splitlines() if line.strip()}
    assert all(len(lines[name].split()) > 3 for name in identify.LAWS)


# ---- fit


def test_fit_writes_laws_that_load_again(records: Path, tmp_path: Path) -> None:
    out = tmp_path / "fit"
    text = jaxdamp("fit", records, "--law", "linear", "--law", "bilinear", "--verbose", "--out", out).output
    law = from_json(out / "best_law.json")
    assert isinstance(law, Bilinear)
    assert (float(law.rebound_rate), float(law.compression_rate)) == pytest.approx((2600.0, 1200.0), rel=2e-3)
    assert from_json(out / "laws" / "bilinear.json") == law
    assert text.index("  - linear: RMSE ") < text.index("  - bilinear: RMSE ") < text.index("Recommended: bilinear")
    assert text.index("Recommended: bilinear") < text.index("Laws (shape") < text.index("Written to")
    for said in ("Records", "stroke from 'stroke [m]'", "RMSE [N]", "linear", "Recommended: bilinear", "Written to"):
        assert said in text


@pytest.mark.pictures
def test_fit_writes_tables_pictures_and_a_report(records: Path, tmp_path: Path) -> None:
    out, old = tmp_path / "fit", tmp_path / "old.json"
    to_json(Linear(2000.0), old)
    words = ["--law", "linear", "--law", "bilinear", "--held-out", "10mm_4Hz", "--baseline", old]
    jaxdamp("fit", records, *words, "--out", out)
    files = sorted(file.relative_to(out).as_posix() for file in out.rglob("*") if file.is_file())
    assert json.loads((out / "manifest.json").read_text())["files"] == [f for f in files if f != "manifest.json"] + [
        "manifest.json"
    ]
    pictures = [
        "best_law_held_out.png",
        "best_law_loops.png",
        "damper_sheet.png",
        "force_velocity.png",
        "ladder.png",
        "loops_by_law.png",
    ]
    assert [file for file in files if file.endswith(".png")] == pictures
    assert all((out / name).read_bytes().startswith(b"\x89PNG") for name in pictures)
    ladder = _rows(out / "tables" / "ladder.csv")
    assert [row["law"] for row in ladder] == ["linear", "bilinear"]
    assert float(ladder[1]["held-out RMSE [N]"]) == pytest.approx(2.0, rel=0.1)
    assert [row["use"] for row in _rows(out / "tables" / "records.csv")] == ["fitted", "fitted", "held out"]
    assert float(_rows(out / "tables" / "parameters_bilinear.csv")[0]["value"]) == pytest.approx(2600.0, rel=2e-3)
    report = (out / "report.html").read_text(encoding="utf-8")
    assert report.count("data:image/png;base64,") == 6 and "held-out RMSE [N]" in report
    assert "Baseline on the same records: RMSE " in report and f"<pre>jaxdamp fit {records} --law linear" in report


def test_what_the_machine_adds_is_fitted_and_shown(records: Path, tmp_path: Path) -> None:
    out = tmp_path / "fit"
    words = ["--rig", "gas,friction", "--bound", "rig.gas_force=-0.5lbf:0.5 lbf", "--bound", "friction=1N:20N"]
    text = jaxdamp("fit", records, "--law", "bilinear", *words, "--out", out).output
    assert "rig.gas_force" in text and "rig.friction" in text
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "rig.gas_force" in page and "effects of the test machine: gas force" in page
    assert "Taken as absent: " in page and "gas stiffness" in page
    machine = from_json(out / "machines" / "bilinear.json")
    assert abs(float(machine.gas_force)) < 0.5 * 4.4483 and float(machine.force_offset) == 0.0
    assert 1.0 <= float(machine.friction) < 1.1  # none in the records
    bare, copy = tmp_path / "bare", tmp_path / "copy" / "fit.html"
    words = ["--rig", "none", "--out", bare, "--cross-validate", "--report", copy]
    assert "rig." not in jaxdamp("fit", records, "--law", "bilinear", *words).output
    page = copy.read_text(encoding="utf-8")
    assert "No test machine was fitted" in page and "Each record was left out once and predicted by bilinear" in page
    assert "--group-by" in refused(
        tmp_path, "fit", records, "--group-by", "x", "--report", copy, "--out", tmp_path / "n"
    )
    assert not (bare / "machines").exists()
    message = refused(tmp_path, "fit", records, "--law", "bilinear", "--rig", "gas,dellay", "--out", tmp_path / "new")
    assert "Option --rig must be one of" in message and "Did you mean 'delay'" in message


def test_a_cross_validation_is_of_the_same_fit(records: Path, tmp_path: Path) -> None:
    """Whose bounds need not contain the start that the command computes."""
    words = ["--law", "bilinear", "--bound", "rebound_rate=1000:2000", "--cross-validate", "--out", tmp_path / "fit"]
    text = jaxdamp("fit", records, *words).output
    left_out = text.partition("Errors of the held-out records")[2].splitlines()
    errors = [float(line.split()[-1]) for line in left_out if line.strip().startswith("bilinear")]
    assert len(errors) == 3 and min(errors) > 5.0  # without the bound it is the noise, 2 N


def test_one_law_is_fitted_without_a_ladder(records: Path, tmp_path: Path) -> None:
    text = " ".join(jaxdamp("fit", records, "--law", "linear", "--out", tmp_path / "fit").output.split())
    assert "Fitting 1 law to 3 records ... - linear: RMSE " in text and "Records (" not in text  # by --verbose
    assert "Error of linear, held-out fit" in text and "law of velocity alone" in text
    assert not (tmp_path / "fit" / "ladder.png").exists()


def test_what_the_reader_decided_is_printed(lab_file: Path, tmp_path: Path) -> None:
    text = jaxdamp("fit", lab_file, "--law", "bilinear", "--out", tmp_path / "fit").output
    flat = " ".join(text.split())
    assert "force from 'load [kN]' in kN" in flat
    assert "positive stroke taken as rebound: if the bench counts compression positive, pass --sign" in flat
    law = from_json(tmp_path / "fit" / "best_law.json")
    assert isinstance(law, Bilinear) and float(law.rebound_rate) == pytest.approx(1200.0, rel=2e-3)  # taken wrongly


def test_sign_turns_the_records_of_a_bench_that_counts_compression_positive(lab_file: Path, tmp_path: Path) -> None:
    words = ("--law", "bilinear", "--sign", "compression-positive", "--out", tmp_path / "fit")
    text = jaxdamp("fit", lab_file, *words).output
    assert "positive stroke is compression, as given" in " ".join(text.split())
    law = from_json(tmp_path / "fit" / "best_law.json")
    assert isinstance(law, Bilinear)
    assert (float(law.rebound_rate), float(law.compression_rate)) == pytest.approx((2600.0, 1200.0), rel=2e-3)


def test_columns_units_and_sampling_rate_read_a_file_without_header(tmp_path: Path, runs: BenchSet) -> None:
    run = runs[2]
    rows = [f"{1e3 * x};{0.0};{f}" for x, f in zip(run.stroke, run.force, strict=True)]
    path = tmp_path / "bare.txt"
    path.write_text("\n".join(rows) + "\n")
    words = ("--columns", "stroke=0,force=2", "--units", "stroke=mm,force=N", "--sampling-rate", "500")
    jaxdamp("fit", path, "--law", "bilinear", *words, "--delimiter", ";", "--out", tmp_path / "fit")
    law = from_json(tmp_path / "fit" / "best_law.json")
    assert isinstance(law, Bilinear) and float(law.rebound_rate) == pytest.approx(2600.0, rel=5e-3)


def test_laws_may_be_divided_by_commas() -> None:
    assert law_names(["linear, besinger", "bilinear", "linear"]) == ["linear", "besinger", "bilinear"]
    assert law_names(["linear,all"]) == list(identify.LAWS)
    assert law_names(["all,thinned_visco_plastic"]) == [*identify.LAWS, "thinned_visco_plastic"]
    with pytest.raises(ValueError, match="Did you mean 'besinger'"):
        law_names(["linear,besingr"])


def test_records_are_held_out_by_pattern_or_by_file(records: Path, tmp_path: Path) -> None:
    runs = bench.read(records, sign="rebound-positive")
    for word in ("*_4Hz", str(records / "10mm_4Hz.csv"), "10mm_4Hz.csv"):
        assert [run.name for run in split(runs, [word])[1]] == ["10mm_4Hz"]
    jaxdamp("fit", records, "--law", "linear", "--held-out", word, "--out", tmp_path / "fit")
    assert [row["use"] for row in _rows(tmp_path / "fit/tables/records.csv")] == ["fitted", "fitted", "held out"]


# ---- fit: what is refused


def test_a_missing_file_is_named_with_its_neighbours(records: Path, tmp_path: Path) -> None:
    message = refused(tmp_path, "fit", records / "10mm_5Hz.csv", "--law", "linear", "--out", tmp_path / "fit")
    assert "Error: There is no file" in message and "Did you mean" in message


def test_an_unknown_law_gets_a_suggestion(records: Path, tmp_path: Path) -> None:
    message = refused(tmp_path, "fit", records, "--law", "besingr", "--out", tmp_path / "fit")
    assert "Did you mean 'besinger'?" in message


def test_a_missing_unit_is_asked_for(tmp_path: Path, runs: BenchSet) -> None:
    run = runs[0]
    rows = [f"{t},{x},{f}" for t, x, f in zip(run.time, run.stroke, run.force, strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["time [s],stroke,force [N]", *rows]))
    message = refused(tmp_path, "fit", tmp_path / "run.csv", "--law", "linear", "--out", tmp_path / "fit")
    assert "stroke" in message and "unit" in message


def test_a_sign_that_contradicts_the_work_is_refused(lab_file: Path, tmp_path: Path) -> None:
    words = ("--law", "linear", "--force-sign", "opposite", "--out", tmp_path / "fit")
    assert "contradicts the data" in refused(tmp_path, "fit", lab_file, *words)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--sign", "rebound"), "Did you mean 'rebound-positive'?"),
        (("--columns", "strok=x"), "Did you mean 'stroke'?"),
        (("--columns", "stroke"), "--columns must read like stroke=..."),
        (("--units", "stroke=furlong_s"), "furlong_s"),
        (("--weighting", "records"), "Option --weighting must be one of"),
        (("--columns", "stroke=hub"), "--columns stroke=hub: "),
        (("--columns", "stroke=7"), "--columns stroke=7: "),
        (("--sampling-rate", "77"), "--columns time=none leaves out the column"),
        (("--held-out", "20mm_*"), "Option --held-out: No record is called '20mm_*'"),
        (("--held-out", "10mm_*"), "leaves no record to fit"),
        (("--loss", "huber", "--loss=soft_l1"), "Option --loss must be given once, but is given 2 times"),
    ],
)
def test_wrong_options_are_refused(records: Path, tmp_path: Path, words: tuple[str, str], message: str) -> None:
    said = refused(tmp_path, "fit", records, "--law", "linear", *words, "--out", tmp_path / "fit")
    assert message in said


def test_a_folder_of_others_is_refused(records: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep")
    message = refused(tmp_path, "fit", records, "--law", "linear", "--out", tmp_path / "mine")
    assert "not written by jaxdamp" in message and "--replace" in message
    jaxdamp("fit", records, "--law", "linear", "--out", tmp_path / "mine", "--replace")
    assert (tmp_path / "mine" / "notes.txt").read_text() == "keep"
    assert (tmp_path / "mine" / "best_law.json").exists()


def test_results_of_an_earlier_run_are_refused_before_anything_is_read(tmp_path: Path) -> None:
    (tmp_path / "fit").mkdir()
    manifest = {"format": "jaxdamp results", "command": "fit", "complete": True, "files": []}
    (tmp_path / "fit" / "manifest.json").write_text(json.dumps(manifest))
    message = refused(tmp_path, "fit", "no_such_file.csv", "--law", "linear", "--out", tmp_path / "fit")
    assert "holds the results of an earlier run of jaxdamp fit" in message
    assert "--out" in message and "--replace" in message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"force": [' + ", ".join(["0.125"] * 60_000) + "]}", "looks like JSON"),
        ("<html>\n<td>1</td></html>", "looks like HTML"),
        ("t_s,F_N\n" + "0,1\n" * 30, "no column for the stroke: its columns are 't_s', 'F_N', all of them other"),
        ("t_s,a,F_N\n" + "0,1,2\n" * 30, "Name it, for example --columns stroke=a."),
        ("t_s,stroke,F_N\n" + "0,1,2\n" * 30, "for example --units stroke=mm,"),
        (
            "x_mm,F_N\n" + "0,1\n1,3\n" * 30,
            "for example --sampling-rate 1000 [Hz], or name the column with --columns time=...",
        ),
        ("0,1,2\n" * 30, "--columns time=0,stroke=1,force=2, --units time=s,stroke=mm,force=N"),
    ],
)
def test_errors_of_the_reader_speak_of_options(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "run.csv").write_text(text)
    said = refused(tmp_path, "fit", tmp_path / "run.csv", "--law", "linear", "--out", tmp_path / "fit")
    assert message in said and "={" not in said


def test_debug_shows_where_an_error_comes_from(records: Path, tmp_path: Path) -> None:
    words = ["fit", str(records), "--law", "besingr", "--out", str(tmp_path / "fit"), "--debug"]
    assert isinstance(CliRunner().invoke(app, words).exception, ValueError)


def test_a_manifest_gains_and_files_left_out(tmp_path: Path, runs: BenchSet) -> None:
    folder = tmp_path / "lab"
    folder.mkdir()
    for index, run in enumerate(runs):
        rows = [f"{t},{100 * x},{f / 500}" for t, x, f in zip(run.time, run.stroke, run.force, strict=True)]
        (folder / f"{index}mm.csv").write_text("\n".join(["t_s,x [V],F [V]", *rows]))
    (folder / "broken.csv").write_text("nothing here\n")
    words = ("fit", folder, "--law", "linear", "--out", tmp_path / "fit")
    said = refused(tmp_path, *words)
    assert "3 problems" in said and "--gains 'force=500 N/V'" in said and "broken.csv holds no rows" in said
    (tmp_path / "bench.toml").write_text('sign = "rebound-positive"\n[gains]\nforce = "500 N/V"\n')
    options = ("--manifest", tmp_path / "bench.toml", "--gains", "stroke=10 mm/V", "--skip-bad")
    said = " ".join(jaxdamp(*words, *options).output.split())
    assert f"read as the manifest {tmp_path / 'bench.toml'} says (all records)" in said
    assert f"left out: {folder / 'broken.csv'} holds no rows of numbers" in said
    assert len(_rows(tmp_path / "fit" / "tables" / "records.csv")) == 3


def test_a_file_that_cannot_be_opened_is_left_out_like_others(
    lab_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also while its sum is noted for --resume."""
    (tmp_path / "locked.csv").write_text(lab_file.read_text())
    opened = Path.open

    def locked(path: Path, *words: Any, **options: Any) -> Any:
        if path.name == "locked.csv":
            raise PermissionError(13, "Permission denied", str(path))
        return opened(path, *words, **options)

    monkeypatch.setattr(Path, "open", locked)
    words = "fit", tmp_path, "--sign", "compression-positive", "--law", "linear", "--out", tmp_path / "out"
    assert "locked.csv' cannot be opened (Permission denied)" in refused(tmp_path, *words)
    assert "left out" in jaxdamp(*words, "--skip-bad").output
