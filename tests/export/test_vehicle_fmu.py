"""Whole vehicles as C and as FMU, against `simulate`."""

import ctypes
import functools
import subprocess
import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import simulate
from jaxdamp.dampers import Besinger, BoucWen, GasSpring, Lag, SeriesSpring
from jaxdamp.export import to_c, to_fmu
from jaxdamp.parameters import replace
from jaxdamp.roads import from_profile
from jaxdamp.simulation import CoarseStepWarning
from jaxdamp.vehicles import RollCar, presets
from tests.export.compiled import STRICT, compiler


STEPS = (4e-3, 2e-3, 1e-3)  # s
VALVE = Besinger(900.0, 2800.0, 700.0, 0.25, 0.05)
CARS = {
    "quarter": lambda: presets.quarter_car_000(Lag(VALVE, 0.004) + GasSpring(2e6, 6e-5, 1e-4, 1.3), tyre_lifts=True),
    "half": lambda: presets.half_car_002(BoucWen(800.0, 2000.0, 300.0, 1e-3, 0.75, 1.5)),
    "roll": lambda: RollCar(420.0, 820.0, presets.full_car_jazar(SeriesSpring(VALVE, 4e5, 1e8)).front),
    "truck": lambda: presets.truck_001(),
    "tracked": lambda: presets.m113_003(VALVE),
    "full": lambda: presets.full_car_jazar(SeriesSpring(VALVE, 4e5, 1e8)),
}
# The others run with the slow tests, two of them before a release.
MARKS = {"quarter": [], "full": [pytest.mark.exhaustive], "roll": [pytest.mark.exhaustive]}
NAMES = [pytest.param(name, marks=MARKS.get(name, [pytest.mark.slow])) for name in CARS]


@functools.cache
def car(name):
    return CARS[name]()


def instants(step):
    return np.arange(round(0.4 / step) + 1) * step


def heights(name, time):
    """A smooth bump for each wheel, one after the other, and their rates."""
    start = 0.05 + 0.03 * np.arange(len(car(name).wheel_names))
    angle = 2.0 * np.pi * np.clip((time[:, None] - start) / 0.2, 0.0, 1.0)
    return 0.02 * (1.0 - np.cos(angle)) ** 2, 0.04 * (1.0 - np.cos(angle)) * np.sin(angle) * 2.0 * np.pi / 0.2


def expected(name, step, vehicle=None):
    """The channels from `simulate`, by names, at the instants of a step."""
    time = instants(step)
    road = from_profile(time, heights(name, time)[0])
    with warnings.catch_warnings(action="ignore", category=CoarseStepWarning):  # the longest one is meant to be
        return simulate(vehicle or car(name), road, dt=step)


def shown(name):
    """Channels that tell whether the motion is right."""
    kinds = ("acceleration", "stroke", "damper_force", "dynamic_tyre_load")
    return [channel for channel in car(name).units if channel.endswith(kinds)]


def worst(ours, theirs):
    return np.abs(ours - theirs).max() / np.abs(theirs).max()


fmpy = pytest.importorskip("fmpy")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    compiler("cc")
    folder = tmp_path_factory.mktemp("fmu")
    return functools.cache(lambda name: to_fmu(car(name), folder / f"{name}.fmu"))


def signals(name, step, rates=True):
    """The inputs as fmpy takes them."""
    time = instants(step)
    wheels = [channel for channel in car(name).units if channel.startswith("z_") and channel.endswith("road")]
    columns = dict(zip(wheels, heights(name, time)[0].T, strict=True))
    if rates:
        columns |= {f"{wheel}_rate": np.gradient(column, step) for wheel, column in columns.items()}
    table = np.zeros(time.size, [("time", float), *((key, float) for key in columns)])
    table["time"] = time
    for key, column in columns.items():
        table[key] = column
    return table


def in_master(file, name, step, kind, **options):
    given = {"output_interval": step, "output": shown(name), "fmi_type": kind, **options}
    return fmpy.simulate_fmu(str(file), stop_time=instants(step)[-1], **given)


class Unit:
    """An FMU, unzipped and initialised, with numbers set before."""

    def __init__(self, file, folder, inputs, kind=None, **numbers):
        self.description = fmpy.read_model_description(str(file))
        self.at, self.inputs = {v.name: v.valueReference for v in self.description.modelVariables}, inputs
        unzipped = str(folder / file.stem)
        if not (folder / file.stem).exists():  # units of one binary share it
            fmpy.extract(str(file), unzipdir=unzipped)
        about = {"unzipDirectory": unzipped, "modelIdentifier": file.stem, "instanceName": "one"}
        self.fmu = (kind or fmpy.fmi2.FMU2Slave)(guid=self.description.guid, **about)
        self.fmu.instantiate()
        self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.set(**numbers)
        self.move(0)
        self.fmu.exitInitializationMode()

    def set(self, **values):
        self.fmu.setReal([self.at[name] for name in values], list(values.values()))

    def move(self, place):
        self.set(**{name: float(self.inputs[name][place]) for name in self.inputs.dtype.names[1:]})

    def get(self, names):
        return self.fmu.getReal([self.at[name] for name in names])

    def run(self, channels, step, change=None):
        """The channels at all instants; `change` is called with the number of each."""
        rows = [self.get(channels)]
        for place in range(1, len(self.inputs)):
            if change is not None:
                change(place)
            self.fmu.doStep(self.inputs["time"][place - 1], step)
            self.move(place)
            rows.append(self.get(channels))
        return np.array(rows)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.exhaustive_cases("truck", "half")
def test_fmu(files, tmp_path, name):
    """Valid; with the inputs of an instant its channels are those of `simulate`."""
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(files(name))) == []
    step = STEPS[-1]
    unit = Unit(files(name), tmp_path, signals(name, step))
    found, response = unit.run(shown(name), step), expected(name, step)
    for column, channel in zip(found.T, shown(name), strict=True):
        assert worst(column, np.asarray(response[channel])) < 1e-9, channel
    assert len(shown(name)) > 3


@pytest.mark.exhaustive_cases("half-True", "half-False", "truck-True")
@pytest.mark.parametrize("rates", [pytest.param(True, marks=pytest.mark.slow), False])
@pytest.mark.parametrize("name", [name for name in NAMES if name.values != ("tracked",)])
def test_co_simulation_in_the_master_of_fmpy(files, name, rates):
    """Right after a step inputs and outputs are extrapolated: the error falls with the square of the step."""
    errors = []
    for step in STEPS:
        done = in_master(files(name), name, step, "CoSimulation", input=signals(name, step, rates))
        response = expected(name, step)
        errors.append([worst(done[channel][3:], np.asarray(response[channel])[3:]) for channel in shown(name)])
    one, two, three = np.array(errors)
    first = 0.65 if name in ("half", "truck") else 0.4  # the longest step is coarse for their friction
    assert np.all(three < 0.05) and np.all(two < first * one + 1e-6) and np.all(three < 0.4 * two + 1e-6), errors


@pytest.mark.slow
def test_laws_between_wheel_and_road_without_rates_converge_in_proportion_to_the_step(files):
    errors = []
    for step in STEPS:
        done = in_master(files("tracked"), "tracked", step, "CoSimulation", input=signals("tracked", step, rates=False))
        response = expected("tracked", step)
        errors.append(max(worst(done[c][3:], np.asarray(response[c])[3:]) for c in shown("tracked")))
    one, two, three = errors
    assert 0.4 * two < three < 0.6 * two and two < 0.8 * one, errors  # the longest step is too coarse for more


def integrated(unit, name, channels):
    """The channels at the instants of the longest step, the states integrated by a solver with tight tolerances."""
    unit.fmu.newDiscreteStates()
    unit.fmu.enterContinuousTimeMode()
    count = unit.description.numberOfContinuousStates
    state, rate = (ctypes.c_double * count)(), (ctypes.c_double * count)()
    inputs = unit.inputs.dtype.names[1:]
    unit.fmu.getContinuousStates(state, count)

    def enter(time, values):
        road = np.concatenate([part[0] for part in heights(name, np.array([time]))])
        unit.set(**dict(zip(inputs, map(float, road), strict=True)))
        state[:] = values
        unit.fmu.setContinuousStates(state, count)

    def rates(time, values):
        enter(time, values)
        unit.fmu.getDerivatives(rate, count)
        return list(rate)

    time = instants(STEPS[0])
    done = solve_ivp(rates, (0.0, time[-1]), list(state), "LSODA", time, rtol=1e-9, atol=1e-11, max_step=0.01)
    rows = []
    for now, values in zip(time, done.y.T, strict=True):
        enter(now, values)
        rows.append(unit.get(channels))
    return dict(zip(channels, np.array(rows).T, strict=True))


@pytest.mark.parametrize("name", NAMES)
def test_model_exchange(files, tmp_path, name):
    """`simulate` converges to the states that a solver integrates, with the order of its step.

    The master of fmpy holds the inputs over its steps, so that it converges in proportion to them.
    """
    exact = integrated(Unit(files(name), tmp_path, signals(name, STEPS[0]), fmpy.fmi2.FMU2Model), name, shown(name))
    errors = []
    for step in STEPS:
        response, every = expected(name, step), round(STEPS[0] / step)
        errors.append([worst(np.asarray(response[c])[::every], exact[c]) for c in shown(name)])
    one, two, three = np.array(errors)
    assert np.all(three < 0.005) and np.all(two < 0.4 * one + 1e-5) and np.all(three < 0.4 * two + 1e-5), errors
    errors = []
    for step in (4e-4, 2e-4, 1e-4):
        options = {"input": signals(name, step), "solver": "Euler", "step_size": step}
        done, every = in_master(files(name), name, step, "ModelExchange", **options), round(STEPS[0] / step)
        errors.append([worst(done[c][::every], exact[c]) for c in shown(name)])
    one, two, three = np.array(errors)
    assert np.all(three < 0.1) and np.all(two < 0.6 * one) and np.all(three < 0.6 * two), errors


def test_parameters_steps_and_units(files, tmp_path):
    name, step = "quarter", 1e-3
    changed = {"sprung_mass": 900.0, "damper.terms[0].lag_time": 0.008, "damper.terms[1].pressure": 3e6}
    unit = Unit(files(name), tmp_path, signals(name, step), **changed)
    vehicle = replace(car(name), {key.replace("[", ".").replace("]", ""): value for key, value in changed.items()})
    response, channels = expected(name, step, vehicle), shown(name)
    found = unit.run(channels, step)
    for column, channel in zip(found.T, channels, strict=True):
        assert worst(column, np.asarray(response[channel])) < 1e-9, channel

    def shorter(place):
        unit.set(longest_step=step / (1 + place % 2))

    unit.fmu.reset()
    unit.set(**changed)
    unit.fmu.enterInitializationMode()
    unit.move(0)
    unit.fmu.exitInitializationMode()
    for column, channel in zip(unit.run(channels, step, shorter).T, channels, strict=True):
        assert worst(column, np.asarray(response[channel])) < 5e-3, channel
    known = {v.name: v for v in unit.description.modelVariables}
    rate = known["damper.terms[0].law.rebound_rate"]
    assert (rate.unit, float(rate.start), rate.variability) == ("N s/m", 2800.0, "tunable")
    assert (known["z_road"].causality, known["z_road_rate"].unit) == ("input", "m/s")
    assert (known["sprung_acceleration"].unit, known["der(state.z_sprung_rate)"].unit) == ("m/s^2", "m/s^2")
    assert "state.damper[0]" in known


def test_a_number_counts_from_the_instant_at_which_it_is_set(files, tmp_path):
    """It counted over the whole step before, so that a command acted a step too early."""
    name, step, place = "quarter", 1e-3, 40
    unit, channels = Unit(files(name), tmp_path, signals(name, step)), ["z_sprung", "z_unsprung"]
    other = Unit(files(name), tmp_path, signals(name, step))
    softer = {"damper.terms[0].law.rebound_rate": 500.0, "damper.terms[0].law.compression_rate": 400.0}
    expected = other.run(channels, step)
    found = unit.run(channels, step, lambda at: unit.set(**softer) if at == place else None)
    np.testing.assert_array_equal(found[: place + 1], expected[: place + 1])
    assert np.abs(found - expected)[place + 20 :].max() > 1e-4


@pytest.mark.slow
def test_directional_derivatives(files, tmp_path):
    name = "quarter"
    unit = Unit(files(name), tmp_path, signals(name, STEPS[0]), fmpy.fmi2.FMU2Model)
    count = unit.description.numberOfContinuousStates
    state = (ctypes.c_double * count)()
    unit.fmu.getContinuousStates(state, count)
    point = np.array(state) + np.array([0.01, 0.004, 0.2, -0.3, *[20.0] * (count - 4)])
    unknown = ["sprung_acceleration", "damper_force", "dynamic_tyre_load", "der(state.z_unsprung_rate)"]
    states = [v.name for v in unit.description.modelVariables if v.name.startswith("state.")]
    sizes = dict.fromkeys(states, 1e-6) | {"z_road": 1e-7, "z_road_rate": 1e-6, "sprung_mass": 1e-2}
    start = {name: unit.get([name])[0] for name in ("z_road", "z_road_rate", "sprung_mass")}

    def values(name, change):
        own = point + np.array([change if name == each else 0.0 for each in states])
        unit.set(**{key: value + (change if name == key else 0.0) for key, value in start.items()})
        unit.fmu.setContinuousStates((ctypes.c_double * count)(*own), count)
        return np.array(unit.get(unknown))

    for known, size in sizes.items():
        slope = (values(known, size) - values(known, -size)) / (2.0 * size)
        values(known, 0.0)
        exact = unit.fmu.getDirectionalDerivative([unit.at[n] for n in unknown], [unit.at[known]], [1.0])
        np.testing.assert_allclose(exact, slope, 1e-4, 1e-6 * np.abs(slope).max() + 1e-6, err_msg=known)


@pytest.mark.parametrize("name", NAMES)
def test_the_test_program_of_c(tmp_path, name):
    header, source, test = to_c(car(name), tmp_path / "car.c", derivatives=name == "quarter")
    command = "g++" if name == "half" else "gcc"
    strict = STRICT[1:] if command == "g++" else STRICT
    build = [compiler(command), *strict, "car.c", "car_test.c", "-o", "car", "-lm"]
    subprocess.run(build, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "car"], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "greatest difference" in done.stdout, done.stdout
    if name == "quarter":
        assert "#define CAR_Y_SPRUNG_ACCELERATION 1 /* [m/s^2] acceleration of sprung, up */" in header.read_text()
        text = source.read_text(encoding="utf-8")
        source.write_text(text.replace("p->sprung_mass = 1200.0", "p->sprung_mass = 1210.0"), encoding="utf-8")
        subprocess.run(build, cwd=tmp_path, check=True)
        assert subprocess.run([tmp_path / "car"], capture_output=True, check=False).returncode == 1
        assert test.name == "car_test.c"


@pytest.mark.exhaustive
def test_single_precision(tmp_path):
    source = to_c(car("quarter"), tmp_path / "car.c", precision="float32")[1]
    subprocess.run([compiler(), *STRICT, "car.c", "car_test.c", "-o", "car", "-lm"], cwd=tmp_path, check=True)
    assert "double" not in source.read_text(encoding="utf-8")
    assert subprocess.run([tmp_path / "car"], check=False).returncode == 0
