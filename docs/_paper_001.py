"""Paper 001: damper of a heavy vehicle: its equations, tables, figures and claims."""

import numpy as np
from _statement import CONTRADICTED, CORRECTED, NOT_TREATED, REPRODUCED, Statement

from jaxdamp import bench, dampers


besinger = dampers.Besinger(14.4e3, 15.6e3, 3.6e3, limit_velocity=0.125, transition_velocity=0.7)


STATEMENTS = (
    Statement(
        "eq. 1, 2",
        "sines of QC/T 545, ω called angular frequency",
        CORRECTED,
        "ω is a frequency in Hz; `programmes.qct_545`",
    ),
    Statement(
        "II",
        "largest velocity of the tests",
        REPRODUCED,
        "20 mm at 2.5 Hz",
        0.314,
        lambda: max(t.peak_velocity for t in bench.programmes.qct_545()),
        0.01,
        "m/s",
    ),
    Statement("eq. 3", "two definitions named C₁", CORRECTED, "the second is c₂ = (C_e + C_c)/2"),
    Statement(
        "eq. 3",
        "v_open is not defined",
        CORRECTED,
        "it follows from continuity; with v_open = v_lim the force jumps by 123 N",
        None,
        lambda: float(besinger.opening_velocity()),
        unit="m/s",
    ),
    Statement(
        "text",
        "the force is larger in tension",
        CORRECTED,
        "with the published numbers compression exceeds rebound by this factor at 0.3 m/s",
        None,
        lambda: float(-besinger.force_velocity(-0.3) / besinger.force_velocity(0.3)),
    ),
    Statement(
        "eq. 4",
        "spring of 150 N/mm in series",
        CORRECTED,
        "corner frequency of the damper with it, below the test at 2 Hz; 1500 N/mm is plausible",
        None,
        lambda: 1.5e5 / 14.5e3 / (2 * np.pi),
        unit="Hz",
    ),
    Statement(
        "II",
        "seven parameters from 10 mm at 2 Hz",
        CORRECTED,
        "not identifiable: no parameter has a standard error below a third of its value (`heavy_vehicle_besinger`)",
    ),
    Statement(
        "Fig. 3 to 8", "measured loops", NOT_TREATED, "no numbers are published; the shapes follow with 1500 N/mm"
    ),
    Statement(
        "Fig. 7, 8",
        "the random test, within 6 mm and 0.06 m/s, proves that the damper is not linear",
        CONTRADICTED,
        "with the published parameters a linear law has the same RMS error there as Besinger's, 20 N, the noise "
        "(`heavy_vehicle_besinger`); `RandomTest`",
    ),
    Statement(
        "Table 1",
        "loads and stiffnesses of the truck",
        REPRODUCED,
        "`presets.truck_001`, with assumptions that it lists",
    ),
    Statement(
        "Fig. 11, 12",
        "body acceleration insensitive, tyre force sensitive to the law",
        CONTRADICTED,
        "two places are compared. On a bump of our own the law of the front axle changes the acceleration above that "
        "axle by 24 % of its RMS and its tyre load by 29 %, but that at the centre of gravity by 5 % and the "
        "tandem's load by 2 % (`heavy_vehicle_besinger`); bump, axle masses, wheelbase and linear damper are missing",
    ),
)
