"""How long the steady frequency response of a quarter car takes with laws as they are, and how accurate it is.

    python -m benchmarks.frequency_response

200 frequencies from 0.5 to 20 Hz on a sine of 5 mm (20 mm with the bump stop, so that it is hit). "error" is the
largest deviation from the last cycle of a simulation from rest (200 cycles or more, and at least 60 s, until the free
vibration of the body has died out; 2048 steps a cycle), as part of the largest value of that cycle, at the frequency
with the largest gain and at 12 Hz.
"""

from typing import Any

import numpy as np

from jaxdamp import configure


configure(cache=False)

from benchmarks._timing import first_and_warm, report  # noqa: E402
from jaxdamp import roads, simulate  # noqa: E402
from jaxdamp.dampers import (  # noqa: E402
    Besinger,
    BoucWen,
    BumpStop,
    CoulombFriction,
    GasSpring,
    Linear,
    SeriesSpring,
)
from jaxdamp.simulation import harmonic_response  # noqa: E402
from jaxdamp.vehicles import QuarterCar  # noqa: E402
from jaxdamp.vehicles.presets import quarter_car_000  # noqa: E402


FREQUENCIES = np.geomspace(0.5, 20.0, 200)  # Hz
CHANNELS = ("z_sprung", "sprung_acceleration", "stroke", "dynamic_tyre_load")
CYCLES, SECONDS, STEPS = 200, 60.0, 2048
CARS = {
    "linear": (quarter_car_000(Linear(1200.0)), 0.005),
    "friction": (quarter_car_000(Linear(1200.0) + CoulombFriction(60.0, 0.02)), 0.005),
    "Bouc-Wen": (quarter_car_000(BoucWen(800.0, 2000.0, 300.0, 1e-3, 0.75, 1.5)), 0.005),
    "blow-off": (quarter_car_000(Besinger(14_400.0, 15_600.0, 3_600.0, 0.125, 0.7) * 0.2), 0.005),
    "bump stop": (
        QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(800.0), bump_stop=BumpStop(clearance=0.03, stiffness=5e4)),
        0.02,
    ),
    "series spring": (quarter_car_000(SeriesSpring(Linear(1500.0), 2e5)), 0.005),
    "gas spring": (
        QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(800.0), extra_spring=GasSpring(2e6, 6e-5, 1e-4)),
        0.005,
    ),
}


def error_at(car: QuarterCar, frequency: float, amplitude: float) -> float:
    """Of the steady motion at one frequency, in the worst of the channels."""
    steady = harmonic_response(car, [frequency], amplitude)
    road = roads.sine(amplitude, frequency=frequency)
    cycles = max(CYCLES, int(np.ceil(SECONDS * frequency)))
    response = simulate(car, road, duration=cycles / frequency, dt=1.0 / frequency / STEPS)
    worst = 0.0
    for channel in CHANNELS:
        cycle = np.asarray(steady[channel][0])
        last = np.asarray(response[channel])[-STEPS - 1 : -1 : STEPS // cycle.size]
        worst = max(worst, float(np.abs(cycle - last).max() / np.abs(last).max()))
    return worst


def main() -> None:
    rows: list[list[Any]] = []
    for name, (car, amplitude) in CARS.items():
        first, warm = first_and_warm(
            lambda car=car, amplitude=amplitude: harmonic_response(car, FREQUENCIES, amplitude).cycles, repeats=3
        )
        swept = harmonic_response(car, FREQUENCIES, amplitude)
        peak = float(FREQUENCIES[np.nanargmax(np.abs(swept.gain("z_sprung")))])
        steady = sum(status.good for status in swept.status)
        errors = [error_at(car, frequency, amplitude) for frequency in (peak, 12.0)]
        rows.append([name, warm, first, steady, peak, *errors])
    head = ["law", "warm, s", "first call, s", "steady", "resonance, Hz", "error there", "error at 12 Hz"]
    report("frequency_response", f"Steady response of a quarter car at {FREQUENCIES.size} frequencies", head, rows)


if __name__ == "__main__":
    main()
