"""One vehicle of each kind with different laws: parameters to draw, and its equations by hand for what was drawn."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from jaxdamp import dampers
from jaxdamp.vehicles import (
    AbstractVehicle,
    Axle,
    Cab,
    Corner,
    CubicSpring,
    FullCar,
    HalfCar,
    IndependentTandem,
    RollCar,
    Seat,
    SeatMass,
    TandemTruck,
    TrackedHull,
    WalkingBeam,
)

from .newton import (
    GRAVITY,
    Link,
    Newton,
    bilinear,
    bouc_wen,
    cubic,
    friction,
    gas,
    lag,
    lever,
    maxwell,
    power_law,
    stop,
)


class Case(NamedTuple):
    vehicle: AbstractVehicle
    ranges: dict[str, tuple[float, float]]
    by_hand: Callable[[dict[str, float]], Newton]
    behind: tuple[float, ...]  # wheel by wheel, shares of the distance to the last axle
    right: tuple[bool, ...]


def under(prefix: str, ranges: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    return {f"{prefix}.{name}": pair for name, pair in ranges.items()}


def corner_ranges(scale: float = 1.0) -> dict[str, tuple[float, float]]:
    ranges = {
        "unsprung_mass": (25, 60),
        "spring_rate": (1.2e4, 4e4),
        "tyre_stiffness": (1.3e5, 2.5e5),
        "tyre_damping": (0, 300),
    }
    return {name: (scale * low, scale * high) for name, (low, high) in ranges.items()}


STOP = {"clearance": (0.02, 0.05), "stiffness": (1e4, 6e4), "damping": (0, 300)}
FRICTION = {"friction_force": (5, 100), "friction_velocity": (0.02, 0.1)}
BILINEAR = {"rebound_rate": (800, 3500), "compression_rate": (400, 2500)}
POWER = {"rebound_force": (600, 2500), "rebound_exponent": (0.5, 1.2)}
POWER |= {"compression_force": (400, 1800), "compression_exponent": (0.5, 1.2)}
KNEE = 0.02


def numbers(p: dict[str, float], prefix: str, ranges: Mapping) -> list[float]:
    return [p[f"{prefix}.{name}"] for name in ranges]


def corner(p, prefix, body, wheel, track, carried, laws):
    """Suspension and tyre of a corner that carries a mass of the body."""
    mass, spring, tyre, damping = numbers(p, prefix, corner_ranges())
    load = None if carried is None else GRAVITY * (mass + carried)
    return [Link(body - wheel, spring, 0.0, laws), Link(wheel, tyre, damping, (), track, load)]


# ---- half car: lagged damper and stops in front, Bouc-Wen, friction and a cubic spring behind, a seat of two masses


def half_car() -> Case:
    front = Corner(
        40.0,
        2e4,
        2e5,
        dampers.Lag(dampers.Bilinear(2e3, 1e3, knee_width=KNEE), 0.01),
        100.0,
        bump_stop=dampers.BumpStop(0.03, 2e4, damping=100.0, end="both"),
        tyre_lifts=True,
    )
    rear = Corner(
        40.0,
        2e4,
        2e5,
        dampers.BoucWen(1e3, 0.0, 200.0, 5e-3),
        100.0,
        extra_spring=CubicSpring(-1e4, 1e6),
        friction=dampers.CoulombFriction(50.0, 0.03),
        tyre_lifts=True,
    )
    seat = Seat((SeatMass(20.0, 8e3, dampers.Linear(300.0)), SeatMass(60.0, 6e4, dampers.Linear(800.0))), ahead=0.4)
    ranges = {"sprung_mass": (400, 900), "pitch_inertia": (500, 2000)}
    ranges |= {"front_distance": (0.8, 1.6), "rear_distance": (0.8, 1.6)}
    ranges |= under("front", corner_ranges()) | under("front.damper.law", BILINEAR) | under("front.bump_stop", STOP)
    ranges |= {"front.damper.lag_time": (2e-3, 0.02)}
    ranges |= under("rear", corner_ranges()) | under("rear.friction", FRICTION)
    hysteresis = {"viscous_rate": (500, 2000), "yield_force": (50, 400), "yield_displacement": (2e-3, 2e-2)}
    spring = {"quadratic_stiffness": (-5e4, 0), "cubic_stiffness": (0, 4e6)}
    ranges |= under("rear.damper", hysteresis) | under("rear.extra_spring", spring)

    def by_hand(p):
        la, lb = p["front_distance"], p["rear_distance"]
        z, pitch, f, r, s1, s2 = np.eye(6)
        share = (lb + 0.4) / (la + lb)  # of the seat, on the front axle
        m, stage = p["sprung_mass"], np.array([20.0, 60.0])
        carried = m * lb / (la + lb) + stage.sum() * share, m * la / (la + lb) + stage.sum() * (1 - share)
        own = lag(bilinear(*numbers(p, "front.damper.law", BILINEAR)), p["front.damper.lag_time"])
        laws = own, stop(*numbers(p, "front.bump_stop", STOP))
        links = corner(p, "front", z + la * pitch, f, 0, carried[0], laws)
        laws = (
            bouc_wen(*numbers(p, "rear.damper", hysteresis)),
            cubic(*numbers(p, "rear.extra_spring", spring)),
            friction(*numbers(p, "rear.friction", FRICTION)),
        )
        links += corner(p, "rear", z - lb * pitch, r, 1, carried[1], laws)
        links += [Link(s1 - z - 0.4 * pitch, 8e3, 300.0), Link(s2 - s1, 6e4, 800.0)]
        masses = [m, p["pitch_inertia"], p["front.unsprung_mass"], p["rear.unsprung_mass"], *stage]
        up, turned = np.array([1, 0, 1, 1, 1, 1.0]), np.array([0, 1, la, -lb, 0.4, 0.4])
        return Newton(np.array(masses), links, up, (up, turned))

    vehicle = HalfCar(600.0, 1000.0, 1.2, 1.3, front, rear, seats=(seat,))
    return Case(vehicle, ranges, by_hand, (0.0, 1.0), (False, False))


# ---- roll car: a power law behind a lever, a gas spring


def roll_car() -> Case:
    law = dampers.MotionRatio(dampers.PowerLaw(1e3, 0.7, 8e2, 0.8, knee_width=KNEE), 0.8)
    axle = Axle(
        Corner(40.0, 2e4, 2e5, law, 100.0, extra_spring=dampers.GasSpring(2e6, 6e-5, 1e-4), tyre_lifts=True), 1.5, 8e3
    )
    ranges = {"sprung_mass": (400, 900), "roll_inertia": (200, 600)}
    ranges |= {"axle.track_width": (1.3, 1.7), "axle.anti_roll_rate": (0, 2e4), "axle.corner.damper.ratio": (0.6, 1.1)}
    pressure = {"pressure": (1e6, 3e6), "volume": (4e-5, 1e-4), "rod_area": (5e-5, 2e-4)}
    ranges |= under("axle.corner", corner_ranges()) | under("axle.corner.damper.law", POWER)
    ranges |= under("axle.corner.extra_spring", pressure)

    def by_hand(p):
        z, roll, left, right = np.eye(4)
        half, m = 0.5 * p["axle.track_width"], p["sprung_mass"]
        law = power_law(KNEE, *numbers(p, "axle.corner.damper.law", POWER))
        laws = lever(law, p["axle.corner.damper.ratio"]), gas(*numbers(p, "axle.corner.extra_spring", pressure))
        links = [
            link
            for track, (side, wheel) in enumerate(((half, left), (-half, right)))
            for link in corner(p, "axle.corner", z + side * roll, wheel, track, 0.5 * m, laws)
        ]
        links.append(Link(roll - (left - right) / (2 * half), p["axle.anti_roll_rate"]))
        mass = p["axle.corner.unsprung_mass"]
        up, turned = np.array([1, 0, 1, 1.0]), np.array([0, 1, half, -half])
        return Newton(np.array([m, p["roll_inertia"], mass, mass]), links, up, (up, turned))

    return Case(RollCar(600.0, 400.0, axle), ranges, by_hand, (0.0, 0.0), (False, True))


# ---- full car: dampers in series with a spring in front, bilinear ones with stops behind, a bar in front


def full_car() -> Case:
    stops = dampers.BumpStop(0.03, 2e4, damping=100.0, end="both")
    front = Corner(40.0, 2e4, 2e5, dampers.SeriesSpring(dampers.Linear(2e3), 3e5), 100.0, tyre_lifts=True)
    damper = dampers.Bilinear(2e3, 1e3, knee_width=KNEE)
    rear = Corner(40.0, 2e4, 2e5, damper, 100.0, bump_stop=stops, tyre_lifts=True)
    ranges = {"sprung_mass": (900, 1600), "pitch_inertia": (1000, 2500), "roll_inertia": (300, 800)}
    ranges |= {"front_distance": (1.0, 1.5), "rear_distance": (1.0, 1.5)}
    ranges |= {"front.track_width": (1.3, 1.6), "rear.track_width": (1.3, 1.6), "front.anti_roll_rate": (0, 2e4)}
    ranges |= {"front.corner.damper.stiffness": (1e5, 6e5), "front.corner.damper.law.rate": (800, 3500)}
    ranges |= under("front.corner", corner_ranges()) | under("rear.corner", corner_ranges())
    ranges |= under("rear.corner.damper", BILINEAR) | under("rear.corner.bump_stop", STOP)

    def by_hand(p):
        z, pitch, roll, *wheels = np.eye(7)
        la, lb, m = p["front_distance"], p["rear_distance"], p["sprung_mass"]
        series = maxwell(p["front.corner.damper.law.rate"], p["front.corner.damper.stiffness"])
        behind = bilinear(*numbers(p, "rear.corner.damper", BILINEAR)), stop(*numbers(p, "rear.corner.bump_stop", STOP))
        links, x, y = [], [], []
        for i, wheel in enumerate(wheels):
            end, ahead, other, laws = ("front", la, lb, (series,)) if i < 2 else ("rear", -lb, la, behind)
            left = (0.5 if i % 2 == 0 else -0.5) * p[f"{end}.track_width"]
            mount, carried = z + ahead * pitch + left * roll, 0.5 * m * other / (la + lb)
            links += corner(p, f"{end}.corner", mount, wheel, i, carried, laws)
            x.append(ahead)
            y.append(left)
        twist = roll - (wheels[0] - wheels[1]) / p["front.track_width"]
        links.append(Link(twist, p["front.anti_roll_rate"]))
        masses = [m, p["pitch_inertia"], p["roll_inertia"]]
        masses += [p[f"{end}.corner.unsprung_mass"] for end in ("front", "front", "rear", "rear")]
        up = np.array([1, 0, 0, 1, 1, 1, 1.0])
        return Newton(np.array(masses), links, up, (up, np.array([0, 1, 0, *x]), np.array([0, 0, 1, *y])))

    vehicle = FullCar(1200.0, 1500.0, 500.0, 1.2, 1.3, Axle(front, 1.5, 8e3), Axle(rear, 1.5))
    return Case(vehicle, ranges, by_hand, (0.0, 0.0, 1.0, 1.0), (False, True, False, True))


# ---- trucks: a walking beam; two axles with a cab


HEAVY = 15.0
BODY = {
    "sprung_mass": (8e3, 2e4),
    "pitch_inertia": (4e4, 1e5),
    "front_distance": (2.0, 3.5),
    "tandem_distance": (1.0, 2.0),
}
TRUCK_POWER = {name: (20 * a, 20 * b) if name.endswith("force") else (a, b) for name, (a, b) in POWER.items()}
TRUCK_BILINEAR = {name: (20 * a, 20 * b) for name, (a, b) in BILINEAR.items()}


def truck_front() -> Corner:
    law = dampers.PowerLaw(2e4, 0.7, 1e4, 0.8, knee_width=KNEE)
    return Corner(600.0, 3e5, 2e6, law, 1e3, tyre_lifts=True)


def walking_beam() -> Case:
    law = dampers.Bilinear(4e4, 2e4, knee_width=KNEE)
    beam = WalkingBeam(2e3, 800.0, 1.3, 2e6, 4e6, law, 2e3, tyre_lifts=True)
    ranges = BODY | under("front", corner_ranges(HEAVY)) | under("front.damper", TRUCK_POWER)
    ranges |= {"tandem.mass": (1500, 2500), "tandem.pitch_inertia": (500, 1200), "tandem.spread": (1.2, 1.5)}
    ranges |= {"tandem.spring_rate": (1e6, 3e6), "tandem.tyre_stiffness": (2e6, 5e6), "tandem.tyre_damping": (0, 5e3)}
    ranges |= under("tandem.damper", TRUCK_BILINEAR)

    def by_hand(p):
        z, pitch, f, b, tilt = np.eye(5)
        lf, lt, m = p["front_distance"], p["tandem_distance"], p["sprung_mass"]
        laws = (power_law(KNEE, *numbers(p, "front.damper", TRUCK_POWER)),)
        links = corner(p, "front", z + lf * pitch, f, 0, m * lt / (lf + lt), laws)
        laws = (bilinear(*numbers(p, "tandem.damper", TRUCK_BILINEAR)),)
        links.append(Link(z - lt * pitch - b, p["tandem.spring_rate"], 0.0, laws))
        load = 0.5 * GRAVITY * (p["tandem.mass"] + m * lf / (lf + lt))
        for track, side in ((1, 0.5), (2, -0.5)):
            wheel = b + side * p["tandem.spread"] * tilt
            links.append(Link(wheel, p["tandem.tyre_stiffness"], p["tandem.tyre_damping"], (), track, load))
        masses = [m, p["pitch_inertia"], p["front.unsprung_mass"], p["tandem.mass"], p["tandem.pitch_inertia"]]
        up, turned = np.array([1, 0, 1, 1, 0.0]), np.array([0, 1, lf, -lt, 1])
        return Newton(np.array(masses), links, up, (up, turned))

    vehicle = TandemTruck(1.5e4, 6e4, 2.5, 1.5, truck_front(), beam)
    return Case(vehicle, ranges, by_hand, (0.0, 0.8, 1.0), (False,) * 3)


def independent_tandem() -> Case:
    axle = Corner(900.0, 6e5, 3e6, dampers.Bilinear(2e4, 1e4, knee_width=KNEE), 2e3)
    front = Corner(600.0, 3e5, 2e6, dampers.PowerLaw(2e4, 0.7, 1e4, 0.8, knee_width=KNEE), 1e3)
    cab = Cab(900.0, 900.0, 2.6, 0.9, 0.7, 6e4, 6e4, dampers.Linear(4e3), dampers.Linear(4e3))
    ranges = BODY | under("front", corner_ranges(HEAVY)) | under("front.damper", TRUCK_POWER)
    ranges |= under("tandem.axle", corner_ranges(HEAVY)) | under("tandem.axle.damper", TRUCK_BILINEAR)
    ranges |= {"tandem.spread": (1.2, 1.5), "cab.mass": (600, 1200), "cab.pitch_inertia": (500, 1500)}

    def by_hand(p):
        z, pitch, f, first, second, cab, nod = np.eye(7)
        lf, lt, half = p["front_distance"], p["tandem_distance"], 0.5 * p["tandem.spread"]
        laws = (power_law(KNEE, *numbers(p, "front.damper", TRUCK_POWER)),)
        links = corner(p, "front", z + lf * pitch, f, 0, None, laws)
        laws = (bilinear(*numbers(p, "tandem.axle.damper", TRUCK_BILINEAR)),)
        for track, (wheel, ahead) in enumerate(((first, half - lt), (second, -half - lt)), 1):
            links += corner(p, "tandem.axle", z + ahead * pitch, wheel, track, None, laws)
        for x in (0.9, -0.7):
            links.append(Link(cab + x * nod - z - (2.6 + x) * pitch, 6e4, 4e3))
        axles = [p["front.unsprung_mass"], *2 * [p["tandem.axle.unsprung_mass"]]]
        masses = [p["sprung_mass"], p["pitch_inertia"], *axles, p["cab.mass"], p["cab.pitch_inertia"]]
        return Newton(np.array(masses), links, np.array([1, 0, 1, 1, 1, 1, 0.0]))

    vehicle = TandemTruck(1.5e4, 6e4, 2.5, 1.5, front, IndependentTandem(axle, 1.3), cab)
    return Case(vehicle, ranges, by_hand, (0.0, 0.8, 1.0), (False,) * 3)


# ---- tracked hull: dampers between the hull and the ground


def tracked_hull() -> Case:
    positions = np.array([1.3, 0.6, 0.0, -0.7, -1.4])
    law = dampers.Bilinear(2e4, 1e4, knee_width=KNEE)
    vehicle = TrackedHull(8e3, 2.5e4, positions, 1.3e5, law, (1, 2, 5))
    ranges = {"sprung_mass": (6e3, 1e4), "pitch_inertia": (2e4, 3e4), "wheel_rate": (1e5, 3e5)}
    ranges |= under("damper", TRUCK_BILINEAR)

    def by_hand(p):
        rebound, compression = numbers(p, "damper", TRUCK_BILINEAR)
        law = bilinear(2 * rebound, 2 * compression)  # both sides
        links = [
            Link(np.array([1.0, ahead]), 2 * p["wheel_rate"], 0.0, (law,) * (i in (0, 1, 4)), i)
            for i, ahead in enumerate(positions)
        ]
        return Newton(np.array([p["sprung_mass"], p["pitch_inertia"]]), links, np.array([1.0, 0.0]))

    return Case(vehicle, ranges, by_hand, tuple((1.3 - positions) / 2.7), (False,) * 5)


CASES = {
    "half car": half_car(),
    "roll car": roll_car(),
    "full car": full_car(),
    "walking beam": walking_beam(),
    "independent tandem": independent_tandem(),
    "tracked hull": tracked_hull(),
}
