"""`jaxdamp tune` and `jaxdamp sweep`: results in a folder, vehicles from files, refusals that leave nothing behind."""

import csv
import json
from pathlib import Path
from typing import Any

import equinox as eqx
import numpy as np
import pytest

from jaxdamp import vehicles
from jaxdamp._words import said
from jaxdamp.cli.controlling import parse_policy
from jaxdamp.cli.options import Call
from jaxdamp.cli.tuning import _limits
from jaxdamp.cli.vehicle_words import parse_vehicle
from jaxdamp.control import Skyhook
from jaxdamp.dampers import Bilinear, Linear, Scheduled
from jaxdamp.export import from_json, to_json

from .invoking import jaxdamp, refused


FRONT = "rms_front_dynamic_tyre_load"
BEST = 60e3 * (1325.0 / 220e3) ** 0.5


@pytest.fixture
def law(tmp_path: Path) -> Path:
    to_json(Linear(2000.0), tmp_path / "law.json")
    return tmp_path / "law.json"


def _toml(folder: Path, text: str) -> Path:
    (folder / "car.toml").write_text(text)
    return folder / "car.toml"


def test_tune_writes_a_better_law(law: Path, tmp_path: Path) -> None:
    out = tmp_path / "tuned"
    words = [
        "--law",
        law,
        "--minimise",
        "rms_sprung_acceleration",
        "--limit",
        "grip=1400,travel=0.02",
        "--baseline",
        law,
    ]
    text = jaxdamp("tune", "quarter_car_000", "white:C", *words, "--out", out).output
    assert "an optimum" in text
    assert float(from_json(out / "law.json").rate) == pytest.approx(BEST, rel=1e-4)
    assert float(from_json(out / "vehicle.json").damper.rate) == pytest.approx(BEST, rel=1e-4)
    rows = {row["metric"]: row for row in csv.DictReader((out / "metrics.csv").read_text().splitlines())}
    assert rows["rms_dynamic_tyre_load"]["note"] == "limit 1400 N" and float(rows["working_space_rms"]["after"]) < 0.02
    assert "the change is from the baseline to the tuned vehicle" in (out / "report.html").read_text()
    assert json.loads((out / "tuning.json").read_text())["converged"] is True
    assert {file.name for file in out.iterdir()} == {
        "law.json", "vehicle.json", "parameters.csv", "metrics.csv", "tuning.json", "tuning.png", "report.html",
        "baseline_damper.png", "manifest.json", "ride_sheet.png", "ride_sheet.pdf",
    }  # fmt: skip


@pytest.mark.slow
def test_the_numbers_of_a_controller_are_tuned_and_written_for_a_ride(tmp_path: Path) -> None:
    car = vehicles.presets.quarter_car_000(Scheduled((Linear(900.0), Linear(6e3)), levels=[0.0, 1.0], command=0.2))
    to_json(car, tmp_path / "car.json")
    words = ["--controller", "skyhook:gain=2500", "--actuator-lag", "0.003", "--limit", "grip=none", "--max-steps", "2"]
    out = tmp_path / "tuned"
    words += ["--over", "policy.gain", "--duration", "2"]
    text = jaxdamp("tune", tmp_path / "car.json", "bump:0.05:5", *words, "--out", out).output
    assert "policy.gain" in text
    rows = {row["metric"]: row for row in csv.DictReader((out / "metrics.csv").read_text().splitlines())}
    weighted = rows["weighted_rms_sprung_acceleration"]
    assert float(weighted["after"]) < float(weighted["before"])
    tuned, policy = from_json(out / "vehicle.json"), parse_policy(str(out / "controller.json"), car)
    assert isinstance(policy, Skyhook) and float(policy.gain) == float(tuned.policy.gain) > 2500.0
    assert float(policy.lead) == 0.0 and float(tuned.actuator_lag) == 0.003
    assert bool(eqx.tree_equal(tuned.car, car))  # the policy alone is tuned
    message = refused(tmp_path, "tune", tmp_path / "car.json", "iso:C", "--controller", "modal-skyhook:gain=1")
    assert "must be one of 'heave', 'pitch', 'roll'" in message
    plain = refused(tmp_path, "tune", "quarter_car_000", "iso:C", "--controller", "skyhook")
    assert "set the command of a damper that takes one, but is skyhook beside Linear" in plain


@pytest.mark.slow
def test_limits_in_the_units_of_a_shop_are_those_in_si(tmp_path: Path) -> None:
    """Also within a range, and printed back in the units that are shown; bounds of parameters too."""
    words = ["tune", "quarter_car_000", "white:C", "--max-steps", "1", "--fresh-roads", "0"]
    shop = ["--limit", "travel=0.5mm:2in,grip=400 lbf", "--limit", "comfort=0.1g"]
    shop += ["--bound", "damper.rate=5lbf s/in:25 lbf s/in"]
    output = jaxdamp(*words, *shop, "--show-units", "imperial", "--verbose", "--out", tmp_path / "shop").output
    si = [
        "--limit",
        "travel=0.0005:0.0508,grip=1779.2886460902,comfort=0.980665",
        "--bound",
        "rate=875.634176:4378.17088",
    ]
    jaxdamp(*words, *si, "--out", tmp_path / "si")
    assert "Limit of travel: 0.01969 to 2 in" in output and "Limit of grip: 400 lbf" in output
    assert "limit 400 lbf" in output and "limits 0.01969 to 2 in" in output
    written = [json.loads((tmp_path / name / "tuning.json").read_text()) for name in ("shop", "si")]
    ends = [np.hstack([limit["value"] for limit in each["limits"].values()]).astype(float) for each in written]
    np.testing.assert_allclose(*ends, rtol=1e-9)
    (shop,), (si,) = (each["parameters"] for each in written)
    np.testing.assert_allclose([shop["lower"], shop["upper"]], [si["lower"], si["upper"]], rtol=1e-8)


def test_a_limit_that_is_not_met_ends_with_an_exit_code(tmp_path: Path) -> None:
    words = ["--limit", "travel=0.001", "--out", tmp_path / "tuned"]
    assert "is not met" in jaxdamp("tune", "quarter_car_000", "white:C", *words, code=1).output


def test_sweep_of_a_vehicle_from_a_file_writes_a_table_and_pictures(law: Path, tmp_path: Path) -> None:
    to_json(vehicles.presets.half_car_002(), tmp_path / "car.json")
    words = [
        "--over",
        "front.damper.rate=1000:2000:2",
        "--over",
        "rear.damper.rate=0.8 N s/mm;1.6 N s/mm",
        "--metric",
        "comfort",
    ]
    words += ["--limit", "travel=0.076,grip=550", "--baseline", law]
    out = tmp_path / "swept"
    words += ["--duration", "1.5", "--dt", "2e-3"]
    text = " ".join(jaxdamp("sweep", tmp_path / "car.json", "bump:0.05:4", *words, "--out", out).output.split())
    rows = list(csv.DictReader((out / "sweep.csv").read_text().splitlines()))
    assert len(rows) == 4 and "weighted_rms_sprung_acceleration [m/s²]" in rows[0]
    largest = (("working_space", 0.076), ("tyre_load", 550.0))
    assert {float(row["rear.damper.rate [N s/m]"]) for row in rows} == {800.0, 1600.0}
    limits = {name: most for word, most in largest for name in rows[0] if word in name}
    within = [row for row in rows if all(float(row[name]) <= most for name, most in limits.items())]
    assert len(limits) == 4 and 0 < len(within) < 4
    assert [row["limits"] for row in rows] == ["met" if row in within else "not met" for row in rows]
    page, comfort = (out / "report.html").read_text(), "weighted_rms_sprung_acceleration [m/s²]"
    sentence = f"{len(within)} of 4 points are within all limits; smallest body acceleration, weighted RMS: "
    best = min(within, key=lambda row: float(row[comfort]))
    place = f"front damper rate = {float(best['front.damper.rate [N s/m]']):g} N s/m"
    sentence += f"{float(best[comfort]):.4g} m/s² at {place}"
    assert said(sentence) in page and sentence in text
    assert "% from the baseline" in page
    assert (out / "weighted_rms_sprung_acceleration.png").is_file() and (out / "sweep.nc").is_file()


def test_vehicles_from_files_take_a_law(tmp_path: Path) -> None:
    file = _toml(tmp_path, 'preset = "half_car_002"\n[parameters]\nsprung_mass = 600.0\nfront.spring_rate = 2e4\n')
    car: Any = parse_vehicle(str(file))(Bilinear(2000.0, 1000.0))
    assert float(car.sprung_mass) == 600.0 and float(car.front.spring_rate) == 2e4
    assert isinstance(car.rear.damper, Bilinear)
    to_json(car, tmp_path / "car.json")
    again: Any = parse_vehicle(str(tmp_path / "car.json"))
    assert isinstance(again(None).front.damper, Bilinear)
    assert all(isinstance(corner.damper, Linear) for corner in (again(Linear(1.0)).front, again(Linear(1.0)).rear))


def test_words_for_metrics() -> None:
    car = vehicles.presets.full_car_jazar()
    assert car.goal_metrics("comfort") == ["weighted_rms_sprung_acceleration"]
    assert len(car.goal_metrics("travel")) == 4 and len(car.goal_metrics("grip")) == 4


WRONG = [
    (["tune", "quarter_car_00", "white:C"], "Did you mean 'quarter_car_000'?"),
    (["tune", "car.json", "white:C"], "VEHICLE must be a file that is there"),
    (["tune", "CSV", "white:C"], "VEHICLE must be one of"),
    (["ride", "quarter_car"], "VEHICLE must be one of"),
    (["ride", "LAW"], "a law is put into one with --law."),
    (["ride", "quarter_car_000", "--law", "CSV"], "Option --law must be a law as JSON, but is {CSV}"),
    (["ride", "none.json"], "VEHICLE must be a file that is there, but is none.json"),
    (["ride", "quarter_car_000", "--baseline", "CSV"], "Option --baseline must be a law or a vehicle as"),
    (["tune", "quarter_car_000", "white:C", "--law", "CSV"], "`jaxdamp fit` writes best_law.json"),
    (["tune", "quarter_car_000", "white:C", "--law", "CAR"], "Option --law must be a law as JSON, but is a Quart"),
    (["tune", "quarter_car_000", "white:C", "--baseline", "CSV"], "Option --baseline must be a law or a vehicle as"),
    (["export", "CSV", "--to", "c"], "LAW must be a law or a vehicle as JSON, but is {CSV}"),
    (["tune", "LAW", "white:C"], "VEHICLE must be a vehicle as JSON, but is a Linear"),
    (["tune", "BAD", "white:C"], "VEHICLE must be TOML, but is {BAD}"),
    (["tune", "ODD", "white:C"], "be a TOML file of preset, tyre_lifts (true or false) and [parameters]"),
    (["tune", "LIFTS", "white:C"], "but is one of preset = 'quarter_car_000', tyre_lifts = 1"),
    (["tune", "TRUE", "white:C"], "`sprung_mass` must be a number, but is True"),
    (["tune", "UNKNOWN", "white:C"], "must be one of"),
    (["tune", "WRONG", "white:C"], "did you mean 'sprung_mass'"),
    (["tune", "NEGATIVE", "white:C"], "must be positive"),
    (["tune", "quarter_car_000", "white:K"], "must be one of 'A'"),
    (["tune", "quarter_car_000", "grey:C"], "ROAD must be iso:CLASS"),
    (["tune", "quarter_car_000", "bump:3"], "bump:HEIGHT:LENGTH"),
    (["tune", "quarter_car_000", "white:C", "--law", "none.json"], "Option --law must be a file that is there"),
    (["tune", "quarter_car_000", "white:C", "--minimise", "confort"], "Did you mean 'comfort'?"),
    (["tune", "quarter_car_000", "white:C", "--limit", "travel"], "Option --limit must read like NAME=VALUE"),
    (["tune", "quarter_car_000", "white:C", "--limit", "trawel=0.1"], "Did you mean 'travel'?"),
    (["tune", "quarter_car_000", "white:C", "--limit", "travel=low"], "Option --limit must be a number, or two"),
    (["tune", "quarter_car_000", "white:C", "--limit", "travel=2:1"], "in increasing order"),
    (["tune", "quarter_car_000", "white:C", "--limit", "travel=4lbf"], "must be in a unit of travel, such as m, but"),
    (["tune", "quarter_car_000", "white:C", "--limit", "travel=2:4in"], "each with its unit or both in SI"),
    (["tune", "quarter_car_000", "white:C", "--limit", "travel=1,travel=2"], "name each thing once"),
    (
        ["sweep", "half_car_002", "white:C", "--over", "rate=1;2", "--limit", "grip=1,rms_front_dynamic_tyre_load=2"],
        "Option --limit must limit each metric once",
    ),
    (["tune", "quarter_car_000", "white:C", "--over", "damper.rat"], "did you mean 'damper.rate'"),
    (["tune", "quarter_car_000", "white:C", "--bound", "rate"], "Option --bound must read like NAME=VALUE"),
    (["tune", "quarter_car_000", "white:C", "--bound", "rate=5lbf:9lbf"], "must be in a unit of rate, such as N s/m"),
    (["tune", "quarter_car_000", "white:C", "--bound", "rat=5lbf:9lbf"], "did you mean 'rate'"),
    (["tune", "quarter_car_000", "white:C", "--bound", "rate=5:9N s/m"], "each with its unit or both in SI"),
    (
        ["sweep", "quarter_car_000", "white:C", "--over", "rate=1;2", "--metric", "peak_damper_velocity"],
        "Option --metric must follow from an RMS on a white road",
    ),
    (["tune", "quarter_car_000", "white:C", "--minimise", "speed"], "Option --minimise must be one of"),
    (["tune", "quarter_car_000", "white:C", "--bound", "rate=3000:4000"], "must start between 3000 and 4000"),
    (["tune", "quarter_car_000", "white:C", "--bound", "sprung_mass=1:2"], "bound a parameter that is free"),
    (["tune", "quarter_car_000", "white:C", "--freeze", "*"], "nothing is left to change"),
    (["tune", "quarter_car_000", "white:C", "--tie", "damper.rate"], "Option --tie must read like NAME=VALUE"),
    (["tune", "quarter_car_000", "white:C", "--starts", "0"], "Option --starts must be 1 or more"),
    (["tune", "quarter_car_000", "white:C", "--max-steps", "0"], "Option --max-steps must be 1 or more"),
    (["tune", "quarter_car_000", "white:C", "--roads", "0"], "Option --roads must be 1 or more"),
    (["tune", "quarter_car_000", "white:C", "--roads", "2"], "Option --roads must be 1 for a road that is not random"),
    (["tune", "quarter_car_000", "white:C", "--speed", "-1"], "Option --speed must be positive"),
    (["tune", "quarter_car_000", "white:C", "--duration", "3"], "Option --duration must be left out on a white road"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1:2"], "NAME=FIRST:LAST:COUNT"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1:2:x"], "NAME=FIRST:LAST:COUNT"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1:2:0"], "have one value or more"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1;1"], "--over of 'rate' must have each value once"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1;2", "--command", "3"], "must be left out beside a law"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1 N s/m;2"], "each with its unit or all in SI"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1mm;2mm"], "in a unit of rate, such as N s/m"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rat=1;2"], "did you mean 'rate'"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1;2", "--metric", "confort"], "Did you mean 'comfort'?"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1;2", "--limit", "trawel=1"], "Did you mean 'travel'?"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1;2", "--limit", "grip=1in"], "in a unit of grip"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1;2", "--limit", "grip"], "must read like NAME=VALUE"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1;2", "--limit", "grip=2:1"], "in increasing order"),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1;2", "--block", "0/200"], "but is '0/200'. Number the"),
    (
        ["sweep", "quarter_car_000", "white:C", "--over", "rate=1;2", "--block", "201/200"],
        "parts from 1: in an array job",
    ),
    (["sweep", "quarter_car_000", "white:C", "--over", "rate=1;2", "--block", "a/b"], "--block must be a part such as"),
]
FILES = {
    "BAD": "preset = ",
    "ODD": 'prset = "quarter_car_000"',
    "UNKNOWN": 'preset = "quarter_car_0"',
    "WRONG": 'preset = "quarter_car_000"\n[parameters]\nsprung_mas = 1.0',
    "LIFTS": 'preset = "quarter_car_000"\ntyre_lifts = 1',
    "TRUE": 'preset = "quarter_car_000"\n[parameters]\nsprung_mass = true',
    "NEGATIVE": 'preset = "quarter_car_000"\n[parameters]\nsprung_mass = -1.0',
}


def test_a_limit_on_one_wheel_leaves_that_of_the_others() -> None:
    car, search = vehicles.presets.half_car_002(), Call("tune.minimise", {"limits": {FRONT: "+5%"}})
    limits, (remark,) = _limits(car, "comfort", search, white=False)
    assert limits == {FRONT: "+5%", "rms_rear_dynamic_tyre_load": "+10%"}
    assert "of the other tyre loads, rms_rear_dynamic_tyre_load) to +10%" in remark
    both = {FRONT: "+5%", "grip": None}
    for given, expected in (
        ({}, {"grip": "+10%"}),
        ({"grip": None}, {}),
        ({"grip": "+3%"}, {"grip": "+3%"}),
        (both, {FRONT: "+5%"}),
    ):
        assert _limits(car, "comfort", Call("tune.minimise", {"limits": given}), white=False)[0] == expected


def _tied(folder: Path) -> list:
    to_json(Bilinear(2600.0, 1200.0), folder / "law.json")
    return ["white:C", "--law", folder / "law.json", "--tie", "damper.compression_rate=damper.rebound_rate"]


def test_parameters_that_differ_are_not_tied(tmp_path: Path) -> None:
    remedy = "with damper.compression_rate = NUMBER below [parameters] of VEHICLE.toml."
    assert remedy in refused(tmp_path, "tune", "quarter_car_000", *_tied(tmp_path))


@pytest.mark.slow
def test_parameters_are_tied_after_a_vehicle_file_sets_them_equal(tmp_path: Path) -> None:
    file = _toml(tmp_path, 'preset = "quarter_car_000"\n[parameters]\ndamper.compression_rate = 2600.0\n')
    jaxdamp("tune", file, *_tied(tmp_path), "--limit", "grip=none", "--out", tmp_path / "tuned")
    law = from_json(tmp_path / "tuned" / "law.json")
    assert float(law.compression_rate) == float(law.rebound_rate) > 2600.0


@pytest.mark.parametrize(("words", "message"), WRONG, ids=[" ".join(words[1:]) for words, _ in WRONG])
def test_wrong_words_are_refused(law: Path, tmp_path: Path, words: list[str], message: str) -> None:
    files = {"LAW": law} | {word: _toml(tmp_path, FILES[word]) for word in words if word in FILES}
    if "CSV" in words:
        files["CSV"] = tmp_path / "law.csv"
        files["CSV"].write_text("velocity [m/s],force [N]\n0,1\n")
    if "CAR" in words:
        files["CAR"] = tmp_path / "car.json"
        to_json(vehicles.presets.quarter_car_000(), files["CAR"])
    message = message.format_map({word: str(file) for word, file in files.items()})
    place = "--file" if words[0] == "export" else "--out"
    assert message in refused(tmp_path, *(files.get(word, word) for word in words), place, tmp_path / "out")
