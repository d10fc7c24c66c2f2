"""The command line says what laws were fitted to and by how much rides leave it."""

import csv
import warnings
from pathlib import Path

import pytest

from jaxdamp import roads, simulate, vehicles
from jaxdamp.cli.jobs import with_step_warnings
from jaxdamp.dampers import Bilinear, FittedRange, Linear, with_fitted_range
from jaxdamp.export import from_json, to_json
from jaxdamp.report import fitted_range_table, notes_of, range_use_table

from .invoking import jaxdamp


SLOW = FittedRange(velocity=(-0.1, 0.2), stroke=(-0.01, 0.01), force=(-300.0, 500.0))


def test_a_fit_states_the_range_and_writes_it_into_the_law(records: Path, tmp_path: Path) -> None:
    out = tmp_path / "fit"
    jaxdamp("fit", *sorted(records.glob("*.csv")), "--law", "bilinear", "--out", out)
    law = from_json(out / "best_law.json")
    assert law.fitted_to is not None and law.fitted_to.stroke == pytest.approx((-0.01, 0.01), rel=1e-2)
    assert "Range of the fitted records" in (out / "report.html").read_text()
    assert f"# fitted to: {law.fitted_to.words()}" in (out / "best_law_force_velocity.csv").read_text()


@pytest.mark.slow
def test_a_ride_beyond_the_range_is_said_in_table_report_and_words(tmp_path: Path) -> None:
    law, out = tmp_path / "law.json", tmp_path / "ride"
    to_json(with_fitted_range(Bilinear(2600.0, 1200.0), SLOW), law)
    words = ["half_car_002", "bump:0.05:4", "--speed", "16", "--duration", "2", "--dt", "0.002"]
    text = " ".join(jaxdamp("ride", *words, "--law", law, "--out", out, "--verbose").output.split())
    assert "Use of the dampers beside the records of their laws" in text and "law: front damper: velocity" in text
    rows = list(csv.DictReader((out / "range_use.csv").read_text().splitlines()))
    assert [(row["damper"], row["quantity"]) for row in rows] == [
        (f"{end} damper", what) for end in ("front", "rear") for what in ("velocity", "force")
    ]
    front = rows[0]
    assert (float(front["fitted from"]), float(front["fitted to"])) == (-0.1, 0.2)
    assert float(front["times"]) == pytest.approx(max(float(front["highest"]) / 0.2, float(front["lowest"]) / -0.1))
    report = (out / "report.html").read_text()
    assert "Fitted to: velocity −0.1 to 0.2 m/s" in report and "<li>law: front damper: velocity" in report


def test_tables_and_remarks() -> None:
    car = vehicles.presets.quarter_car_000(with_fitted_range(Linear(1500.0), SLOW))
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.2)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run, said = with_step_warnings(lambda: simulate(car, bump, duration=1.0, dt=0.002))
    plain = simulate(vehicles.presets.quarter_car_000(), bump, duration=1.0, dt=0.002)
    assert not caught and not said
    table = range_use_table({"fitted": run, "plain": plain})
    assert table is not None and {row[0] for row in table.rows} == {"fitted"}
    assert range_use_table({"plain": plain}) is None
    assert notes_of({"fitted": run, "plain": plain}) == [f"fitted: {note}" for note in run.notes]
    assert fitted_range_table(SLOW).rows[1] == ("stroke", "m", -0.01, 0.01)
