"""Paper 001: damper of a heavy vehicle: its equations, tables, figures and claims."""

import math

from _statement import CONSISTENT, CONTRADICTED, CORRECTED, NOT_TREATED, REPRODUCED, Statement

from jaxdamp import bench, dampers, vehicles


besinger = dampers.Besinger(14.4e3, 15.6e3, 3.6e3, limit_velocity=0.125, transition_velocity=0.7)
STEEL = 206e9  # elasticity [Pa]


def leaves(rate: float, length: float, width: float, thickness: float) -> float:
    """Number of leaves in a spring of this rate [N/m] whose leaves taper in steps: k = 32 n E I/L³, I = b t³/12."""
    return rate * length**3 / (32 * STEEL * width * thickness**3 / 12)


def low_speed_rate() -> float:
    """Coefficient [N s/m] far in compression, with the second C₁ read as c₂."""
    return float(besinger.force_velocity(-1e4)) / -1e4


def static_front_load() -> float:
    """Load [kg] of the front axle of the preset: its share of the body and the axle."""
    truck = vehicles.presets.truck_001()
    share = truck.tandem_distance / (truck.front_distance + truck.tandem_distance)
    return float(truck.sprung_mass * share + truck.front.unsprung_mass)


REFITTED = (
    "the published value, put in, comes back from 18 records up to 2 m/s; the paper's one record does not contain it"
)
SPRING = "the published value, put in, comes back from 18 records up to 2 m/s, and from the paper's one record"
FIGURES = "with the published parameters; the measured points, and what is constant in each figure, are not published"
PLACE = "change by the law in % of the RMS, on a bump of our own; the paper compares two places"


STATEMENTS = (
    Statement(
        "eq. 1, 2",
        "sines of QC/T 545, ω called angular frequency",
        CORRECTED,
        "ω is a frequency in Hz (`programmes.qct_545`); read as rad/s the velocity of 20 mm at 2.5 would be this",
        0.05,
        lambda: 0.02 * 2.5,
        0.314,
        "m/s",
    ),
    Statement(
        "II",
        "largest velocity of the tests",
        REPRODUCED,
        "20 mm at 2.5 Hz",
        0.3142,
        lambda: max(t.peak_velocity for t in bench.programmes.qct_545()),
        0.314,
        "m/s",
    ),
    Statement(
        "eq. 3",
        "two definitions named C₁",
        CORRECTED,
        "the second is c₂ = (C_e + C_c)/2, which gives C_c far in compression",
        14400.0,
        low_speed_rate,
        unit="N s/m",
    ),
    Statement(
        "eq. 3",
        "v_open is not defined",
        CORRECTED,
        "it follows from continuity",
        0.1148,
        lambda: float(besinger.opening_velocity()),
        unit="m/s",
    ),
    Statement(
        "eq. 3",
        "v_open taken as v_lim",
        CORRECTED,
        "the force would jump by this at v_lim",
        122.6,
        lambda: 15.6e3 * 0.125 - float(besinger.force_velocity(0.125)),
        unit="N",
    ),
    Statement(
        "text",
        "the force is larger in tension",
        CONTRADICTED,
        "with the published numbers compression exceeds rebound by this factor at 0.3 m/s",
        1.772,
        lambda: float(-besinger.force_velocity(-0.3) / besinger.force_velocity(0.3)),
    ),
    Statement(
        "eq. 4",
        "spring of 150 N/mm in series",
        CORRECTED,
        "corner frequency of the damper with it, below the test at 2 Hz; 1500 N/mm is plausible",
        1.646,
        lambda: 1.5e5 / 14.5e3 / (2 * math.pi),
        unit="Hz",
    ),
    Statement(
        "Fig. 3 to 6",
        "loops of four frequencies and four amplitudes, peak force at 10 mm and 2 Hz",
        CONSISTENT,
        FIGURES,
        1198.0,
        "peak force",
        unit="N",
    ),
    Statement("Fig. 3 to 6", "work of a cycle at 10 mm and 2 Hz", CONSISTENT, FIGURES, 24.1, "work", unit="J"),
    Statement(
        "Fig. 3 to 6",
        "hysteresis",
        CONSISTENT,
        "with the published spring this much of the peak force acts : the loops are those of a spring",
        74.54,
        "force at zero velocity",
        unit="%",
    ),
    Statement(
        "eq. 4",
        "spring of 150 N/mm, ten times stiffer",
        CORRECTED,
        "share of the peak force at zero velocity at 10 mm and 2 Hz; the published spring has that of the row above",
        12.07,
        "force at zero velocity, stiff",
        unit="%",
    ),
    Statement(
        "Fig. 3 to 6",
        "obvious nonlinear characteristics in both directions",
        CONTRADICTED,
        "with the published parameters this much of the force at 10 mm and 2 Hz, the fitted test, is not an ellipse's",
        1.08,
        "departure from an ellipse",
        unit="%",
        repeat=0.02,
    ),
    Statement(
        "Fig. 4, 6",
        "the same at the largest amplitude",
        CONSISTENT,
        "at 20 mm and 2 Hz, where the valve opens in rebound",
        5.70,
        "departure at 20 mm",
        unit="%",
        repeat=0.02,
    ),
    Statement(
        "II",
        "seven parameters from 10 mm at 2 Hz",
        CONTRADICTED,
        "this many have an interval that excludes zero and infinity, the two of the spring",
        2,
        "one record",
        7,
    ),
    Statement(
        "II",
        "seven parameters, from the 16 sines",
        CORRECTED,
        "this many are determined: C_b, v_lim, k₁ and k₂; C_c, C_e and α need tests at 1 and 2 m/s",
        4,
        "16 records",
        7,
    ),
    Statement("II", "C_c", CONSISTENT, REFITTED, 14405.0, "compression_rate", 14.4e3, "N s/m", 10.1),
    Statement("II", "C_e", CONSISTENT, REFITTED, 15574.0, "rebound_rate", 15.6e3, "N s/m", 64.7),
    Statement("II", "C_b", CONSISTENT, REFITTED, 3600.0, "blow_off_rate", 3.6e3, "N s/m", 2.64),
    Statement("II", "v_lim", CONSISTENT, REFITTED, 0.12497, "limit_velocity", 0.125, "m/s", 1.51e-4),
    Statement("II", "α", CONSISTENT, REFITTED, 0.6544, "transition_velocity", 0.7, "m/s", 0.0957, repeat=0.02),
    Statement("II", "k₁", CONSISTENT, SPRING, 149.99, "stiffness", 150.0, "N/mm", 0.043),
    Statement("II", "k₂", CONSISTENT, SPRING, 0.12004, "cubic_stiffness", 0.12, "N/mm³", 6.73e-5),
    Statement(
        "Fig. 7, 8",
        "the random test, within 6 mm and 0.06 m/s, proves that the damper is not linear",
        CONTRADICTED,
        "RMS error of a linear law on records of the published valve, where Besinger's has the same; the noise is 20 N",
        20.0,
        "random, linear",
        unit="N",
    ),
    Statement(
        "Fig. 7, 8", "the random test, by Besinger's law", CONSISTENT, "RMS error", 20.0, "random, Besinger", unit="N"
    ),
    Statement(
        "Fig. 8",
        '"banana" shape',
        CONTRADICTED,
        "with the published parameters this much of the RMS force acts at standstill: an ellipse; without the spring, "
        "force over velocity is a straight line there",
        83.5,
        "random, standing",
        unit="%",
        repeat=0.02,
    ),
    Statement(
        "Fig. 1, 2, 9, 10",
        "shock absorber, test bench, scheme of the law, multi-body vehicle",
        NOT_TREATED,
        "photographs and drawings without numbers; `TandemTruck` stands for the multi-body vehicle",
    ),
    Statement(
        "Table 1",
        "load of the front axle",
        REPRODUCED,
        "put into `presets.truck_001`, with assumptions that it lists",
        6900.0,
        static_front_load,
        6900.0,
        "kg",
    ),
    Statement(
        "Table 1",
        "front leaf spring of 252 kN/m from 1600, 90 and 13 mm",
        NOT_TREATED,
        "the number of leaves is not given; stepped leaves of these dimensions would be this many",
        9.509,
        lambda: leaves(252e3, 1.6, 0.09, 0.013),
    ),
    Statement(
        "Table 1",
        "tandem leaf spring of 1195 kN/m from 1600, 90 and 24 mm",
        NOT_TREATED,
        "as above",
        7.166,
        lambda: leaves(1195e3, 1.6, 0.09, 0.024),
    ),
    Statement(
        "text",
        "integration in steps of 5 ms",
        REPRODUCED,
        "small enough: change of the largest load of the front tyre against 1 ms, with jaxdamp's engine, not GSTIFF",
        0.1438,
        "step",
        unit="%",
        repeat=0.05,
    ),
    Statement(
        "Fig. 11",
        "body acceleration insensitive",
        CONSISTENT,
        f"at the centre of gravity: {PLACE}",
        5.447,
        "body acceleration at the centre of gravity",
        unit="%",
    ),
    Statement(
        "Fig. 11",
        "body acceleration, above the front axle",
        CONTRADICTED,
        f"above the axle with the law: {PLACE}",
        24.08,
        "body acceleration above the front axle",
        unit="%",
    ),
    Statement(
        "Fig. 11",
        "body acceleration insensitive, with the published spring",
        CONSISTENT,
        f"at the centre of gravity: {PLACE}",
        11.5,
        "centre of gravity, with the spring",
        unit="%",
    ),
    Statement("Fig. 12", "tyre force sensitive", CONSISTENT, f"in front: {PLACE}", 29.23, "tyre load, front", unit="%"),
    Statement(
        "Fig. 12",
        "tyre force sensitive, with the published spring",
        CONSISTENT,
        f"in front: {PLACE}",
        64.96,
        "tyre load, front, with the spring",
        unit="%",
    ),
    Statement(
        "Fig. 12",
        "tyre force of the tandem",
        CONTRADICTED,
        f"behind: {PLACE}; bump, axle masses, wheelbase and linear damper are missing",
        1.881,
        "tyre load, tandem",
        unit="%",
    ),
)
