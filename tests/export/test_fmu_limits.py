"""Numbers that an FMU refuses, and results that are none."""

import functools

import numpy as np
import pytest

from jaxdamp.dampers import Besinger, Polynomial, Table
from jaxdamp.export import to_fmu
from jaxdamp.vehicles import presets
from tests.export.compiled import compiler


fmpy = pytest.importorskip("fmpy")
VALVE = Besinger(900.0, 2800.0, 700.0, limit_velocity=0.25, transition_velocity=0.05)
TABLE = Table([-1.0, -0.5, 0.0, 0.5, 1.0], [-900.0, -500.0, 0.0, 600.0, 1100.0])
MODELS = {
    "sum": VALVE + TABLE + Polynomial([100.0, 20.0], velocity_range=(-2.0, 2.0)),
    "car": presets.quarter_car_000(VALVE),
}


@pytest.fixture(scope="module")
def unzipped(tmp_path_factory):
    compiler("cc")
    folder = tmp_path_factory.mktemp("fmu")

    def made(name):
        file = to_fmu(MODELS[name], folder / f"{name}.fmu")
        return file, fmpy.extract(str(file), unzipdir=str(folder / name))

    return functools.cache(made)


class Unit:
    """An FMU before its initialisation; `said` are the messages of its refusals."""

    def __init__(self, files, capsys, kind):
        file, unzipped = files
        description = fmpy.read_model_description(str(file))
        self.at, self._capsys = {v.name: v.valueReference for v in description.modelVariables}, capsys
        about = {"unzipDirectory": unzipped, "modelIdentifier": description.coSimulation.modelIdentifier}
        self.fmu = kind(guid=description.guid, instanceName="one", **about)
        self.fmu.instantiate()
        self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()

    def set(self, **values):
        self.fmu.setReal([self.at[name] for name in values], list(values.values()))

    def get(self, name):
        return self.fmu.getReal([self.at[name]])[0]

    def refusal(self, call, *arguments, **numbers):
        self._capsys.readouterr()
        with pytest.raises(fmpy.fmi1.FMICallException):
            call(*arguments, **numbers)
        return self._capsys.readouterr().out


@pytest.fixture
def unit(unzipped, capsys):
    opened = []

    def load(name, kind=None):
        opened.append(Unit(unzipped(name), capsys, kind or fmpy.fmi2.FMU2Slave))
        return opened[-1]

    yield load
    for one in opened:
        one.fmu.freeInstance()


@pytest.mark.parametrize(
    ("model", "name", "value", "must"),
    [
        ("sum", "terms[0].transition_velocity", 0.0, "be positive, but is 0."),
        ("sum", "terms[0].limit_velocity", -0.25, "be positive, but is -0.25."),
        ("sum", "terms[0].rebound_rate", np.nan, "be positive, but is "),
        ("sum", "terms[1].force_points[1]", np.inf, "be finite, but is inf."),
        ("sum", "terms[2].velocity_range[0]", 0.1, "be a low and a high end with zero between them, but is 0.1."),
        ("sum", "longest_step", 0.0, "be finite and at least 1e-09 s, but is 0."),
        ("car", "sprung_mass", -250.0, "be positive, but is -250."),
    ],
)
def test_a_number_outside_its_limits_is_refused_by_name_and_the_one_before_stays(unit, model, name, value, must):
    one = unit(model)
    before = one.get(name)
    assert f"{name} must {must}" in one.refusal(one.set, **{name: value})
    assert one.get(name) == before
    one.fmu.exitInitializationMode()


def test_limits_of_the_model_description_are_those_of_the_unit(unit, unzipped):
    known = {v.name: v for v in fmpy.read_model_description(str(unzipped("sum")[0])).modelVariables}
    lowest = float(known["terms[0].rebound_rate"].min)
    assert 0.0 < lowest < 1e-300 and known["terms[0].rebound_rate"].max is None
    assert float(known["terms[2].velocity_range[0]"].max) == float(known["terms[2].velocity_range[1]"].min) == 0.0
    assert known["terms[1].force_points[1]"].min is None
    unit("sum").set(**{"terms[2].velocity_range[0]": 0.0, "terms[0].limit_velocity": lowest})


def test_conditions_between_numbers_are_checked_where_they_count(unit):
    """Numbers are set one after the other: what two of them have to be is checked before the next result."""
    one = unit("sum")
    one.set(**{"terms[1].velocity[3]": 2.0})
    said = one.refusal(one.fmu.exitInitializationMode)
    assert "terms[1].velocity[4] must be greater than terms[1].velocity[3], but they are 1 and 2." in said
    one.set(**{"terms[1].velocity[4]": 3.0})
    one.fmu.exitInitializationMode()
    one.set(v=1.0)
    force = one.get("F")
    one.set(**{"terms[0].rebound_rate": 1.0})
    assert "terms[0].rebound_rate must be greater than a share of" in one.refusal(one.get, "F")
    assert one.get("terms[0].rebound_rate") == 1.0
    assert "too low by " in one.refusal(one.fmu.doStep, 0.0, 1e-3)
    one.set(**{"terms[0].rebound_rate": 2800.0})
    assert one.get("F") == force
    one.fmu.doStep(0.0, 1e-3)


def test_conditions_hold_in_model_exchange_and_inside_a_vehicle(unit):
    one = unit("car", fmpy.fmi2.FMU2Model)
    one.fmu.exitInitializationMode()
    one.set(**{"damper.rebound_rate": 1.0})
    assert "damper.rebound_rate must be greater" in one.refusal(one.get, "damper_force")


def test_a_result_that_is_no_number_is_an_error_with_the_remedy(unit):
    steep = {f"damper.{name}": 1e6 for name in ("rebound_rate", "compression_rate", "blow_off_rate")}

    def run(**numbers):
        one = unit("car")
        one.set(**steep, **numbers)
        one.fmu.exitInitializationMode()
        for place in range(300):
            one.fmu.doStep(1e-3 * place, 1e-3)
            one.set(z_road=0.06 * np.sin(0.03 * place) ** 2)
        return one

    assert np.isfinite(run(longest_step=1e-5).get("damper_force"))
    said = unit("car").refusal(run)
    assert " is not a finite number." in said and "need a longest_step shorter than 0.001 s." in said


def test_an_input_that_is_no_number_is_an_error_until_it_is_one(unit):
    one = unit("car")
    one.fmu.exitInitializationMode()
    one.fmu.doStep(0.0, 1e-3)
    one.set(z_road=np.nan)
    assert "damper_force is not a finite number. Inputs must be finite" in one.refusal(one.get, "damper_force")
    assert "is not a finite number" in one.refusal(one.fmu.doStep, 1e-3, 1e-3)
    one.set(z_road=0.0)
    one.fmu.doStep(1e-3, 1e-3)
    assert np.isfinite(one.get("damper_force"))
