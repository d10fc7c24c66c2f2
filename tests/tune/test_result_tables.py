"""Tunings and their rescoring as tables and plain data; numbers made up, no search."""

import json
from typing import Any

import numpy as np
import pytest

from jaxdamp import tune as typed_tune
from jaxdamp.tune import Rescore, Status, TuneResult
from jaxdamp.tune.ranges import Change
from jaxdamp.vehicles import presets


CAR = presets.quarter_car_000()
tune: Any = typed_tune  # old names, which type checkers do not see
RESULT = TuneResult(
    vehicle=CAR,
    start=CAR,
    metric="rms_sprung_acceleration",
    parameters=(Change("damper.rate", 2500.0, 2000.0, "N s/m", "", 1000.0, 5000.0),),
    before={"rms_sprung_acceleration": 2.0, "rms_dynamic_tyre_load": 500.0, "lift_off_fraction": 0.0},
    after={"rms_sprung_acceleration": 1.5, "rms_dynamic_tyre_load": 550.0, "lift_off_fraction": 0.1},
    units={"rms_sprung_acceleration": "m/s^2", "rms_dynamic_tyre_load": "N", "lift_off_fraction": ""},
    limits={"rms_dynamic_tyre_load": 550.0},
    active_limits=("rms_dynamic_tyre_load",),
    warnings=("Mind the kink.",),
    status=Status.CONVERGED,
    history=(1.8, 1.5),
)
FRESH = Rescore(
    before={"rms_sprung_acceleration": np.array([2.0, 1.0]), "lift_off_fraction": np.array([0.0, 0.1])},
    after={"rms_sprung_acceleration": np.array([1.0, 0.9]), "lift_off_fraction": np.array([0.1, 0.1])},
    units={"rms_sprung_acceleration": "m/s^2", "lift_off_fraction": ""},
    metric="rms_sprung_acceleration",
)


def test_a_tuning_stands_in_two_tables() -> None:
    assert RESULT.table().rows == (
        ("rms_sprung_acceleration", "m/s²", 2.0, 1.5, pytest.approx(-25.0), "minimised"),
        ("rms_dynamic_tyre_load", "N", 500.0, 550.0, pytest.approx(10.0), "limit 550 N, reached"),
        ("lift_off_fraction", "–", 0.0, 0.1, None, ""),
    )
    (row,) = RESULT.parameter_table().records()
    assert (row["before"], row["after"], row["unit"], row["upper"]) == (2500.0, 2000.0, "N s/m", 5000.0)
    assert row["change"] == pytest.approx(-20.0)


def test_a_tuning_reads_as_its_summary_and_its_tables() -> None:
    text = repr(RESULT)
    assert text.startswith(f"{RESULT.summary}\nRide metrics\n") and text.endswith("\nwarning: Mind the kink.")
    assert RESULT.parameter_table().to_text() in text


def test_a_tuning_as_plain_data() -> None:
    data = json.loads(json.dumps(RESULT.to_dict(), allow_nan=False))
    assert data["metrics"]["rms_sprung_acceleration"] == {"before": 2.0, "after": 1.5, "unit": "m/s^2"}
    assert data["limits"] == {"rms_dynamic_tyre_load": {"value": 550.0, "unit": "N"}}
    assert data["parameters"][0]["lower"] == 1000.0 and data["converged"] is True and data["history"] == [1.8, 1.5]


def test_other_roads_stand_in_a_table_but_for_what_has_no_change() -> None:
    (row,) = FRESH.table().rows
    name, unit, before, after, change, smallest, largest = row
    assert (name, unit, before, after) == ("rms_sprung_acceleration", "m/s²", 1.5, 0.95)
    assert (change, smallest, largest) == pytest.approx((-30.0, -50.0, -10.0))
    words = "it changes by -30.0 ± 254.1 % on average (-50 to -10 %)."
    assert FRESH.summary == f"On 2 of 2 roads rms_sprung_acceleration decreases; {words}"
    assert repr(FRESH).startswith(FRESH.summary)
    data = json.loads(json.dumps(FRESH.to_dict(), allow_nan=False))
    assert data["metrics"]["lift_off_fraction"] == {"before": [0.0, 0.1], "after": [0.1, 0.1], "unit": ""}


def test_metrics_that_may_be_negative_have_no_change_in_percent() -> None:
    names = {"maximum_stroke": [1e-5, 2e-3], "grip": [2.0, 4.0]}
    before = {name: np.array(values) for name, values in names.items()}
    after = {"maximum_stroke": np.array([-1e-3, 1e-3]), "grip": np.array([1.0, 3.0])}
    signed = Rescore(
        before, after, {"maximum_stroke": "m", "grip": "N"}, "maximum_stroke", frozenset(["maximum_stroke"])
    )
    assert signed.summary == "On 2 of 2 roads maximum_stroke decreases, from 1.005 to 0 mm on average."
    assert [row["metric"] for row in signed.table().records()] == ["grip"]
    none = Rescore({"grip": np.zeros(2)}, {"grip": np.array([0.0, 1.0])}, {"grip": "N"}, "grip")
    assert none.summary == "On 0 of 2 roads grip decreases, from 0 to 0.5 N on average."


def test_unknown_names_are_answered() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Chance'"):
        _ = tune.Chance
