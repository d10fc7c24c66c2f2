"""`jaxdamp fit-vehicle`: from files with other people's names, units and signs to a vehicle with its uncertainty."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jaxdamp import bench, identify, roads, vehicles
from jaxdamp.bench import RideRecord
from jaxdamp.cli import offers
from jaxdamp.dampers import Bilinear, CoulombFriction
from jaxdamp.export import from_json, to_json
from jaxdamp.rig import Sensor

from .invoking import jaxdamp, refused


CAR = vehicles.QuarterCar(300.0, 40.0, 20e3, 180e3, Bilinear(1800.0, 900.0))
NOISE = {"sprung_acceleration": 0.05, "stroke": 1e-4}
SENSORS = {"stroke": Sensor(offset=1.5e-3)}
COLUMNS = [
    "--columns",
    "time=t,sprung_acceleration=acc body,stroke=LVDT, FL",
    "--road",
    "pad FL",
    "--reversed",
    "stroke",
]
FREE = ["--over", "unsprung_mass,spring_rate,tyre_stiffness,damper.*_rate", "--sensor", "stroke:offset"]
COARSE = ["--dt", "4e-3"]


def _as_a_lab_writes_it(record: RideRecord, file: Path) -> None:
    """In mm and g, with the travel positive in compression."""
    columns = [record.time, 1e3 * record.road[:, 0], record["sprung_acceleration"] / 9.80665, -1e3 * record["stroke"]]
    head = "t [s];pad FL [mm];acc body [g];LVDT, FL [mm]"
    np.savetxt(file, np.column_stack(columns), fmt="%.9g", delimiter=";", header=head, comments="")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The start, as TOML with a law; a sweep as another lab writes it."""
    folder = tmp_path_factory.mktemp("vehicle")
    sweep = roads.sweep_sine(0.7, 12.0, duration=3.0, velocity_amplitude=0.15)
    how: dict[str, Any] = {"sensors": SENSORS, "sampling_rate": 250.0, "finer": 4}
    on_pads = identify.virtual_ride(CAR, sweep, NOISE, name="sweep", **how)
    _as_a_lab_writes_it(on_pads, folder / "lab.csv")
    (folder / "car.toml").write_text(
        'preset = "quarter_car_mathworks"\n[parameters]\nsprung_mass = 300.0\nspring_rate = 18e3\n'
    )
    to_json(Bilinear(1400.0, 1200.0), folder / "law.json")
    return {file.name: file for file in folder.iterdir()}


@pytest.fixture(scope="module")
def fitted(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of a fit of the sweep, and what the command said."""
    out = tmp_path_factory.mktemp("fitted") / "out"
    words = ["--law", files["law.json"], *COLUMNS, *FREE, *COARSE, "--out", out, "--report", out.parent / "page.html"]
    return out, jaxdamp("fit-vehicle", files["car.toml"], files["lab.csv"], *words).output


@pytest.mark.slow
def test_a_file_of_another_lab_gives_the_vehicle(fitted: tuple[Path, str]) -> None:
    out, text = fitted
    car = from_json(out / "vehicle.json")
    found = [
        float(a) for a in (car.unsprung_mass, car.spring_rate, car.damper.rebound_rate, car.damper.compression_rate)
    ]
    assert found == pytest.approx([40.0, 20e3, 1800.0, 900.0], rel=0.02) and float(car.sprung_mass) == 300.0
    assert float(from_json(out / "law.json").rebound_rate) == float(car.damper.rebound_rate)
    rows = {row["parameter"]: row for row in csv.DictReader((out / "parameters.csv").read_text().splitlines())}
    offset = rows["sensors.stroke.offset"]
    assert offset["unit"] == "m" and float(offset["value"]) == pytest.approx(
        1.5e-3, abs=4 * float(offset["standard error"])
    )
    assert json.loads((out / "fit.json").read_text())["converged"] is True
    assert "QuarterCar fitted to 1 drive: the least fit is " in " ".join(text.split())
    assert "standard error" in text and "could not be made" not in text
    assert {file.name for file in out.iterdir()} == {
        "vehicle.json", "law.json", "parameters.csv", "channels.csv", "lab_fitted.csv", "fit.json", "channels.png",
        "report.html", "manifest.json",
    }  # fmt: skip
    both = np.genfromtxt(out / "lab_fitted.csv", delimiter=",", skip_header=1)
    assert np.std(both[:, 3] - both[:, 4]) == pytest.approx(NOISE["stroke"], rel=0.1)


def test_the_page_is_one_file_with_everything_in_plain_words(fitted: tuple[Path, str]) -> None:
    out, _ = fitted
    page = (out / "report.html").read_text(encoding="utf-8")
    assert (out.parent / "page.html").read_text(encoding="utf-8") == page
    headings = ["Warnings", "Parameters", "How well the channels are explained", "Records"]
    places = [page.index(f">{heading}</h2>") for heading in headings]
    assert places == sorted(places) and page.count("data:image/png") == 1
    for text in ("95 % from", "vertical tyre stiffness", "None: the search converged", "the least fit is"):
        assert text in page


def test_a_second_run_replaces_nothing_unasked(files: dict[str, Path], fitted: tuple[Path, str]) -> None:
    out, _ = fitted
    call = ["fit-vehicle", files["car.toml"], files["lab.csv"], *COLUMNS]
    assert "earlier run of jaxdamp fit-vehicle" in refused(out.parent, *call, "--out", out)
    page = ["--out", out.parent / "new", "--report", out.parent / "page.html"]
    assert "name another file with --report, or pass --replace" in refused(out.parent, *call, *page)


@pytest.mark.exhaustive
def test_bench_records_guides_and_two_records_in_one_fit(files: dict[str, Path], tmp_path: Path) -> None:
    rig = vehicles.Guided(CAR, (vehicles.Guide(CoulombFriction(40.0, 0.01)),))
    sweep = roads.sweep_sine(0.7, 12.0, duration=3.0, velocity_amplitude=0.15)
    names = {"a": 250.0, "b": 200.0}
    for name, rate in names.items():
        made = identify.virtual_ride(rig, sweep, NOISE, name=name, sampling_rate=rate, finer=4)
        made.to_csv(tmp_path / f"{name}.csv")
    dyno = bench.VirtualDyno(CAR.damper, force_noise=10.0, gas_force=-80.0, sampling_rate=200.0)
    dyno.run([bench.SineTest(0.02, 1.0), bench.SineTest(0.02, 3.0)]).write(tmp_path / "bench")
    out = tmp_path / "out"
    words = ["--law", files["law.json"], "--guide", "sprung:friction=25", "--bench", tmp_path / "bench"]
    words += [
        "--rig",
        "gas",
        "--bound",
        "rig.gas_force=-100 lbf:-1 lbf",
        "--over",
        "*_mass,spring_rate,tyre_stiffness,damper.*_rate",
        *COARSE,
        "--out",
        out,
    ]
    records = [tmp_path / f"{name}.csv" for name in names]
    text = jaxdamp("fit-vehicle", files["car.toml"], *records, *words, "--verbose").output
    found = {r["parameter"]: r for r in csv.DictReader((out / "parameters.csv").read_text().splitlines())}
    true = {"vehicle.car.sprung_mass": 300.0, "vehicle.guides.0.law.friction_force": 40.0, "rig.gas_force": -80.0}
    for name, value in true.items():
        assert abs(float(found[name]["value"]) - value) < 4 * float(found[name]["standard error"]), name
    assert not [name for name in found if ("stiffness" in name and "guides" in name) or "velocity" in name]
    assert "car.damper force" in text and (out / "car_damper_force_velocity.png").is_file()


@pytest.mark.slow
def test_forms_of_friction_are_compared_and_the_recommended_vehicle_is_written(
    files: dict[str, Path], tmp_path: Path
) -> None:
    rig = vehicles.Guided(CAR, (vehicles.Guide(CoulombFriction(40.0, 0.01)),))
    for seed in (0, 1):
        how = {"duration": 3.0, "sampling_rate": 250.0, "finer": 4, "name": f"drive {seed}"}
        road = roads.iso8608("C", speed=20.0, seed=seed)
        identify.virtual_ride(rig, road, NOISE, **how).to_csv(tmp_path / f"{seed}.csv")
    words = ["--law", files["law.json"], "--guide", "sprung:friction=25", "--friction", "none,coulomb"]
    free = "unsprung_mass,spring_rate,tyre_stiffness,damper.*_rate"
    words += ["--dt", "2e-3", "--over", free, "--out", tmp_path / "out"]
    shown = jaxdamp("fit-vehicle", files["car.toml"], tmp_path / "0.csv", tmp_path / "1.csv", *words).output
    text = " ".join(shown.split())  # lines are as long as the terminal is wide
    assert "Recommended: coulomb" in text and "each of 2 drives predicted by fits without it" in text
    told = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert told["best"] == "coulomb" and list(told["vehicles"]) == ["none", "coulomb"]
    car = from_json(tmp_path / "out" / "vehicle.json")
    assert float(car.guides[0].law.friction_force) == pytest.approx(40.0, rel=0.05)
    assert from_json(tmp_path / "out" / "vehicles" / "none.json").guides[0].law is None
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.index("How good the vehicles are") < page.index("The recommended vehicle: coulomb")


WRONG = [
    (["--sensor", "stroke"], "Option --sensor must read like NAME:NUMBER=START"),
    (["--sensor", "strok:offset"], "Did you mean 'stroke'?"),
    (["--sensor", "stroke:ofset"], "Did you mean 'offset'?"),
    (["--sensor", "stroke:offset=x"], "give a number for offset"),
    (["--sensor", "stroke:high_pass"], "give a number for high_pass"),
    (["--guide", "sprung:friction"], "give a number for friction"),
    (["--guide", "body:friction=40"], "Option --guide must be one of 'sprung', 'unsprung'"),
    (["--friction", "dhal"], "Did you mean 'dahl'?"),
    (["--over", "sprin_rate"], "did you mean 'spring_rate'"),
    (["--noise", "stroke=small"], "Option --noise must be numbers"),
    (["--initial-motion", "moving"], "Option --initial-motion must be one of 'rest', 'free'"),
    (["--settling", "9"], "Option --settling must leave at least half of every record"),
    (["--per-record", "sprung_mass"], "Option --per-record must name single numbers"),
    (["--rig", "gas"], "Option --rig must come with bench records"),
    (["--rig", "gaz"], "Did you mean 'gas'?"),
    (["--bench", "none.csv"], "none.csv"),
    (["--units", "strok=mm"], "Did you mean 'stroke'?"),
    (["--columns", "strok=LVDT, FL,time=t"], "A channel of --units or --reversed must be one of 'strok'"),
    (["--columns", "stroke=LVDT,time=t"], "Did you mean 'LVDT, FL'?"),
    (["--road", "pad"], "Did you mean 'pad FL'?"),
    (["--dt", "0"], "Option --dt must be positive"),
]


@pytest.mark.parametrize(("words", "message"), WRONG, ids=[" ".join(words) for words, _ in WRONG])
def test_wrong_words_are_refused(files: dict[str, Path], tmp_path: Path, words: list[str], message: str) -> None:
    given = [
        word
        for option, word in zip(COLUMNS[::2], COLUMNS[1::2], strict=True)
        if option not in words
        for word in (option, word)
    ]
    call = ["fit-vehicle", files["car.toml"], files["lab.csv"], *given, *words, "--out", tmp_path / "out"]
    assert message in refused(tmp_path, *call)


def test_names_with_commas_are_headers_of_any_channel() -> None:
    assert offers.WRITTEN["columns"].read("columns", ["stroke=LVDT, FL,front.stroke = 3"]) == {
        "stroke": "LVDT, FL",
        "front.stroke": 3,
    }
