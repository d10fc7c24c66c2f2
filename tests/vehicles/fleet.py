"""One vehicle of each kind, and helpers that the tests of vehicles share."""

import numpy as np

from jaxdamp import dampers, roads
from jaxdamp.vehicles import Cab, CubicSpring, Place, QuarterCar, RollCar, Seat, SeatMass, presets


def full_quarter_car(**changes):
    """A quarter car with every element there is."""
    values = {
        "sprung_mass": 300.0,
        "unsprung_mass": 40.0,
        "spring_rate": 20e3,
        "tyre_stiffness": 180e3,
        "damper": dampers.Bilinear(1900.0, 1100.0, knee_width=0.02),
        "tyre_damping": 100.0,
        "extra_spring": CubicSpring(-4e4, 2e6),
        "bump_stop": dampers.BumpStop(0.03, 4e4, 1e7, damping=200.0, end="both"),
        "friction": dampers.CoulombFriction(60.0, 0.03),
        "tyre_lifts": True,
    }
    return QuarterCar(**(values | changes))


SEAT = Seat((SeatMass(20.0, 8e3, dampers.Linear(300.0)), SeatMass(60.0, 6e4, dampers.Linear(800.0))), ahead=0.4)


def vehicles():
    """By name."""
    half, full = presets.half_car_002(), presets.full_car_jazar()
    truck = presets.truck_001()
    cab = Cab(900.0, 900.0, 2.6, 0.9, 0.7, 60e3, 60e3, dampers.Linear(4e3), dampers.Linear(4e3))
    changed = {name: getattr(half, name) for name in half.__dataclass_fields__}
    axle = full.front
    return {
        "quarter car": presets.quarter_car_000(),
        "quarter car with everything": full_quarter_car(),
        "half car": half,
        "half car with seat": type(half)(**(changed | {"places": (Place("driver", 0.3),), "seats": (SEAT,)})),
        "roll car": RollCar(420.0, 410.0, axle),
        "full car": full,
        "walking beam": truck,
        "independent tandem with cab": _with_cab(presets.truck_001(walking_beam=False), cab),
        "tracked hull": presets.m113_003(),
        "golden car": presets.golden_car(),
    }


def _with_cab(truck, cab):
    values = {name: getattr(truck, name) for name in truck.__dataclass_fields__}
    return type(truck)(**(values | {"cab": cab, "places": (Place("eye", 0.5, body="cab"),)}))


def tracks(heights, dt=1e-3):
    """A road of given heights, a column for each wheel."""
    return roads.from_profile(np.arange(len(heights)) * dt, heights)


def bumps(starts, count=1001, height=0.03, width=0.3, dt=1e-3):
    """A haversine for each wheel, beginning at its own time [s]."""
    share = np.clip((np.arange(count)[:, None] * dt - np.asarray(starts)[None, :]) / width, 0.0, 1.0)
    return 0.5 * height * (1.0 - np.cos(2 * np.pi * share))
