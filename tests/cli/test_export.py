"""`jaxdamp export`: a law file in, other formats out."""

from pathlib import Path

import numpy as np
import pytest

from jaxdamp.cli.exporting import PROGRAMS, TABLES
from jaxdamp.dampers import Bilinear, FittedRange, Linear, Scheduled, with_fitted_range
from jaxdamp.export import to_csv, to_json
from jaxdamp.roads import sine
from jaxdamp.vehicles.presets import quarter_car_000

from .invoking import jaxdamp, refused


LAW = Bilinear(2600.0, 1200.0)


@pytest.fixture
def law(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    to_json(LAW, tmp_path / "front-law.json")
    return tmp_path / "front-law.json"


@pytest.mark.parametrize("to", [*PROGRAMS, *TABLES])
def test_every_format(law: Path, to: str) -> None:
    ending = (PROGRAMS | TABLES)[to][0]
    text = jaxdamp("export", law, "--to", to).output
    assert f"front_law{ending}" in text and (law.parent / f"front_law{ending}").stat().st_size > 100


def test_a_vehicle(law: Path) -> None:
    folder = law.parent
    to_json(quarter_car_000(LAW), folder / "car.json")
    assert "car_test.c" in jaxdamp("export", folder / "car.json", "--to", "c").output
    assert "car_step(" in (folder / "car.h").read_text()
    assert "LAW must be a law as JSON" in refused(folder, "export", folder / "car.json", "--to", "adams")
    to_json(sine(amplitude=0.01, frequency=1.0), folder / "road.json")
    assert "be a law or a vehicle as JSON" in refused(folder, "export", folder / "road.json", "--to", "fmu")


def test_velocities(law: Path) -> None:
    assert "5 from -0.6 to 0.8 m/s" in jaxdamp("export", law, "--to", "csv", "--velocities", "-0.6:0.8:5").output
    written = law.parent / "front_law.csv"
    expected = to_csv(LAW, law.parent / "expected.csv", [-0.6, -0.25, 0.1, 0.45, 0.8])
    assert written.read_text().splitlines()[-1] == expected.read_text().splitlines()[-1]
    fitted = law.parent / "fitted.json"
    to_json(with_fitted_range(LAW, FittedRange(velocity=(-0.2, 0.3))), fitted)
    assert " from -0.2 to 0.3 m/s" in jaxdamp("export", fitted, "--to", "adams").output
    assert "\n      0.000000        0.000000\n" in (law.parent / "fitted.dpr").read_text()
    to_json(with_fitted_range(LAW, FittedRange(velocity=(-0.01, 1.2))), fitted)
    assert " from -0.01 to 1.2 m/s" in jaxdamp("export", fitted, "--to", "csv", "--replace").output
    first, second = np.loadtxt(law.parent / "fitted.csv", delimiter=",", comments=("#", "v"))[:2]
    np.testing.assert_allclose((first, second), [(-0.01, -12.0), (0.0, 0.0)], atol=1e-9)


def test_a_table_in_the_units_and_the_sign_of_a_shop(law: Path) -> None:
    jaxdamp("export", law, "--to", "csv", "--velocities", "-0.254:0.508:4")
    si = np.loadtxt((law.parent / "front_law.csv"), delimiter=",", skiprows=1, comments=("#", "velocity"))
    shop = ("--units", "imperial", "--sign", "compression-positive", "--replace")
    jaxdamp("export", law, "--to", "csv", "--velocities", "-0.254:0.508:4", *shop)
    assert "velocity [in/s],force [lbf]" in (law.parent / "front_law.csv").read_text()
    shown = np.loadtxt((law.parent / "front_law.csv"), delimiter=",", skiprows=1, comments=("#", "velocity"))
    np.testing.assert_allclose(shown, -si[::-1] / [0.0254, 4.4482216152605], rtol=1e-12)
    assert "must be left out for carsim" in refused(law.parent, "export", law, "--to", "carsim", *shop)


def test_what_is_said_of_a_table_agrees_with_its_rows(law: Path) -> None:
    fitted = law.parent / "fitted.json"
    to_json(with_fitted_range(LAW, FittedRange(velocity=(-0.128, 0.255), force=(-100.0, 600.0))), fitted)
    words = ("--to", "csv", "--velocities", "-0.254:0.508:7", "--show-sign", "compression-positive")
    said = " ".join(jaxdamp("export", fitted, *words, "--units", "imperial").output.split())
    assert "Velocities: 7 from -20 to 10 in/s, positive in compression." in said
    text = (law.parent / "fitted.csv").read_text()
    assert text.splitlines()[-7].startswith("-20.0,") and text.splitlines()[-3] == "0.0,0.0"
    assert "# law, its numbers in SI and positive in rebound: Bilinear(rebound_rate=2600.0" in text
    assert "# fitted to: velocity -10 to 5.04 in/s, force -135 to 22.5 lbf\n" in text
    assert "# extrapolated: rows below -10 in/s and above 5 in/s, 3 of 7, beyond all records" in text


def test_a_table_of_a_law_with_a_command_says_at_which(law: Path) -> None:
    folder = law.parent
    clicks = Scheduled((Linear(900.0), Linear(1500.0)), levels=[2.0, 10.0], command=2.0)
    to_json(clicks, folder / "clicks.json")
    assert (
        "At command 2 of 2 to 10; --command sets another."
        in jaxdamp("export", folder / "clicks.json", "--to", "adams").output
    )
    words = ("export", folder / "clicks.json", "--to", "csv", "--velocities", "-1:1:3", "--command")
    assert "At command 6 of 2 to 10;" in jaxdamp(*words, "6").output
    text = (folder / "clicks.csv").read_text()
    assert "# at command 6 of 2 to 10\n" in text and text.endswith("\n1.0,1200.0\n")
    assert "Option --command must stay between the levels 2 and 10" in refused(folder, *words, "20", "--replace")
    assert "Option --command must be left out" in refused(folder, "export", law, "--to", "csv", "--command", "6")
    assert "Option --command must be left out for c" in refused(folder, "export", law, "--to", "c", "--command", "6")


def test_refusals(law: Path) -> None:
    folder = law.parent
    assert "Option --to must be one of" in refused(folder, "export", law, "--to", "adam")
    assert "--velocities must be FROM:TO:POINTS" in refused(folder, "export", law, "--to", "csv", "--velocities", "1")
    for text in ("0.5:-0.5:3", "-0.5:0.5:0"):
        said = refused(folder, "export", law, "--to", "csv", f"--velocities={text}")
        assert "m/s, rising from FROM to TO" in said and "Write for example -0.6:0.8:41." in said, said
    assert "be left out for fmu" in refused(folder, "export", law, "--to", "fmu", "--velocities", "-1:1:3")
    assert "--part must be left out for csv" in refused(folder, "export", law, "--to", "csv", "--part", "controller")
    assert "which has no controller" in refused(folder, "export", law, "--to", "c", "--part", "controller")
    to_json(sine(amplitude=0.01, frequency=1.0), folder / "road.json")
    assert "LAW must be a law as JSON" in refused(folder, "export", folder / "road.json", "--to", "csv")
    jaxdamp("export", law, "--to", "csv")
    assert "Option --file must be a new file" in refused(folder, "export", law, "--to", "csv")
    jaxdamp("export", law, "--to", "csv", "--replace")
    for mine in ("front_law.h", "front_law_test.c"):
        (folder / mine).write_text("mine")
        for words in ((), ("--file", folder)):
            said = refused(folder, "export", law, "--to", "c", *words)
            assert "Option --file must be a new file" in said and mine in said
        (folder / mine).unlink()


@pytest.mark.parametrize(("to", "other"), [("adams", "a.csv"), ("csv", "b.mat"), ("carsim", "c.dpr"), ("fmu", "d")])
def test_a_file_with_the_ending_of_another_format_is_refused(law: Path, to: str, other: str) -> None:
    ending = (PROGRAMS | TABLES)[to][0]
    said = refused(law.parent, "export", law, "--to", to, "--file", other)
    assert (
        f"Option --file must be a folder or a file NAME{ending}, but is {other}" in said
        and f"Try {other[0]}{ending}." in said
    )


def test_zero_among_given_velocities_is_zero(law: Path) -> None:
    jaxdamp("export", law, "--to", "csv", "--velocities=-0.4:0.8:4", "--file", "given.csv")  # once -5.6e-17
    assert "\n0.0,0.0\n" in (law.parent / "given.csv").read_text()


def test_any_name_of_a_law_becomes_a_name_of_c(law: Path) -> None:
    law.rename(law.parent / "2 Dämpfer.json")
    assert "_2_Dampfer_test.c" in jaxdamp("export", "2 Dämpfer.json", "--to", "c").output
    assert "Option --file must be" in refused(law.parent, "export", "2 Dämpfer.json", "--to", "c", "--file", "2.c")


def test_a_file_that_cannot_be_written_is_named_as_it_was_given(law: Path) -> None:
    said = refused(law.parent, "export", law, "--to", "csv", "--file", "a" * 300 + ".csv")
    assert "a.csv' cannot be opened (File name too long)" in said and "draft" not in said
