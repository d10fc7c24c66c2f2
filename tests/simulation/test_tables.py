"""Responses as tables and plain data."""

import json

import pytest

from jaxdamp import roads, simulate, vehicles
from jaxdamp.dampers import Linear
from jaxdamp.simulation import Response, comfort_table, metrics_table


@pytest.fixture(scope="module")
def runs() -> dict[str, Response]:
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.2)
    laws = {"soft": Linear(1500.0), "firm": Linear(3000.0)}
    cars = {name: vehicles.presets.quarter_car_000(law) for name, law in laws.items()}
    return {name: simulate(car, bump, duration=1.0, dt=0.002) for name, car in cars.items()}


def test_tables_of_one_response_have_no_change(runs: dict[str, Response]) -> None:
    run = runs["soft"]
    for table in (run.table(), run.comfort_table()):
        assert [column.name for column in table.columns][1:] == ["unit", "value"]
    units = {str(row[0]).rpartition("acceleration ")[2]: row[1] for row in run.comfort_table().rows}
    assert units["vibration dose value"] == "m/s^1.75" and units["weighted rms"] == "m/s²"
    assert [row["metric"] for row in run.table().records()] == list(run.metric_units())


def test_of_several_the_change_is_from_the_first_to_the_last(runs: dict[str, Response]) -> None:
    rows = {row["metric"]: row for row in metrics_table(runs).records()}
    before, after = (float(run.metrics()["rms_sprung_acceleration"]) for run in runs.values())
    row = rows["rms_sprung_acceleration"]
    assert (row["soft"], row["firm"], row["unit"]) == (before, after, "m/s²")
    assert row["change"] == pytest.approx(100 * (after / before - 1))
    assert rows["working_space_mean"]["change"] is None  # it may have either sign
    comfort = comfort_table(runs).records()[0]
    felt = [float(run.comfort()["sprung_acceleration"].weighted_rms) for run in runs.values()]
    assert [comfort["soft"], comfort["firm"]] == felt


def test_a_response_as_plain_data(runs: dict[str, Response]) -> None:
    run = runs["firm"]
    data = json.loads(json.dumps(run.to_dict(), allow_nan=False))
    assert data["vehicle"] == "QuarterCar" and data["end"] == {"value": 1.0, "unit": "s"}
    assert set(data["metrics"]) == set(run.metrics())
    value = float(run.metrics()["rms_dynamic_tyre_load"])
    assert data["metrics"]["rms_dynamic_tyre_load"] == {"value": value, "unit": "N"}
    dose = float(run.comfort()["sprung_acceleration"].vibration_dose_value)
    assert data["comfort"]["sprung_acceleration"]["vibration_dose_value"] == {"value": dose, "unit": "m/s^1.75"}
    assert data["energy_balance"]["road_work"]["unit"] == "J" and data["notes"] == list(run.notes)


def test_dampers_are_named(runs: dict[str, Response]) -> None:
    assert runs["soft"].dampers == ("damper",)


def test_a_response_plots_itself(runs: dict[str, Response]) -> None:
    figure = runs["soft"].plot(channels=["stroke"])
    assert figure.axes[0].get_ylabel().startswith("stroke [mm]")
