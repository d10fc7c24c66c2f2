"""Published parameter sets; each function names its source."""

from jaxdamp.dampers import AbstractDamper, Linear
from jaxdamp.vehicles.quarter_car import QuarterCar


def quarter_car_000(damper: AbstractDamper | None = None) -> QuarterCar:
    """Mazda CX-7 front corner, paper 000 Table II (1200 kg is heavy for a quarter of this car, but printed so).

    Its own damper is linear, 2500 N s/m. Undamped modes 0.9951 and 7.5509 Hz.
    """
    return QuarterCar(1200.0, 125.0, 60e3, 220e3, Linear(2500.0) if damper is None else damper)
