"""The standard errors of a fit travel with its law, and a tuning leaves alone what no record determined."""

import json

import pytest

from jaxdamp import identify, roads
from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import Bilinear, Lag, PiecewiseLinear, StandardError, not_identified, with_standard_errors
from jaxdamp.export import from_json, to_json
from jaxdamp.tune import minimise
from jaxdamp.vehicles import presets


def test_a_fit_on_a_machine_leaves_the_errors_of_its_table_in_the_file(tmp_path):
    runs = VirtualDyno(Bilinear(2000.0, 1200.0), force_noise=5.0, sampling_rate=200.0).run([SineTest(0.02, 1.0)])
    result = identify.fit(Bilinear(1500.0, 1500.0), runs, rig="offset")
    to_json(result.law, tmp_path / "law.json")
    errors = {error.name: error for error in from_json(tmp_path / "law.json").standard_errors}
    assert sorted(errors) == ["compression_rate", "rebound_rate"]
    for name, error in errors.items():
        table = result[f"law.{name}"]
        assert (error.value, error.unit, error.identified) == (table.standard_error, table.unit, True)


def test_standard_errors_come_back_and_a_tuning_leaves_alone_what_is_not_determined(tmp_path):
    """A law that was saved is tuned as the law that was fitted: records in extension say nothing of compression."""
    errors = [
        StandardError("rebound_rate", 10.0 / 3.0, "N s/m", True),
        StandardError("compression_rate", float("nan"), "N s/m", False),
    ]
    fitted = with_standard_errors(Bilinear(2600.0, 1200.0), errors)
    document = json.loads(to_json(fitted, tmp_path / "law.json"))
    assert document["version"] == 3
    assert document["law"]["standard_errors"]["compression_rate"] == {
        "value": None, "unit": "N s/m", "identified": False,
    }  # fmt: skip
    again = from_json(tmp_path / "law.json")
    assert again.standard_errors == fitted.standard_errors == (errors[0], errors[1]._replace(value=float("inf")))
    assert again.fitted_to is None and not_identified(again) == ["compression_rate"]
    assert not_identified(presets.quarter_car_000(again)) == ["damper.compression_rate"]
    with pytest.raises(ValueError, match="have no 'standard_errors' in version 2"):
        from_json(json.dumps(document | {"version": 2}))
    bump, run = roads.cosine_bump(0.05, start=0.02, duration=0.1), {"duration": 0.2, "dt": 2e-3, "max_steps": 1}
    tuned = minimise("rms_sprung_acceleration", presets.quarter_car_000(again), bump, **run)
    assert [row[0] for row in tuned.parameter_table().rows] == ["damper.rebound_rate"]
    assert any("do not determine it: damper.compression_rate" in warning for warning in tuned.warnings)
    document["law"]["standard_errors"]["rebound_rate"] = 3.0
    with pytest.raises(ValueError, match=r"`Bilinear\.standard_errors` must be written as"):
        from_json(json.dumps(document))


def test_a_vector_is_known_if_one_of_its_numbers_is_and_an_outer_fit_replaces_the_errors_inside():
    def error(name, identified):
        return StandardError(name, 1.0, "N", identified)

    errors = [error("forces[0]", False), error("forces[1]", True), error("rate", False)]
    inner = with_standard_errors(PiecewiseLinear([0.0], [500.0, 800.0]), errors)
    assert not_identified(inner) == ["rate"]
    outer = with_standard_errors(Lag(inner, 0.004), [error("lag_time", False)])
    assert not_identified(outer) == ["lag_time"]
