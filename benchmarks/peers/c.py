"""Hand-written C: classic RK4 and the exponential step of `jaxdamp.simulation.exponential`, vectorised over cars.

The sources in `kernels/` are compiled for this machine when they are first called, and need gcc.
"""

import ctypes
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from benchmarks.peers import problem
from benchmarks.peers.problem import Heights, Parameters, Results
from jaxdamp.simulation.exponential import Propagator
from jaxdamp.vehicles import AbstractVehicle, HalfCar, QuarterCar


FLAGS = ["-std=gnu99", "-O3", "-march=native", "-mprefer-vector-width=512", "-ffast-math", "-fopenmp"]

# RK4 steps from instant to instant of 1 ms. With three (k1 dt/C_b up to 2 a step) the series spring is stable over all
# its range and has an error of 2e-6 at most, the exponential step 2e-5; with two (up to 3) a stiff spring on an open
# valve is unstable, and some cars have an error of 1e-2.
SUBSTEPS = {"besinger": 1, "lag": 1, "series_spring": 3, "bouc_wen": 1, "half_car": 1}

_NUMBER, _COUNT = ctypes.c_double, ctypes.c_long
_ARRAY = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")


class _Car(ctypes.Structure):
    _fields_ = [
        (name, _NUMBER)
        for name in (
            "sprung_mass",
            "unsprung_mass",
            "spring_rate",
            "tyre_stiffness",
            "pitch_inertia",
            "front_distance",
            "rear_distance",
        )
    ]


def available() -> bool:
    """Whether there is a compiler."""
    return shutil.which("gcc") is not None


@functools.cache
def library(lanes: int = 32) -> ctypes.CDLL:
    """The compiled kernels, with blocks of so many cars."""
    if not available():
        raise RuntimeError("gcc was not found: the peers in C cannot be compiled. Install gcc or leave them out.")
    source = Path(__file__).parent / "kernels" / "kernels.c"
    with tempfile.TemporaryDirectory() as folder:
        compiled, built = str(Path(folder) / "kernels.o"), str(Path(folder) / "kernels.so")
        # Linked without -ffast-math, which would make the whole process take the smallest numbers for zero.
        _gcc(*FLAGS, f"-DLANES={lanes}", "-fPIC", "-c", str(source), "-o", compiled)
        _gcc("-shared", "-fopenmp", compiled, "-o", built, "-lm")
        return ctypes.CDLL(built)


def _gcc(*arguments: str) -> None:
    done = subprocess.run(["gcc", *arguments], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"gcc could not compile the peers in C:\n{done.stderr}")


def rk4(
    case: str,
    parameters: Parameters,
    road: Heights,
    dt: float = 1e-3,
    *,
    threads: int = 1,
    substeps: int | None = None,
    lanes: int = 32,
) -> Results:
    """RMS acceleration of the body by classic RK4, `substeps` steps from instant to instant (SUBSTEPS if left out)."""
    count = SUBSTEPS[case] if substeps is None else substeps
    return _run(f"{case}_rk4", case, parameters, road, dt, ctypes.c_int(count), threads, lanes)


def exponential(
    case: str, parameters: Parameters, road: Heights, dt: float = 1e-3, *, threads: int = 1, lanes: int = 32
) -> Results:
    """RMS acceleration of the body by the exponential step."""
    return _run(f"{case}_exponential", case, parameters, road, dt, _matrices(case, dt), threads, lanes)


def skyhook(
    parameters: Parameters,
    road: Heights,
    dt: float = 1e-3,
    *,
    every: int = 5,
    lag: float,
    still: float = 0.1,
    threads: int = 1,
    lanes: int = 32,
) -> Results:
    """RMS acceleration of the body under linear skyhook by the exponential step.

    Arguments:
        parameters: soft and hard rate of the damper and gain of skyhook of each car [N s/m].
        road: heights [m].
        dt: step [s].
        every: steps of a period.
        lag: of the actuator [s].
        still: velocity below which force over velocity is rounded [m/s].
        threads: number of threads.
        lanes: cars in a block.
    """
    extra = np.append(_matrices("skyhook", dt), [every, lag, still])
    return _run("skyhook_exponential", "skyhook", parameters, road, dt, extra, threads, lanes)


def _run(
    name: str,
    case: str,
    parameters: Parameters,
    road: Heights,
    dt: float,
    extra: ctypes.c_int | np.ndarray,
    threads: int,
    lanes: int,
) -> Results:
    """Call a kernel."""
    table, heights = (np.ascontiguousarray(a, dtype=np.float64) for a in (parameters, road))
    wheels, columns = 2 if case == "half_car" else 1, 3 if case == "skyhook" else len(problem.names(case))
    if table.shape[1] != columns or heights.shape[1] != wheels:
        raise ValueError(f"{case} needs {columns} parameters and {wheels} track(s).")
    kernel = library(lanes)[name]
    kernel.restype = None
    kind = ctypes.c_int if isinstance(extra, ctypes.c_int) else _ARRAY
    kernel.argtypes = [ctypes.POINTER(_Car), _ARRAY, _COUNT, _ARRAY, _COUNT, _NUMBER, kind, ctypes.c_int, _ARRAY]
    rms = np.empty(table.shape[0])
    kernel(_car(case), table, table.shape[0], heights, heights.shape[0] - 1, dt, extra, threads, rms)
    return rms


@functools.cache
def _car(case: str) -> _Car:
    car = problem.vehicle(None, case)
    if isinstance(car, HalfCar):
        corner, body = car.front, (car.pitch_inertia, car.front_distance, car.rear_distance)
    else:
        assert isinstance(car, QuarterCar)
        corner, body = car, (0.0, 0.0, 0.0)
    numbers = (car.sprung_mass, corner.unsprung_mass, corner.spring_rate, corner.tyre_stiffness, *body)
    return _Car(*map(float, numbers))


@functools.cache
def _matrices(case: str, dt: float) -> np.ndarray:
    """The matrices of a step one after the other, row by row, with the terms of each force and height gathered."""
    step = _propagator(problem.vehicle(None, case), jnp.asarray(dt))
    force, bend = step.force_held + step.force_ramp, step.force_ramp + step.force_bend
    parts = (step.phi, force, -step.force_ramp, bend, step.road_held - step.road_ramp, step.road_ramp)
    return np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in parts])


@eqx.filter_jit
def _propagator(car: AbstractVehicle, dt: Array) -> Propagator:
    return Propagator.over(car.system().motion, dt)
