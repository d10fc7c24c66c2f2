"""CasADi: RK4 of the quarter car with a Besinger damper, mapped over cars; the gradient of its RMS by its own AD.

Interpreted by CasADi's virtual machine, as it comes, or turned into C and compiled, which needs gcc.
"""

import functools
import importlib
import importlib.util
import os
import shutil
import tempfile
from typing import Any

import numpy as np

from benchmarks.peers import problem
from benchmarks.peers.problem import Heights, Parameters, Results
from jaxdamp.vehicles import QuarterCar


FLAGS = ["-O3", "-march=native", "-ffast-math"]


def available(*, compiled: bool = False) -> bool:
    """Whether CasADi, and for compiled functions gcc, are installed."""
    return importlib.util.find_spec("casadi") is not None and (not compiled or shutil.which("gcc") is not None)


def rms(
    parameters: Parameters, road: Heights, dt: float = 1e-3, *, threads: int = 1, compiled: bool = False
) -> Results:
    """RMS acceleration of the body by classic RK4."""
    return prepared(road, dt, parameters.shape[0], threads=threads, compiled=compiled)(parameters)


def gradient(
    parameters: np.ndarray, road: Heights, dt: float = 1e-3, *, mode: str = "reverse", compiled: bool = False
) -> np.ndarray:
    """Gradient of the RMS of one car in its parameters, by `mode` "forward" or "reverse"."""
    return prepared_gradient(road, dt, mode=mode, compiled=compiled)(parameters)


def prepared(road: Heights, dt: float, cars: int, *, threads: int = 1, compiled: bool = False) -> Any:
    """A function from a table of parameters to RMS values, to be timed apart from its making.

    Threads share the cars, if this CasADi was built with threads; their number must divide that of the cars.
    """
    whole = _whole(road.tobytes(), dt, compiled)
    if threads == 1:
        mapped = whole.map(cars, "serial")
    elif cars % threads:
        raise ValueError(f"threads must divide the {cars} cars, not be {threads}.")
    else:
        mapped = whole.map(cars, "thread", threads)
    return lambda parameters: np.asarray(mapped(np.asarray(parameters).T)).ravel()


def prepared_gradient(road: Heights, dt: float, *, mode: str = "reverse", compiled: bool = False) -> Any:
    """A function from the parameters of one car to the gradient, to be timed apart from its making."""
    ca = _casadi()
    whole = _whole(road.tobytes(), dt, False)
    p = ca.MX.sym("p", 5)
    if mode == "reverse":
        slope = ca.jtimes(whole(p), p, ca.MX.ones(1), True)
    elif mode == "forward":
        slope = ca.jtimes(whole(p), p, ca.MX.eye(5))
    else:
        raise ValueError(f'mode must be "forward" or "reverse", not {mode!r}.')
    function = ca.Function(mode, [p], [slope], _options(compiled))
    return lambda parameters: np.asarray(function(parameters)).ravel()


def _casadi() -> Any:
    if not available():
        raise ModuleNotFoundError("casadi is not installed: `pip install casadi`, or leave this peer out.")
    return importlib.import_module("casadi")


def _options(compiled: bool) -> dict[str, Any]:
    if not compiled:
        return {}
    if not available(compiled=True):
        raise RuntimeError("gcc was not found: CasADi cannot compile its functions. Install gcc or leave this out.")
    folder = tempfile.gettempdir() + os.sep  # not where the user stands: files stay if the process is stopped
    options = {"compiler": "gcc", "flags": FLAGS, "verbose": False, "directory": folder}
    return {"jit": True, "compiler": "shell", "jit_options": options}


@functools.cache
def _whole(road: bytes, dt: float, compiled: bool) -> Any:
    """RMS from the parameters of one car, over a road that is part of the function."""
    ca = _casadi()
    heights = np.frombuffer(road)
    steps = heights.size - 1
    step, body = _step(ca, dt)
    p = ca.MX.sym("p", 5)
    start = ca.vertcat(heights[0], heights[0], 0.0, 0.0, 0.0, p)
    ends = ca.DM(np.stack([heights[:-1], heights[1:]]))
    last = step.fold(steps)(start, ends)
    mean = (last[4] + body(last) ** 2) / (steps + 1)
    return ca.Function("rms", [p], [ca.sqrt(mean)], _options(compiled))


def _step(ca: Any, dt: float) -> tuple[Any, Any]:
    """A step, and the acceleration of the body: of the motion, the sum of squares so far, and the parameters."""
    car = problem.vehicle(None, "besinger")
    assert isinstance(car, QuarterCar)
    ms, mu, ks, kt = map(float, (car.sprung_mass, car.unsprung_mass, car.spring_rate, car.tyre_stiffness))

    def rates(y: Any, p: Any, z: Any) -> Any:
        v = y[2] - y[3]
        closed = ca.fmin(v, p[3])
        u = closed / p[4] - 1.0
        c = 0.5 * (p[1] - p[0]) * u / ca.sqrt(1.0 + u * u) + 0.5 * (p[1] + p[0])
        pull = ks * (y[0] - y[1]) + c * closed + p[2] * (v - closed)
        return ca.vertcat(y[2], y[3], -pull / ms, (pull - kt * (y[1] - z)) / mu)

    whole, z = ca.SX.sym("whole", 10), ca.SX.sym("z", 2)
    y, total, p = whole[:4], whole[4], whole[5:]
    middle = 0.5 * (z[0] + z[1])
    k1 = rates(y, p, z[0])
    k2 = rates(y + 0.5 * dt * k1, p, middle)
    k3 = rates(y + 0.5 * dt * k2, p, middle)
    k4 = rates(y + dt * k3, p, z[1])
    after = ca.vertcat(y + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4), total + k1[2] ** 2, p)
    return ca.Function("step", [whole, z], [after]), ca.Function("body", [whole], [k1[2]])
