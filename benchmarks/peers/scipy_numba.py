"""`scipy.integrate.solve_ivp` with a right-hand side compiled by Numba, one car at a time."""

import functools
import importlib
import importlib.util
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers import problem
from benchmarks.peers.problem import Heights, Parameters, Results
from jaxdamp.vehicles import HalfCar, QuarterCar


def available() -> bool:
    """Whether Numba is installed."""
    return importlib.util.find_spec("numba") is not None


def rms(
    case: str,
    parameters: Parameters,
    road: Heights,
    dt: float = 1e-3,
    *,
    rtol: float = 1e-6,
    atol: float = 1e-6,
    method: str = "RK45",
) -> Results:
    """RMS acceleration of the body, from the motion at all instants, by an adaptive method of SciPy.

    The absolute tolerance is SciPy's own unless given, in the units of the states: m, m/s, kN for a lagging force.
    """
    if not available():
        raise ModuleNotFoundError("numba is not installed: `pip install numba`, or leave this peer out.")
    rate, mean_square = _compiled(case)
    time = np.arange(road.shape[0]) * dt
    numbers, start = _car(case), _at_rest(case, road[0])
    found = []
    for row in np.asarray(parameters, dtype=np.float64):
        given = (row, np.ascontiguousarray(road), dt, numbers)
        solution = solve_ivp(
            rate,
            (0.0, time[-1]),
            start,
            method=method,
            t_eval=time,
            args=given,
            rtol=rtol,
            atol=atol,
        )
        found.append(math.sqrt(mean_square(time, np.ascontiguousarray(solution.y.T), *given)))
    return np.array(found)


def _car(case: str) -> np.ndarray:
    """m_s, m_u, k_s, k_t; then, for the half car, pitch inertia and the distances of the axles."""
    car = problem.vehicle(None, case)
    if isinstance(car, HalfCar):
        corner, more = car.front, (car.pitch_inertia, car.front_distance, car.rear_distance)
    else:
        assert isinstance(car, QuarterCar)
        corner, more = car, ()
    numbers = (car.sprung_mass, corner.unsprung_mass, corner.spring_rate, corner.tyre_stiffness, *more)
    return np.array([float(number) for number in numbers])


def _at_rest(case: str, height: np.ndarray) -> np.ndarray:
    """Positions, rates, and the state of the law where it has one."""
    if case == "half_car":
        *_, ahead, behind = _car(case)
        pitch = (height[0] - height[1]) / (ahead + behind)
        return np.array([height[0] - ahead * pitch, pitch, *height, 0.0, 0.0, 0.0, 0.0])
    return np.array([height[0], height[0], 0.0, 0.0] + [0.0] * (case != "besinger"))


class _Compiled(NamedTuple):
    rate: Callable[..., np.ndarray]
    mean_square: Callable[..., float]


@functools.cache
def _compiled(case: str) -> _Compiled:
    """The rate of the motion, and the mean square of the acceleration of the body over the instants."""
    compiled: Callable[[Any], Any] = importlib.import_module("numba").njit(fastmath=True)
    besinger = compiled(_besinger)

    @compiled
    def height(t, road, dt, wheel):
        index = min(max(int(t / dt), 0), road.shape[0] - 2)
        return road[index, wheel] + (t / dt - index) * (road[index + 1, wheel] - road[index, wheel])

    respond = _law("besinger" if case == "half_car" else case, compiled, besinger)

    @compiled
    def quarter(t, y, p, road, dt, car):
        force, rate = respond(p, y[0] - y[1], y[2] - y[3], y[-1])
        pull = car[2] * (y[0] - y[1]) + force
        out = np.empty_like(y)
        out[-1] = rate  # first: a law without a state has no place of its own there
        out[0], out[1], out[2] = y[2], y[3], -pull / car[0]
        out[3] = (pull - car[3] * (y[1] - height(t, road, dt, 0))) / car[1]
        return out

    @compiled
    def half(t, y, p, road, dt, car):
        ahead, behind = car[5], car[6]
        front = car[2] * (y[0] + ahead * y[1] - y[2]) + besinger(p[:5], y[4] + ahead * y[5] - y[6])
        rear = car[2] * (y[0] - behind * y[1] - y[3]) + besinger(p[5:], y[4] - behind * y[5] - y[7])
        out = np.empty_like(y)
        out[:4] = y[4:]
        out[4] = -(front + rear) / car[0]
        out[5] = (behind * rear - ahead * front) / car[4]
        out[6] = (front - car[3] * (y[2] - height(t, road, dt, 0))) / car[1]
        out[7] = (rear - car[3] * (y[3] - height(t, road, dt, 1))) / car[1]
        return out

    rate, body = (half, 4) if case == "half_car" else (quarter, 2)

    @compiled
    def mean_square(time, motion, p, road, dt, car):
        total = 0.0
        for k in range(time.size):
            total += rate(time[k], motion[k], p, road, dt, car)[body] ** 2
        return total / time.size

    return _Compiled(rate, mean_square)


def _besinger(p, v):
    closed = min(v, p[3])
    u = closed / p[4] - 1.0
    rate = 0.5 * (p[1] - p[0]) * u / math.sqrt(1.0 + u * u) + 0.5 * (p[1] + p[0])
    return rate * closed + p[2] * (v - closed)


def _law(case: str, compiled: Callable[[Any], Any], besinger: Callable[..., float]) -> Callable[..., Any]:
    """Force and rate of the state from parameters, stroke, velocity and state; states are scaled to the size of m."""

    def none(p, x, v, s):
        return besinger(p, v), 0.0 * s + 0.0

    def lag(p, x, v, s):
        return 1e3 * s, (1e-3 * besinger(p, v) - s) / p[5]

    def series_spring(p, x, v, s):
        force = (p[5] + p[6] * s * s) * s
        at_limit = besinger(p, p[3])
        if force > at_limit:
            return force, v - (p[3] + (force - at_limit) / p[2])
        w = min(v, p[3])
        for _ in range(30):  # Newton, below the kink, where the law is smooth
            u = w / p[4] - 1.0
            steep = 0.5 * (p[1] - p[0]) / p[4] * (1.0 + u * u) ** -1.5
            rate = 0.5 * (p[1] - p[0]) * u / math.sqrt(1.0 + u * u) + 0.5 * (p[1] + p[0])
            change = (rate * w - force) / (rate + steep * w)
            w = min(w - change, p[3])
            if abs(change) < 1e-10:
                break
        return force, v - w

    def bouc_wen(p, x, v, s):
        u, size = v / p[3], abs(s)
        flat = size ** (p[5] - 1.0)
        force = p[0] * v + p[1] * x + p[2] * s
        return force, u * (1.0 - (1.0 - p[4]) * size * flat) - p[4] * abs(u) * s * flat

    laws = {"besinger": none, "lag": lag, "series_spring": series_spring, "bouc_wen": bouc_wen}
    return compiled(laws[case])
