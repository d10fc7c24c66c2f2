"""Controllers and controlled vehicles as FMU, against `simulate`."""

import functools
import math

import numpy as np
import pytest

from jaxdamp import simulate
from jaxdamp.control import Controlled, Skyhook
from jaxdamp.export import to_fmu
from jaxdamp.parameters import replace
from jaxdamp.roads import from_profile
from tests.export.compiled import compiler
from tests.export.controlled_cars import PERIOD, STEP, TIME, actuated, car, driven, heights, quarter, signals
from tests.export.test_vehicle_fmu import Unit


FMUS = [
    "skyhook",
    *(
        pytest.param(name, marks=pytest.mark.slow)
        for name in ("two", "front", "full", "bouc_wen", "lugre", "sensors", "preview")
    ),
]
fmpy = pytest.importorskip("fmpy")
validate_fmu = pytest.importorskip("fmpy.validation").validate_fmu


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    compiler("cc")
    folder = tmp_path_factory.mktemp("fmu")
    return functools.cache(lambda name, part: to_fmu(car(name), folder / f"{part}_{name}.fmu", part=part))


def table(time, columns):
    """Inputs as fmpy takes them."""
    inputs = np.zeros(time.size, [("time", float), *((key, float) for key in columns)])
    for key, column in {"time": time, **columns}.items():
        inputs[key] = column
    return inputs


def road(name, time=TIME):
    """The heights under the wheels, as inputs, with the rates that `simulate` takes."""
    z, run = heights(len(car(name).wheel_names), time), car(name)
    wheels = [channel for channel in run.units if channel.startswith("z_") and channel.endswith("road")]
    rates = np.gradient(z, time, axis=0)
    columns = dict(zip(wheels, z.T, strict=True)) | {f"{w}_rate": r for w, r in zip(wheels, rates.T, strict=True)}
    return table(time, columns)


def close(found, run, channels, every=1):
    for column, channel in zip(found.T, channels, strict=True):
        expected = np.asarray(run[channel])[::every]
        assert np.abs(column - expected).max() <= 1e-9 * np.abs(expected).max(), channel


def outputs(unit):
    return [v.name for v in unit.description.modelVariables if v.causality == "output"]


def again(unit, **numbers):
    """The unit at the start of another run."""
    unit.fmu.reset()
    unit.fmu.enterInitializationMode()
    unit.set(**numbers)
    unit.move(0)
    unit.fmu.exitInitializationMode()


@pytest.mark.parametrize("name", FMUS)
@pytest.mark.exhaustive_cases("lugre")
def test_the_vehicle_as_fmu_is_that_of_simulate(files, tmp_path, name):
    file = files(name, "whole")
    assert validate_fmu(str(file)) == []
    unit = Unit(file, tmp_path, road(name))
    channels = outputs(unit)
    assert {c for c in channels if c.endswith(("_command", "_demand"))} < {*channels}
    first = unit.run(channels, STEP)
    close(first, driven(name), channels)
    again(unit)
    np.testing.assert_array_equal(unit.run(channels, STEP), first)


@pytest.mark.slow
def test_a_gain_changed_during_a_run_of_a_vehicle(files, tmp_path):
    vehicle, surface = car("skyhook"), from_profile(TIME, heights(1))
    _, state = simulate(vehicle, surface, duration=0.102, dt=STEP, return_state=True)
    run = simulate(replace(vehicle, {"policy.gain": 1500.0}), surface, duration=0.298, dt=STEP, state=state)
    unit = Unit(files("skyhook", "whole"), tmp_path, road("skyhook"))

    def change(place):
        if place == 103:
            unit.set(**{"policy.gain": 1500.0})

    channels = outputs(unit)
    close(unit.run(channels, STEP, change)[103:], {name: run[name][1:] for name in channels}, channels)


def test_longer_and_varying_communication_steps_of_a_vehicle(files, tmp_path):
    """The road is straight over each of them, and the controller keeps its instants."""
    coarse, vehicle = TIME[::5], car("skyhook")
    z = np.interp(TIME, coarse, heights(1, coarse)[:, 0])
    run = simulate(vehicle, from_profile(TIME, z), dt=STEP)
    unit = Unit(files("skyhook", "whole"), tmp_path, table(coarse, {"z_road": z[::5]}))
    channels = ["z_sprung", "damper_force", "damper_command", "damper_demand"]
    close(unit.run(channels, 5.0 * STEP), run, channels, every=5)
    steps = np.tile([1.0, 2.0, 0.5, 0.5, 1.0, 3.0, 2.0, 2.0], 33) * STEP  # of 12 ms
    time = np.concatenate([[0.0], np.cumsum(steps)])
    again(unit)
    found = []
    for now, h, after in zip(time, steps, np.interp(time[1:], TIME, z), strict=False):
        unit.fmu.doStep(now, h)
        unit.set(z_road=float(after))
        found.append(unit.get(["damper_demand", "z_sprung"]))
    demand, height = np.array(found).T
    begins = np.flatnonzero(np.diff(demand))[1:] + 1  # steps in which a new demand comes
    sampled = [math.floor((time[k + 1] - 1e-9) / PERIOD) > math.floor((time[k] - 1e-9) / PERIOD) for k in begins]
    assert len(begins) > 50 and all(sampled)
    expected = np.interp(time[1:], TIME, np.asarray(run["z_sprung"]))
    assert np.abs(height - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.parametrize("name", ["skyhook", pytest.param("bouc_wen", marks=pytest.mark.slow)])
def test_the_controller_as_fmu_decides_as_in_a_simulation(files, tmp_path, name):
    """Two at a time, of one binary; and the second run is as the first."""
    file, run = files(name, "controller"), driven(name)
    assert validate_fmu(str(file)) == []
    known = {v.name: v for v in fmpy.read_model_description(str(file)).modelVariables}
    given = {key: values for key, values in signals(run).items() if key in known}
    inputs, channels = table(TIME, given), ["damper_command", "damper_demand"]
    unit = Unit(file, tmp_path, inputs)
    other = Unit(file, tmp_path, inputs, **{"policy.gain": 1e3})
    rows = []
    for place in range(len(TIME)):
        for each in (unit, other):
            if place:
                each.fmu.doStep(TIME[place - 1], STEP)
                each.move(place)
        rows.append((unit.get(channels), other.get(channels)))
    first, second = np.swapaxes(np.array(rows), 0, 1)
    demand = np.asarray(run["damper_demand"])
    np.testing.assert_allclose(first[:-1, 1], demand[1:], rtol=1e-9, atol=1e-9 * np.abs(demand).max())
    command = np.asarray(run["damper_command"])[1:]
    np.testing.assert_allclose(actuated(car(name), first[:-1, 0]), command, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(second[:, 1], first[:, 1] / 3.0, rtol=1e-12)
    again(unit)
    np.testing.assert_array_equal(unit.run(channels, STEP), first)
    assert known["damper_command"].causality == "output" and known["policy.gain"].variability == "tunable"
    assert (known["policy.gain"].unit, known["damper_body_velocity"].unit) == ("N s/m", "m/s")
    assert (known["car.damper.command"].causality, known["car.damper.command"].variability) == ("parameter", "fixed")
    assert not any("mass" in name or "wheel" in name for name in known)


def test_a_period_as_communication_step_and_a_gain_that_changes(files, tmp_path):
    plain = Controlled(quarter(), Skyhook(3000.0))
    file = to_fmu(plain, tmp_path / "plain.fmu", part="controller")
    run = simulate(plain, from_profile(TIME, heights(1)), dt=STEP)
    every = {key: values[::5] for key, values in signals(run).items() if "wheel" not in key and "acc" not in key}
    known = {v.name for v in fmpy.read_model_description(str(file)).modelVariables}
    inputs = table(TIME[::5], {key: values for key, values in every.items() if key in known})
    assert inputs.dtype.names == ("time", "damper_body_velocity", "damper_velocity")
    unit = Unit(file, tmp_path, inputs)
    channels = ["damper_command", "damper_demand"]

    def change(place):
        if place == 41:  # counts from the step that ends with the next instant
            unit.set(**{"policy.gain": 1500.0})

    found = unit.run(channels, PERIOD, change)
    np.testing.assert_allclose(found[:41, 0], np.asarray(run["damper_command"])[1:202:5], rtol=1e-9)
    np.testing.assert_allclose(found[:41, 1], 3000.0 * every["damper_body_velocity"][:41], rtol=1e-12)
    np.testing.assert_allclose(found[41:, 1], 1500.0 * every["damper_body_velocity"][41:], rtol=1e-12)


def test_what_a_sampled_unit_cannot_do(files, tmp_path):
    unit = Unit(files("skyhook", "whole"), tmp_path, road("skyhook"))
    assert unit.description.modelExchange is None and unit.description.coSimulation is not None
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.fmu.doStep(0.0, 1.234567e-3)  # neither the period nor the delay are a multiple of its parts
    unit.fmu.doStep(0.0, STEP)
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.fmu.getDirectionalDerivative([unit.at["damper_force"]], [unit.at["z_road"]], [1.0])
