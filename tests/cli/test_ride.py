"""`jaxdamp ride`: metrics beside a baseline, pictures, refusals that leave nothing behind."""

import csv
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from jaxdamp import roads, simulate, vehicles
from jaxdamp._traced import equal
from jaxdamp.cli.application import own_words
from jaxdamp.cli.controlling import parse_policy
from jaxdamp.cli.jobs import with_step_warnings
from jaxdamp.cli.riding import Driving, parse_road
from jaxdamp.cli.vehicle_words import parse_vehicle, presets, read_baseline, read_law
from jaxdamp.cli.wording import in_command_line
from jaxdamp.control import Controlled, Skyhook
from jaxdamp.dampers import AbstractDamper, Bilinear, Linear, Scheduled
from jaxdamp.export import from_json, to_json
from jaxdamp.parameters import replace

from .invoking import jaxdamp, refused


@pytest.fixture
def law(tmp_path: Path) -> Path:
    return _written(Bilinear(2600.0, 1200.0), tmp_path / "law.json")


def _written(law: AbstractDamper, path: Path) -> Path:
    to_json(law, path)
    return path


def test_ride_compares_a_law_with_a_baseline(law: Path, tmp_path: Path) -> None:
    base, out = _written(Linear(1500.0), tmp_path / "base.json"), tmp_path / "ride"
    words = ["--speed", "57.6km/h", "--duration", "2 s", "--dt", "2ms", "--verbose", "--out", out]
    text = jaxdamp("ride", "half_car_002", "bump:0.05:4", "--law", law, "--baseline", base, *words).output
    assert "Axles: rear axle 0.156 s behind the front (2.5 m at 16 m/s)." in text
    assert "rear axle 0.156 s" in (out / "report.html").read_text()
    assert "rms_pitch_acceleration" in text and "baseline" in text and "Comfort by ISO 2631-1" in text
    rows = {row["metric"]: row for row in csv.DictReader((out / "metrics.csv").read_text().splitlines())}
    car = vehicles.presets.half_car_002(Bilinear(2600.0, 1200.0))
    bump = roads.cosine_bump(0.05, start=1.0, length=4.0, speed=16.0)
    road = roads.delayed(bump, positions=car.axle_positions, speed=16.0)
    expected = simulate(car, road, duration=2.0, dt=0.002).metrics()
    row = rows["front_working_space_peak_to_peak"]
    assert float(row["law"]) == pytest.approx(float(expected["front_working_space_peak_to_peak"]), rel=1e-9)
    assert float(row["change [%]"]) == pytest.approx(100 * (float(row["law"]) / float(row["baseline"]) - 1))
    pictures = {"ride_sheet.png", "ride_sheet.pdf", "ride.png", "front_damper.png", "rear_damper.png"}
    tables = {"metrics.csv", "comfort.csv", "channels_law.csv", "channels_baseline.csv"}
    files = {file.name for file in out.iterdir()}
    assert files == pictures | tables | {"law.json", "baseline.json", "report.html", "animation.html", "manifest.json"}
    assert (out / "law.json").read_text() == law.read_text()


def test_a_ride_says_at_which_command_its_dampers_are(law: Path, tmp_path: Path) -> None:
    clicks = Scheduled((Linear(900.0), Linear(1500.0)), levels=[2.0, 10.0], command=2.0)
    words = ["ride", "quarter_car_000", "bump:0.05:4", "--duration", "1", "--out", tmp_path / "ride", "--command"]
    start = ["--law", _written(clicks, tmp_path / "clicks.json")]
    assert "law: at command 6 of 2 to 10." in jaxdamp(*words, "6", *start).output
    assert "at command 6 of 2 to 10" in (tmp_path / "ride" / "report.html").read_text()
    assert float(from_json(tmp_path / "ride" / "law.json").command) == 6.0
    heading, *_, last = (tmp_path / "ride" / "channels_law.csv").read_text().splitlines()
    assert heading.startswith("time [s],") and "damper_force [N]" in heading and "sprung_acceleration [m/s²]" in heading
    assert float(last.split(",")[0]) == pytest.approx(1.0)
    assert "--command must stay between the levels 2 and 10" in refused(tmp_path, *words, "20", *start, "--replace")
    assert "--command must be left out beside a law" in refused(tmp_path, *words, "6", "--law", law, "--replace")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["half_car_02"], "Did you mean 'half_car_002'?"),
        (["quarter_car_000", "iso:K"], "CLASS in iso:CLASS must be one of 'A'"),
        (["quarter_car_000", "bump:3"], "ROAD must read like bump:HEIGHT:LENGTH"),
        (["quarter_car_000", "nothing.csv"], "a file that is there, but is 'nothing.csv'"),
        (["quarter_car_000", "--speed", "-3"], "Option --speed must be positive"),
        (["quarter_car_000", "--speed", "72kg"], "'72kg' is neither a number in m/s nor one with a unit"),
        (["quarter_car_000", "--duration", "long"], "'long' is neither a number in s"),
        (["quarter_car_000", "--duration", "0"], "Option --duration must be positive"),
        (["quarter_car_000", "--delay", "0.05"], "Option --delay must be given with --controller"),
        (["quarter_car_000", "--actuator-lag", "0"], "Option --actuator-lag must be given with --controller"),
        (["quarter_car_000", "--dt", "0.1"], "a fifth of the period of the fastest mode that follows the road"),
    ],
)
def test_wrong_words_are_refused(law: Path, tmp_path: Path, words: list[str], message: str) -> None:
    assert message in refused(tmp_path, "ride", *words, "--law", law, "--out", tmp_path / "out")


def test_a_controller_is_compared_with_the_law_at_its_own_command(tmp_path: Path) -> None:
    damper = Scheduled((Linear(1000.0), Linear(6000.0)), levels=[0.0, 1.0], command=0.25)
    words = ["--controller", "skyhook:gain=3000,lead=0.01", "--delay", "0.002", "--actuator-lag", "0.003"]
    out = tmp_path / "ride"
    law = _written(damper, tmp_path / "law.json")
    jaxdamp("ride", "quarter_car_000", "--law", law, "--duration", "0.5", *words, "--out", out)
    rows = {row["metric"]: row for row in csv.DictReader((out / "metrics.csv").read_text().splitlines())}
    car, road = vehicles.presets.quarter_car_000(damper), roads.iso8608("C", 20.0, 0.5, seed=0)
    controlled = Controlled(car, Skyhook(3000.0, 0.01), actuator_lag=0.003, delay=0.002)
    for column, vehicle in {"baseline": car, "law": controlled}.items():
        expected = float(simulate(vehicle, road, duration=0.5).metrics(["comfort"])["weighted_rms_sprung_acceleration"])
        assert float(rows["weighted_rms_sprung_acceleration"][column]) == pytest.approx(expected, rel=1e-9)
    assert (out / "ride_sheet.png").exists() and "damper_command" in (out / "channels_law.csv").read_text()
    jaxdamp("export", out / "vehicle.json", "--to", "c", "--part", "controller", "--file", tmp_path / "ecu.c")
    assert "p->policy_gain = 3000.0;" in (tmp_path / "ecu.c").read_text()
    with pytest.raises(AssertionError, match=r"that takes one, but is .* beside Linear"):
        linear = _written(Linear(1500.0), tmp_path / "linear.json")
        jaxdamp("ride", "quarter_car_000", "--law", linear, *words, "--out", tmp_path / "other")


def test_a_vehicle_rides_on_its_own_dampers_beside_another_one(tmp_path: Path) -> None:
    car, out = vehicles.presets.half_car_002(Linear(1500.0)), tmp_path / "ride"
    to_json(replace(car, {"front.damper.rate": 2500.0}), tmp_path / "other.json")
    words = ["--baseline", tmp_path / "other.json", "--duration", "1", "--out", out]
    to_json(car, tmp_path / "car.json")
    jaxdamp("ride", tmp_path / "car.json", *words)
    files = {file.name for file in out.iterdir()}
    assert {"law.json", "channels_vehicle.csv"} <= files and not {"baseline.json", "vehicle.json"} & files
    assert from_json(out / "law.json").rate == 1500.0
    rows = {row["metric"]: row for row in csv.DictReader((out / "metrics.csv").read_text().splitlines())}
    expected = simulate(car, roads.iso8608("C", 20.0, 1.0, seed=0), duration=1.0).metrics(["comfort"])
    ((name, value),) = expected.items()
    assert float(rows[name]["vehicle"]) == pytest.approx(float(value), rel=1e-9)
    assert rows[name]["baseline"] != rows[name]["vehicle"]


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("skyhok", "Did you mean 'skyhook'"),
        ("skyhook:gin=1", "must be one of 'gain', 'lead'"),
        ("skyhook:3000", "must read like skyhook:gain=3000"),
        ("power-driven", "must have a stiffness"),
        ("preview:gain=500", "must have a delay"),
        ("lqr:weight=1", "must be one of 'stroke', 'tyre'"),
        ("none.json", "a file that is there"),
    ],
)
def test_a_wrong_controller_is_refused(word: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_policy(word, vehicles.presets.quarter_car_000())


def test_a_coarse_step_is_said_in_the_words_of_the_command_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(own_words(), "dt", "Option --dt")
    car, bump = vehicles.presets.quarter_car_000(), roads.cosine_bump(0.05, start=0.1, duration=0.25)
    _, said = with_step_warnings(lambda: simulate(car, bump, duration=1.0, dt=0.02))
    assert len(said) == 1 and "estimated at" in said[0] and " --dt 0.00" in in_command_line(said[0])
    assert with_step_warnings(lambda: simulate(car, bump, duration=1.0, dt=0.002))[1] == []


def test_roads_from_files_go_under_every_axle(tmp_path: Path) -> None:
    car = vehicles.presets.half_car_002()
    x = np.linspace(0.0, 20.0, 201)
    file = tmp_path / "profile.csv"
    file.write_text("x [ft],z [mm]\n" + "\n".join(f"{a / 0.3048},{10.0 * np.sin(a)}" for a in x))
    road = parse_road(str(file), speed=5.0, duration=3.0, seed=0)
    time = np.arange(301) / 100
    front, rear = np.asarray(simulate(car, road, duration=3.0, dt=0.01).road).T
    np.testing.assert_allclose(front, 0.01 * np.sin(5.0 * time), atol=2e-5)
    np.testing.assert_allclose(rear[50:], front[:-50], atol=1e-12)  # 2.5 m behind


def test_every_preset_with_a_damper_takes_the_law() -> None:
    assert {"quarter_car_000", "half_car_002", "full_car_jazar", "truck_001", "m113_003"} <= set(presets())
    for make in presets().values():
        laws = make(damper=Linear(1234.0)).elements()
        assert any("1234.0" in repr(law) for law in laws)


def test_a_law_as_baseline_stands_where_it_stands_as_start(law: Path, tmp_path: Path) -> None:
    """By the name of a vehicle and by its file; of a truck in front, since leaves of a tandem are no damper."""
    own, start = parse_vehicle("truck_001")(None), parse_vehicle("truck_001")(read_law("start", law))
    assert equal(read_baseline(law, own), start) and not equal(own, start)
    to_json(own, tmp_path / "truck.json")
    assert equal(parse_vehicle(str(tmp_path / "truck.json"))(read_law("start", law)), start)
    file = tmp_path / "car.toml"
    file.write_text('preset = "quarter_car_000"\n[parameters]\ndamper.rebound_rate = 900.0\n')
    car = parse_vehicle(str(file))(Bilinear(1000.0, 1000.0))
    assert equal(car.damper, Bilinear(900.0, 1000.0))  # type: ignore[attr-defined]
    assert equal(read_baseline(law, car).damper, read_law("start", law))  # type: ignore[attr-defined]


def test_a_law_for_the_dampers_is_not_put_under_seats_and_cabs(law: Path, tmp_path: Path) -> None:
    seat = vehicles.Seat((vehicles.SeatMass(80.0, 6e3, Linear(600.0)),))
    mounts = vehicles.Cab(800.0, 700.0, 1.0, 0.8, 0.8, 60e3, 60e3, Linear(4e3), Linear(5e3))
    truck = dataclasses.replace(vehicles.presets.truck_001(), cab=mounts, seats=(seat,))
    to_json(truck, tmp_path / "truck.json")
    loaded = parse_vehicle(str(tmp_path / "truck.json"))(read_law("start", law))
    assert equal(loaded.front.damper, read_law("start", law))  # type: ignore[attr-defined]
    assert equal((loaded.cab, loaded.seats), (mounts, (seat,)))  # type: ignore[attr-defined]


def test_how_long_a_road_is_driven() -> None:
    for word, given, expected in (("iso:C", None, 10.0), ("iso:C", 3.0, 3.0), ("bump:0.05:4", None, 10.0)):
        roads_driven, run = Driving(duration=given).over(word, 1)
        assert run == {"duration": expected, "dt": 1e-3} and len(roads_driven) == 1
    assert Driving().over("white:C")[1] == {}
