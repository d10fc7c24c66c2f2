"""Controllers and controlled vehicles as C, against `simulate`."""

import ctypes
import subprocess

import numpy as np
import pytest

from jaxdamp.control import Controlled
from jaxdamp.export import to_c, to_fmu
from jaxdamp.parameters import replace
from tests.export.compiled import STRICT, compiler
from tests.export.controlled_cars import (
    CARS,
    PLAIN,
    STEP,
    Late,
    actuated,
    car,
    driven,
    quarter,
    signals,
)


NAMES = ["skyhook", *(pytest.param(name, marks=pytest.mark.slow) for name in CARS if name != "skyhook")]


def built(folder, *sources):
    """The path of a program, or of a library where no source has a main function."""
    shared = [] if any("_test" in source for source in sources) else ["-fPIC", "-shared"]
    build = [compiler(), *STRICT, *shared, *sources, "-o", "program", "-lm"]
    done = subprocess.run(build, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:3000]
    return folder / "program"


def passes(folder, name):
    done = subprocess.run([built(folder, f"{name}.c", f"{name}_test.c")], capture_output=True, text=True, check=False)
    assert "greatest difference" in done.stdout
    return done.returncode == 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.exhaustive_cases("groundhook", "acceleration", "power", "modal", "all", "sensors", "front")
def test_the_test_programs_pass_and_fail(tmp_path, name):
    source = to_c(car(name), tmp_path, part="controller")[1]
    assert source.name == "controller.c" and passes(tmp_path, "controller")
    to_c(car(name), tmp_path / "car.c")
    assert passes(tmp_path, "car")
    if name == "skyhook":
        source.write_text(source.read_text().replace("p->policy_gain = 3000.0", "p->policy_gain = 3100.0"))
        assert not passes(tmp_path, "controller")


@pytest.mark.slow
def test_single_precision(tmp_path):
    for part in ("controller", "whole"):
        source = to_c(car("bouc_wen"), tmp_path / f"{part}.c", part=part, precision="float32")[1]
        assert "double" not in source.read_text() and passes(tmp_path, part)


def test_inputs_are_what_the_controller_needs_now_or_later(tmp_path):
    """A signal that a policy remembers is one of them."""
    header = to_c(Controlled(quarter(), Late()), tmp_path / "ecu.c", part="controller")[0].read_text()
    assert inputs_of(header) == ["damper_wheel_velocity", "damper_velocity"]
    assert passes(tmp_path, "ecu")


def test_sensors_are_outside_of_a_controller_and_their_filters_inside(tmp_path):
    header = to_c(car("sensors"), tmp_path / "ecu.c", part="controller")[0].read_text()
    assert inputs_of(header) == ["damper_body_acceleration", "damper_stroke"]
    assert "sensors_body_velocity_low" in header and "bias" not in header and "seed" not in header
    noisy = replace(car("sensors"), {"sensors.body_acceleration.noise": 0.1})
    with pytest.raises(ValueError, match=r"sensors\.body_acceleration\.noise` must be zero in C and FMU"):
        to_fmu(noisy, tmp_path / "car.fmu")
    again = to_c(noisy, tmp_path / "ecu.c", part="controller")[0].read_text()
    assert again == header


def inputs_of(header):
    """The names of the entries of u."""
    return [line.split()[1].removeprefix("ECU_U_").lower() for line in header.splitlines() if "define ECU_U_" in line]


DRIVE = """
#include "ecu.h"
/* Two controllers in turn, the second with another gain from an instant on; both sample n instants. */
void drive(const double *u, double *y, double *z, int n, double dt, double gain, int from) {
    static double m[ECU_MATRICES], m2[ECU_MATRICES];
    double c[ECU_CARRY], c2[ECU_CARRY];
    ecu_parameters p;
    int i;
    ecu_defaults(&p);
    ecu_prepare(&p, dt, m);
    ecu_prepare(&p, dt, m2);
    for (i = 0; i < n; ++i) {
        if (i == from) {
            p.policy_gain = gain;
            ecu_prepare(&p, dt, m2);
        }
        if (i) {
            ecu_step(m, u + i * ECU_INPUTS, c);
            ecu_step(m2, u + i * ECU_INPUTS, c2);
        } else {
            ecu_start(m, u, c);
            ecu_start(m2, u, c2);
        }
        ecu_outputs(c, y + i * ECU_OUTPUTS);
        ecu_outputs(c2, z + i * ECU_OUTPUTS);
    }
}
"""


def in_c(folder, vehicle, given, gain=0.0, begins=10**6):
    """Command and demand of the compiled controller: with its own gain, and with another one from an instant on."""
    header = to_c(vehicle, folder / "ecu.c", part="controller")[0].read_text()
    (folder / "drive.c").write_text(DRIVE)
    names = inputs_of(header)
    u = np.stack([given[name] for name in names], axis=1)
    outputs = np.zeros((2, len(u), 2))
    double = ctypes.POINTER(ctypes.c_double)
    pointers = [a.ctypes.data_as(double) for a in (np.ascontiguousarray(u), outputs[0], outputs[1])]
    numbers = ctypes.c_double(STEP), ctypes.c_double(gain), begins
    ctypes.CDLL(str(built(folder, "ecu.c", "drive.c"))).drive(*pointers, len(u), *numbers)
    return names, outputs


@pytest.mark.parametrize("name", ["skyhook", pytest.param("bouc_wen", marks=pytest.mark.slow)])
def test_the_controller_in_c_decides_as_in_a_simulation(tmp_path, name):
    """Also a hysteretic law: its copy, from measured motion alone, has the states of the law in the simulation."""
    run = driven(name)
    names, (own, changed) = in_c(tmp_path, car(name), signals(run), gain=1500.0, begins=200)
    assert ("damper_stroke" in names) == (name == "bouc_wen") and "damper_wheel_velocity" not in names
    demand, command = np.asarray(run["damper_demand"]), np.asarray(run["damper_command"])
    np.testing.assert_allclose(own[:-1, 1], demand[1:], rtol=1e-9, atol=1e-9 * np.abs(demand).max())
    np.testing.assert_allclose(actuated(car(name), own[:-1, 0]), command[1:], rtol=1e-9, atol=1e-12)
    assert np.ptp(own[:, 0]) > 0.2
    np.testing.assert_array_equal(changed[:200], own[:200])
    np.testing.assert_allclose(changed[200:, 1], 0.5 * own[200:, 1], rtol=1e-12)
    assert np.abs(changed[200:, 0] - own[200:, 0]).max() > 0.05


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (
            lambda f: to_c(PLAIN, f, part="controller"),
            "`part` must be 'whole' for a Scheduled, which has no controller",
        ),
        (lambda f: to_fmu(quarter(), f / "a.fmu", part="controller"), "for a QuarterCar, which has no controller"),
        (lambda f: to_c(car("skyhook"), f, part="ecu"), "`part` must be one of"),
        (lambda f: to_c(car("skyhook"), f, derivatives=True), "`derivatives` must be left out for a controller"),
        (lambda f: to_c(car("skyhook"), f / "front-ecu.c", part="controller"), r"Try 'front_ecu\.c'"),
    ],
)
def test_refusals(tmp_path, write, message):
    with pytest.raises(ValueError, match=message):
        write(tmp_path)
    assert not list(tmp_path.iterdir())
