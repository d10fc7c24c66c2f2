"""A quarter car on a sine road, and the same integrated by an independent solver with a force written in NumPy."""

import numpy as np
from scipy.integrate import solve_ivp

from jaxdamp import roads, simulate
from jaxdamp.vehicles import QuarterCar


SPRUNG, UNSPRUNG, SPRING, TYRE = 300.0, 40.0, 20e3, 200e3


def simulated_and_integrated(law, force, rate=None, *, states=0, amplitude, frequency, duration=2.0):
    """Stroke [m] of the car with `law`, and with `force(x, v, *states)` by SciPy, at the same instants.

    `rate(x, v, *states)` gives the rates of that many states, all zero at the start.
    """
    car = QuarterCar(SPRUNG, UNSPRUNG, SPRING, TYRE, law)
    begin = {"z_sprung": 0.0, "z_unsprung": 0.0}  # also where a law is not without force there
    response = simulate(car, roads.sine(amplitude, frequency=frequency), duration=duration, start=begin)
    heights = np.asarray(response["z_road"])
    time = np.linspace(0.0, duration, heights.size)

    def rates(t, y):
        z_s, z_u, v_s, v_u, *own = y
        x, v = z_s - z_u, v_s - v_u
        f = SPRING * x + force(x, v, *own)
        tyre = TYRE * (z_u - np.interp(t, time, heights))
        return [v_s, v_u, -f / SPRUNG, (f - tyre) / UNSPRUNG, *(rate(x, v, *own) if rate else [])]

    start = [heights[0], heights[0], 0.0, 0.0, *[0.0] * states]
    solved = solve_ivp(rates, (0.0, duration), start, "RK45", time, rtol=1e-7, atol=1e-9, max_step=5e-3)
    assert solved.success, solved.message
    return np.asarray(response["stroke"]), solved.y[0] - solved.y[1]
