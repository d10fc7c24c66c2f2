import ctypes
import functools
import subprocess
import zipfile
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp.dampers import Besinger, Lag, PiecewiseLinear, Scheduled, SeriesSpring, Spring
from jaxdamp.export import to_fmu
from jaxdamp.rig import respond
from tests.export.compiled import STRICT, compiler


fmpy = pytest.importorskip("fmpy")
STEPS = (4e-3, 2e-3, 1e-3)  # s
VALVE = Besinger(900.0, 2800.0, 700.0, 0.25, 0.05)
LAWS = {
    "series": SeriesSpring(VALVE, 4e5, 1e8),
    "sum": Lag(0.5 * PiecewiseLinear([-0.1, 0.1], [700.0, 2000.0, 900.0], 0.02) + Spring(3000.0), 0.004),
    "scheduled": Scheduled((Lag(VALVE, 0.01), Lag(Besinger(400.0, 900.0, 300.0, 0.2, 0.05), 0.02)), [0.0, 2.0], 0.7),
}


def motion(time):
    return 0.008 * np.sin(30.0 * time), 0.24 * np.cos(30.0 * time)


def instants(step):
    return np.arange(round(0.2 / step) + 1) * step


# The others run with the slow tests.
NAMES = ["series", *(pytest.param(name, marks=pytest.mark.slow) for name in LAWS if name != "series")]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    compiler("cc")
    folder = tmp_path_factory.mktemp("fmu")
    return functools.cache(lambda name: to_fmu(LAWS[name], folder / f"{name}.fmu"))


class Unit:
    """One of the FMUs, unzipped and initialised."""

    def __init__(self, file, folder, kind):
        self.description = fmpy.read_model_description(str(file))
        self.at = {v.name: v.valueReference for v in self.description.modelVariables}
        unzipped = fmpy.extract(str(file), unzipdir=str(folder / file.stem))
        about = {"unzipDirectory": unzipped, "modelIdentifier": file.stem, "instanceName": "one"}
        self.fmu = kind(guid=self.description.guid, **about)
        self.fmu.instantiate()
        self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.move(0.0)
        self.fmu.exitInitializationMode()

    def set(self, **values):
        self.fmu.setReal([self.at[name] for name in values], list(values.values()))

    def move(self, time):
        x, v = motion(time)
        self.set(x=float(x), v=float(v))

    def get(self, name):
        return self.fmu.getReal([self.at[name]])[0]

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture
def unit(files, tmp_path):
    opened = []

    def load(name, kind=None):
        opened.append(Unit(files(name), tmp_path, kind or fmpy.fmi2.FMU2Slave))
        return opened[-1]

    yield load
    for one in opened:
        one.close()


@pytest.mark.parametrize("name", NAMES)
def test_validation_finds_nothing(files, name):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(files(name))) == []
    assert fmpy.supported_platforms(str(files(name))) == ["c-code", fmpy.platform]


@pytest.mark.slow
def test_variables_have_units_limits_and_start_values(files):
    known = {v.name: v for v in fmpy.read_model_description(str(files("scheduled"))).modelVariables}
    rate = known["laws[0].law.rebound_rate"]
    assert (rate.unit, float(rate.start), rate.variability) == ("N s/m", 2800.0, "tunable")
    assert 0.0 < float(rate.min) < 1e-300
    assert (known["levels[1]"].variability, float(known["levels[1]"].start)) == ("fixed", 2.0)
    assert (known["command"].causality, float(known["command"].start)) == ("input", 0.7)
    units = {u.name: u.baseUnit for u in fmpy.read_model_description(str(files("scheduled"))).unitDefinitions}
    assert (units["N s/m"].kg, units["N s/m"].s, units["N s/m"].m, units["N s/m"].factor) == (1, -1, 0, 1.0)


@pytest.mark.parametrize("name", NAMES)
def test_co_simulation_in_the_master_of_fmpy(files, name):
    """Outputs right after a step are extrapolated, and the error falls with the square of the step or faster."""
    errors = []
    for step in STEPS:
        time = instants(step)
        signals = np.array([*zip(time, *motion(time), strict=True)], [(name, float) for name in ("time", "x", "v")])
        options = {"output_interval": step, "input": signals, "output": ["F"], "fmi_type": "CoSimulation"}
        start = {"longest_step": 1.0}
        done = fmpy.simulate_fmu(str(files(name)), stop_time=time[-1], start_values=start, **options)
        force = np.asarray(respond(LAWS[name], time, *motion(time)))
        errors.append(np.abs(done["F"] - force)[3:].max() / np.abs(force).max())
    assert errors[0] < 0.1 and errors[1] < 0.4 * errors[0] and errors[2] < 0.4 * errors[1], errors


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("substeps", [1, 4])
def test_with_the_inputs_of_an_instant_the_force_is_that_of_respond(unit, name, substeps):
    one, step = unit(name), 4e-3
    time = instants(step)
    one.set(longest_step=step / substeps)
    force = [one.get("F")]
    for now, following in pairwise(time):
        one.fmu.doStep(now, step)
        one.move(following)
        force.append(one.get("F"))
    close = 1e-12 if substeps == 1 else 2e-3  # `respond` estimates the slope of the velocity between samples otherwise
    expected = np.asarray(respond(LAWS[name], time, *motion(time), substeps=substeps))
    np.testing.assert_allclose(force, expected, rtol=0.0, atol=close * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("substeps", [1, 2])
def test_a_command_goes_straight_as_that_of_respond(unit, substeps):
    """Its new value counted over the whole step before: force 1.4 % wrong at 4 ms."""
    one, step = unit("scheduled"), 4e-3
    time = instants(step)
    command = 0.7 + 0.6 * np.sin(40.0 * time)
    one.set(longest_step=step / substeps)
    force = [one.get("F")]
    for place, now in enumerate(time[:-1], 1):
        one.fmu.doStep(now, step)
        one.move(time[place])
        one.set(command=command[place])
        force.append(one.get("F"))
    close = 1e-12 if substeps == 1 else 2e-3  # as above
    expected = np.asarray(respond(LAWS["scheduled"], time, *motion(time), command=command, substeps=substeps))
    np.testing.assert_allclose(force, expected, rtol=0.0, atol=close * np.abs(expected).max())


@pytest.mark.slow
def test_the_rate_of_a_command_is_followed(unit):
    """It was taken without a word and did nothing."""
    one, time, command = unit("scheduled"), np.array([0.0, 4e-3]), np.array([0.7, 1.1])
    one.set(longest_step=4e-3)
    one.fmu.setRealInputDerivatives([one.at["command"]], [1], [100.0])
    one.fmu.doStep(0.0, 4e-3)
    one.move(4e-3)
    expected = np.asarray(respond(LAWS["scheduled"], time, *motion(time), command=command))[-1]
    assert one.get("command") == pytest.approx(1.1) and one.get("F") == pytest.approx(float(expected), rel=1e-12)


def test_input_derivatives_and_held_inputs(unit):
    one, (x, v) = unit("series"), motion(0.0)
    one.fmu.setRealInputDerivatives([one.at["x"], one.at["v"]], [1, 1], [v, 10.0])
    one.fmu.doStep(0.0, 1e-3)
    guessed = one.get("F")
    one.set(x=x + 1e-3 * v, v=v + 1e-2)
    assert one.get("F") == guessed  # the inputs are what the derivatives said
    one.fmu.doStep(1e-3, 1e-3)
    assert one.get("x") == x + 1e-3 * v  # an input keeps its value until it is set
    one.set(v=0.0)
    held = one.get("F")
    one.set(x=x + 1e-3 * v)
    assert one.get("F") == held


@pytest.mark.slow
def test_model_exchange(unit):
    """The law's own steps converge with second order to the states that a solver integrates."""
    name = "series"
    one = unit(name, fmpy.fmi2.FMU2Model)
    one.fmu.newDiscreteStates()
    one.fmu.enterContinuousTimeMode()
    count = one.description.numberOfContinuousStates
    state, rate = (ctypes.c_double * count)(), (ctypes.c_double * count)()

    def enter(time, values):
        one.fmu.setTime(time)
        one.move(time)
        state[:] = values
        one.fmu.setContinuousStates(state, count)

    def rates(time, values):
        enter(time, values)
        one.fmu.getDerivatives(rate, count)
        return list(rate)

    one.fmu.getContinuousStates(state, count)
    time = instants(STEPS[0])
    done = solve_ivp(rates, (0.0, time[-1]), list(state), "LSODA", time, rtol=1e-10, atol=1e-14)
    exact = []
    for now, values in zip(time, done.y.T, strict=True):
        enter(now, values)
        exact.append(one.get("F"))
        assert one.get("der(state[0])") == rates(now, values)[0]
    errors = []
    for step in STEPS:
        grid, every = instants(step), round(STEPS[0] / step)
        force = np.asarray(respond(LAWS[name], grid, *motion(grid)))[::every]
        errors.append(np.abs(force - exact)[5:].max())
    assert errors[0] < 10.0 and errors[1] < 0.35 * errors[0] and errors[2] < 0.35 * errors[1], errors


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("tolerance", [None, 1e-9])
def test_a_solver_of_an_importer_is_right_at_its_default_tolerance_and_at_a_tight_one(files, name, tolerance):
    """Tolerances are relative to the nominal values of the states: deflections of 0.1 mm, velocities of 0.3 m/s."""
    time = instants(2e-4)
    x, v = 0.02 * (1.0 - np.cos(20.0 * time)), 0.4 * np.sin(20.0 * time)  # from rest
    signals = np.array([*zip(time, x, v, strict=True)], [(name, float) for name in ("time", "x", "v")])
    options = {"output_interval": 2e-4, "input": signals, "output": ["F"], "fmi_type": "ModelExchange"}
    done = fmpy.simulate_fmu(str(files(name)), stop_time=time[-1], relative_tolerance=tolerance, **options)
    force = np.asarray(respond(LAWS[name], time, x, v))
    off = np.interp(time, done["time"], done["F"]) - force
    assert np.sqrt(np.mean(off**2)) < 0.01 * np.sqrt(np.mean(force**2))


@pytest.mark.parametrize("name", NAMES)
def test_directional_derivatives_are_the_slopes(unit, name):
    one = unit(name, fmpy.fmi2.FMU2Model)
    count = one.description.numberOfContinuousStates
    unknown = ["F", *(f"der(state[{k}])" for k in range(count))]
    law = LAWS[name]
    number = next(v for v in one.description.modelVariables if v.variability == "tunable").name
    start = dict(zip(("x", "v"), map(float, motion(0.013)), strict=True)) | {number: one.get(number)}
    known = [*start, *(f"state[{k}]" for k in range(count))]
    state = np.asarray(law.advance(0.0, 0.1, 2e-4, 0.11, law.initial_state(), 2e-3)).tolist()
    sizes = np.array([1e-6, 1e-5, 1e-6 * start[number], *(1e-6 * max(abs(s), 1e-3) for s in state)])

    def values(changed):
        one.set(**dict(zip(start, changed[:3], strict=True)))
        one.fmu.setContinuousStates((ctypes.c_double * count)(*changed[3:]), count)
        return np.array([one.get(each) for each in unknown])

    point, references = np.array([*start.values(), *state]), ([one.at[n] for n in unknown], [one.at[n] for n in known])
    for k, size in enumerate(sizes):
        change = np.zeros(len(known))
        change[k] = size
        expected = 0.5 * (values(point + change) - values(point - change))
        values(point)
        found = one.fmu.getDirectionalDerivative(*references, list(change))
        np.testing.assert_allclose(found, expected, 1e-4, 1e-9 * np.abs(values(point)).max(), err_msg=known[k])
    with pytest.raises(fmpy.fmi1.FMICallException):
        one.fmu.getDirectionalDerivative([one.at["x"]], [one.at["F"]], [1.0])


def test_directional_derivatives_are_for_model_exchange(unit):
    one = unit("series")
    one.fmu.doStep(0.0, 1e-3)
    with pytest.raises(fmpy.fmi1.FMICallException):
        one.fmu.getDirectionalDerivative([one.at["F"]], [one.at["x"]], [1.0])


@pytest.mark.slow
def test_state_can_be_saved_and_restored(unit):
    one = unit("sum")
    one.fmu.doStep(0.0, 1e-3)
    saved = one.fmu.getFMUState()
    kept = one.fmu.serializeFMUState(saved)
    before = one.get("F")
    one.set(**{"law.terms[0].law.slopes[1]": 9000.0})
    one.fmu.doStep(1e-3, 1e-3)
    assert one.get("F") != before
    one.fmu.setFMUState(saved)
    assert one.get("F") == before
    one.fmu.freeFMUState(saved)
    again = one.fmu.deSerializeFMUstate(kept)
    one.fmu.doStep(1e-3, 1e-3)
    one.fmu.setFMUState(again)
    assert one.get("F") == before
    one.fmu.freeFMUState(again)


def test_unknown_variables_are_refused(unit):
    one = unit("series")
    for wrong in (lambda: one.fmu.getReal([999]), lambda: one.set(F=1.0), lambda: one.set(longest_step=0.0)):
        with pytest.raises(fmpy.fmi1.FMICallException):
            wrong()


def test_sources_compile_without_a_warning_as_c_and_as_cpp(tmp_path):
    file = to_fmu(LAWS["scheduled"], tmp_path / "law.fmu", compiler=None)
    with zipfile.ZipFile(file) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path)
    headers = [f"sources/fmi2{name}.h" for name in ("FunctionTypes", "Functions", "TypesPlatform")]
    assert sorted(names) == ["modelDescription.xml", *headers, "sources/law.c"]
    strict = [*STRICT[1:], "-Wconversion", "-Wshadow"]
    for command in ([compiler("gcc"), STRICT[0], *strict], [compiler("g++"), "-xc++", *strict]):
        subprocess.run([*command, "-c", "sources/law.c", "-o", "law.o"], cwd=tmp_path, check=True)
    first = file.read_bytes()
    assert to_fmu(LAWS["scheduled"], file, compiler=None).read_bytes() == first


def test_compilers_that_are_missing_or_fail(tmp_path):
    with pytest.warns(UserWarning, match=r"no compiler 'nocc': law\.fmu has C sources and no binary"):
        to_fmu(LAWS["series"], tmp_path / "law.fmu", compiler="nocc")
    with pytest.raises(RuntimeError, match="has failed on law"):
        to_fmu(LAWS["series"], tmp_path / "law.fmu", compiler="false")
    with pytest.raises(ValueError, match=r"NAME\.fmu .*Try 'front_left\.fmu'"):
        to_fmu(LAWS["series"], tmp_path / "front-left.zip")


def test_a_unit_begins_at_rest_at_its_first_stroke(tmp_path):
    law = Lag(PiecewiseLinear([-0.1, 0.1], [700.0, 2000.0, 900.0]) + Spring(3000.0, -50.0), 0.004)
    file = to_fmu(law, tmp_path / "begun.fmu")
    time = np.arange(11) * 1e-3
    still = np.zeros(11, dtype=[("time", float), ("x", float), ("v", float)])
    still["time"], still["x"] = time, 0.02
    result = fmpy.simulate_fmu(str(file), stop_time=0.01, output_interval=1e-3, input=still, fmi_type="CoSimulation")
    np.testing.assert_allclose(result["F"], 10.0, rtol=1e-9)  # 3000 N/m times 20 mm, and the preload
