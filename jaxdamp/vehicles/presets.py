"""Published parameter sets; each docstring gives the source and the assumptions.

With `tyre_lifts=True` all tyres can lift off.
"""

from jaxdamp.dampers import AbstractDamper, Besinger, Linear
from jaxdamp.vehicles.cars import FullCar, HalfCar, QuarterCar
from jaxdamp.vehicles.corner import Axle, Corner
from jaxdamp.vehicles.suspension import Seat
from jaxdamp.vehicles.tandem_truck import IndependentTandem, TandemTruck, WalkingBeam
from jaxdamp.vehicles.tracked_hull import TrackedHull


def quarter_car_000(
    damper: AbstractDamper | None = None, *, seats: tuple[Seat, ...] = (), tyre_lifts: bool = False
) -> QuarterCar:
    """Mazda CX-7 front corner, paper 000 Table II (1200 kg, heavy for a quarter of it, is the printed value).

    The default damper is linear, 2500 N s/m. Undamped modes 0.9951 and 7.5509 Hz.
    """
    law = Linear(2500.0) if damper is None else damper
    return QuarterCar(1200.0, 125.0, 60e3, 220e3, law, seats=seats, tyre_lifts=tyre_lifts)


def quarter_car_mathworks(damper: AbstractDamper | None = None, *, tyre_lifts: bool = False) -> QuarterCar:
    """The car of the MathWorks example of active suspension: 300 and 60 kg, 16 and 190 kN/m, 1000 N s/m."""
    return QuarterCar(300.0, 60.0, 16e3, 190e3, Linear(1000.0) if damper is None else damper, tyre_lifts=tyre_lifts)


def golden_car(sprung_mass: float = 250.0, *, tyre_lifts: bool = False) -> QuarterCar:
    """The car that defines the international roughness index, driven at 80 km/h.

    k_t/m_s = 653 1/s², k/m_s = 63.3 1/s², m_u/m_s = 0.15, c/m_s = 6 1/s; its motion does not depend on the sprung mass,
    which is assumed. Damped modes 1.2363 and 10.755 Hz.
    """
    m = sprung_mass
    return QuarterCar(m, 0.15 * m, 63.3 * m, 653.0 * m, Linear(6.0 * m), tyre_lifts=tyre_lifts)


def half_car_002(damper: AbstractDamper | None = None, *, tyre_lifts: bool = False) -> HalfCar:
    """Half car of paper 002 Table 1, with the sign error of its equation 2 corrected.

    The paper gives neither the linear damping coefficient nor the delay of the rear axle. Undamped modes
    1.157, 1.431, 11.635, 11.639 Hz. Assumed: 1560 N s/m at both ends, which with a delay of 0.0986 s agrees with its
    linear results within 4 %.
    """
    corner = Corner(40.0, 23.5e3, 190e3, Linear(1560.0) if damper is None else damper)
    return HalfCar(580.0, 1100.0, 1.0, 1.5, corner, corner, tyre_lifts=tyre_lifts)


def full_car_jazar(damper: AbstractDamper | None = None, *, tyre_lifts: bool = False) -> FullCar:
    """Car of Jazar, Vehicle Dynamics, example 508, as transcribed in a public file, not checked against the book.

    840 kg, 820 and 1100 kg m², axles 1.4 m ahead and 1.47 m behind, wheels 53 and 76 kg, springs 10 and 13 kN/m, tyres
    200 kN/m, anti-roll bar 10 kN m/rad in front. The book puts the left wheels at 0.70 m and the right ones at 0.75 m;
    here both are at 0.725 m. Assumed: linear dampers of 1000 N s/m (the transcription has 5000, which overdamps).
    """
    law = Linear(1000.0) if damper is None else damper
    front, rear = Corner(53.0, 10e3, 200e3, law), Corner(76.0, 13e3, 200e3, law)
    axles = Axle(front, 1.45, 10e3), Axle(rear, 1.45)
    return FullCar(840.0, 1100.0, 820.0, 1.4, 1.47, *axles, tyre_lifts=tyre_lifts)


def truck_001(
    *, walking_beam: bool = True, damper: AbstractDamper | None = None, tyre_lifts: bool = False
) -> TandemTruck:
    """Heavy vehicle of paper 001 Table 1, fully laden: 6900 kg on the front axle, 18 000 kg on the tandem.

    Published: those loads, leaf springs 252 kN/m in front and 1195 kN/m behind, tyres 1100 kN/m; the damper of the
    front axle is the paper's Besinger law with its continuous opening velocity. Assumed, since the paper does not say:
    rates are those of one spring and one tyre, with two springs per axle or tandem, two tyres in front and four on each
    rear axle, each with 500 N s/m, without which a walking beam never comes to rest; two dampers in front; 700 kg of
    front axle, 1100 kg of each rear axle; wheelbase 4.5 m to the middle of a tandem of 1.3 m; radius of gyration in
    pitch 2.2 m; 40 kN s/m for the friction of the tandem's leaves; beams whose inertia is in the axles. Force and power
    of the front damper are those of one of the two, tyre loads and forces of the tandem those of both sides together.

    Without the walking beam three springs carry the body, which leaves the loads at rest open. They follow from springs
    that were all free of load on level ground, 65.3, 97.5 and 81.3 kN, and are not the published ones.
    """
    shock = Besinger(14.4e3, 15.6e3, 3.6e3, 0.125, 0.7) if damper is None else damper
    front = Corner(700.0, 2 * 252e3, 2 * 1100e3, shock, 2 * 500.0, damper_count=2)
    axle_mass, spread, wheelbase, leaves = 1100.0, 1.3, 4.5, 2 * 1195e3
    if walking_beam:
        inertia = 2 * axle_mass * (spread / 2) ** 2
        tandem = WalkingBeam(2 * axle_mass, inertia, spread, leaves, 4 * 1100e3, None, 4 * 500.0, friction=Linear(40e3))
    else:
        axle = Corner(axle_mass, leaves / 2, 4 * 1100e3, None, 4 * 500.0, friction=Linear(20e3))
        tandem = IndependentTandem(axle, spread)
    ahead, behind = 6900.0 - 700.0, 18_000.0 - 2 * axle_mass
    sprung = ahead + behind
    distances = wheelbase * behind / sprung, wheelbase * ahead / sprung
    return TandemTruck(sprung, sprung * 2.2**2, *distances, front, tandem, tyre_lifts=tyre_lifts)


def m113_003(damper: AbstractDamper | None = None, *, tyre_lifts: bool = False) -> TrackedHull:
    """M113 of paper 003: pitch inertia 24 000 kg m², five wheels a side of 127 kN/m, dampers on wheels 1, 2 and 5.

    Assumed: the spacing of the wheels in Chrono's model, 0.667 m, with the centre of gravity over the third, and
    Chrono's hull mass of 7819 kg; the paper gives neither. The default damper is the mean of the paper, 16 kN s/m.
    """
    positions = [1.334, 0.667, 0.0, -0.667, -1.333]
    law = Linear(16e3) if damper is None else damper
    return TrackedHull(7819.0, 24e3, positions, 127e3, law, (1, 2, 5), tyre_lifts=tyre_lifts)


def m113_chrono(damper: AbstractDamper | None = None, *, tyre_lifts: bool = False) -> TrackedHull:
    """M113 of Project Chrono (data/vehicle/M113, BSD-3): 7819.24 kg, 27 287.61 kg m², dampers on wheels 1, 2 and 5.

    Wheel rate 301.4 kN/m, torsion bar rate divided by arm² at the design position; positions are the mean of the left
    and the right side, whose bars are 85 mm apart. The shock absorber of the model (100 N s/m) is a placeholder.
    Assumed instead: the mean of paper 003, 16 kN s/m. The damping of the torsion bars is left out.
    """
    positions = [1.3085, 0.6415, -0.0255, -0.692, -1.3585]
    law = Linear(16e3) if damper is None else damper
    return TrackedHull(7819.24, 27_287.61, positions, 301_408.18, law, (1, 2, 5), tyre_lifts=tyre_lifts)
