"""Paper 000: shock absorber of a Mazda CX-7: its equations, tables, figures and claims."""

import numpy as np
from _statement import CONSISTENT, CONTRADICTED, CORRECTED, NOT_TREATED, REPRODUCED, Statement

from jaxdamp import bench, dampers, vehicles


def tests_above(velocity: float, reading: str) -> float:
    """Number of tests of Table I that are faster than this [m/s]."""
    return sum(test.peak_velocity > velocity for test in bench.programmes.paper_000_table_1(reading))


def mode(number: int) -> float:
    """Undamped frequency [Hz] of the quarter car of Table II."""
    return float(np.asarray(vehicles.modes(vehicles.presets.quarter_car_000()).undamped_frequency)[number])


def power_law(velocity: float, offset: float = 0.0) -> float:
    """Force [N] of the power law of the twin."""
    law = dampers.PowerLaw(2600.0, 0.65, 1550.0, 0.65, offset, offset, knee_width=1e-3)
    return float(law.force_velocity(velocity))


def polynomial_numbers(per_segment: tuple[int, ...]) -> float:
    """Coefficients of the segments and breakpoints between them; zero is no breakpoint to choose."""
    return sum(per_segment) + len(per_segment) - 2


STATEMENTS = (
    Statement(
        "Table I",
        "30 sines",
        REPRODUCED,
        "`programmes.paper_000_table_1`",
        30,
        lambda: tests_above(0.0, "peak-to-peak"),
        30,
    ),
    Statement(
        "Table I",
        "column named amplitude, tests of 0.01 to 1.3 m/s",
        CORRECTED,
        "read as zero to peak, this many tests exceed 1.5 m/s, the limit of the bench",
        14,
        lambda: tests_above(1.5, "zero-to-peak"),
    ),
    Statement(
        "Table I",
        "column named amplitude, read as peak to peak",
        CORRECTED,
        "tests above 1.5 m/s",
        1,
        lambda: tests_above(1.5, "peak-to-peak"),
    ),
    Statement(
        "II D",
        "records filtered at 50 Hz",
        CORRECTED,
        "a zero-phase fourth-order filter leaves this much of the test at 60 Hz; fit without the filter",
        18.75,
        lambda: 100 * bench.low_pass_gain(60.0, 50.0, 2000.0),
        unit="%",
    ),
    Statement(
        "II D",
        "the filter reduces the influence of noise",
        CONTRADICTED,
        "twin: with the filter the fitted power law is this many times further from the true curve (RMS to 1.3 m/s)",
        4.459,
        "fit with the filter",
        repeat=0.05,
    ),
    Statement(
        "Fig. 1, 2, 10",
        "test bench, data acquisition, scheme of the quarter car",
        NOT_TREATED,
        "photographs and a drawing without numbers; `VirtualDyno` and `QuarterCar` stand for them",
    ),
    Statement(
        "Fig. 3",
        "force larger in rebound than in compression",
        CONSISTENT,
        "twin: ratio in the test of 15 mm at 15 Hz",
        1.68,
        "rebound over compression",
    ),
    Statement(
        "eq. 1, 2",
        "sum of squared residuals to m, the number of parameters",
        CORRECTED,
        "it must be n, the number of samples: linear coefficient from m = 1 residual",
        3340.3,
        "coefficient from m residuals",
        unit="N s/m",
    ),
    Statement(
        "eq. 1, 2",
        "sum of squared residuals to n",
        CONSISTENT,
        "twin: linear coefficient from all samples, where Table II has 2500 for an unnamed one",
        2489.0,
        "coefficient from n residuals",
        2500.0,
        "N s/m",
    ),
    Statement(
        "eq. 3",
        "linear law",
        REPRODUCED,
        "`Linear`: force at 1 m/s with c of Table II",
        2500.0,
        lambda: float(dampers.Linear(2500.0).force_velocity(1.0)),
        2500.0,
        "N",
    ),
    Statement(
        "eq. 4, 5",
        "power law, q₂ as printed",
        CORRECTED,
        "q₂ must be negative; force of `PowerLaw` at −1 m/s with q₂ of −1550 N",
        -1550.0,
        lambda: power_law(-1.0),
        unit="N",
    ),
    Statement(
        "eq. 4, 5",
        "offsets l₁, l₂",
        CORRECTED,
        "the force jumps at v = 0, by this with offsets of 50 N; `PowerLaw` rounds the jump over a stated width",
        100.0,
        lambda: sum(abs(power_law(v, 50.0) - power_law(v)) for v in (-0.05, 0.05)),
        unit="N",
    ),
    Statement(
        "eq. 6, 7",
        '"4th and 3rd order" polynomials',
        CORRECTED,
        "printed are 4th and 2nd order: their coefficients and breakpoints",
        24,
        lambda: polynomial_numbers((5, 3, 5, 3, 5)),
    ),
    Statement(
        "eq. 6, 7",
        "no continuity between the segments",
        CORRECTED,
        "twin: fitted freely the force jumps at v = 0; `SegmentedPolynomial` is continuous and zero there",
        8.788,
        "jump",
        unit="N",
        repeat=0.05,
    ),
    Statement(
        "Fig. 5",
        "linear law with all records",
        CONSISTENT,
        "twin: RMS error",
        202.5,
        "all records, linear",
        unit="N",
    ),
    Statement(
        "Fig. 6",
        "power law with all records",
        CONSISTENT,
        "twin: RMS error",
        30.89,
        "all records, power law",
        unit="N",
    ),
    Statement(
        "Fig. 7",
        "polynomial with all records",
        CONSISTENT,
        "twin: RMS error",
        33.35,
        "all records, polynomial",
        unit="N",
    ),
    Statement(
        "Fig. 8", "error of the power law at 30 mm, 3 Hz", CONSISTENT, "twin", 17.21, "3 Hz", unit="N", repeat=0.02
    ),
    Statement(
        "Fig. 8",
        "errors below 100 N over a wide range",
        CONSISTENT,
        "twin: number of the five tests at 30 mm in which both laws err less",
        4,
        "below 100 N",
    ),
    Statement(
        "Fig. 8",
        "errors grow with the frequency",
        CONSISTENT,
        "twin: error of the power law at 30 mm, 15 Hz, the largest",
        105.6,
        "15 Hz",
        unit="N",
        repeat=0.02,
    ),
    Statement(
        "Fig. 8",
        "errors of the linear law much larger",
        CONSISTENT,
        "twin: ratio to those of the power law, the least of the five tests at 30 mm",
        6.756,
        "linear at 30 mm",
        repeat=0.02,
    ),
    Statement(
        "Fig. 9",
        "power law close to the measured force",
        CONSISTENT,
        "twin: error at 30 mm, 5 Hz, in % of the RMS force",
        2.342,
        "5 Hz",
        unit="%",
        repeat=0.02,
    ),
    Statement(
        "Table II",
        "natural frequency of the body",
        REPRODUCED,
        "follows from the table; the text says near 1 Hz",
        0.9951,
        lambda: mode(0),
        1.0,
        "Hz",
    ),
    Statement(
        "Table II",
        "natural frequency of the wheel",
        REPRODUCED,
        "follows from the table; the paper prints none",
        7.551,
        lambda: mode(1),
        unit="Hz",
    ),
    Statement(
        "Fig. 12",
        "peak of the linear law near 1 Hz not lower than that of the power law",
        CONSISTENT,
        "twin: ratio of both, in the mean of ten roads",
        2.528,
        "near 1 Hz",
        repeat=0.02,
    ),
    Statement(
        "Fig. 12",
        "peaks of the linear law lower than those of the power law, except near 1 Hz",
        CONTRADICTED,
        "twin: ratio of both at wheel hop, in the mean of ten roads; its linear law is too soft at these speeds",
        1.144,
        "wheel hop",
        repeat=0.02,
    ),
    Statement(
        "Fig. 12",
        "peaks of power law and polynomial alike",
        CONSISTENT,
        "twin: ratio of both at wheel hop, in the mean of ten roads",
        0.999,
        "peaks of the polynomial",
    ),
    Statement(
        "Fig. 11",
        "random road of 10 mm peak to peak",
        NOT_TREATED,
        "spectrum, length and seed are missing; one of 0.1 to 50 Hz is drawn, white within this band",
    ),
    Statement(
        "Fig. 13",
        "accelerations of power law and polynomial alike",
        CONSISTENT,
        "twin: RMS difference",
        5.322,
        "trace of the polynomial",
        unit="%",
        repeat=0.02,
    ),
    Statement(
        "Fig. 13",
        "acceleration of the linear law deviates",
        CONSISTENT,
        "twin: RMS difference from the power law",
        60.52,
        "trace of the linear law",
        unit="%",
    ),
    Statement(
        "Fig. 14",
        "damper force of the linear law deviates",
        CONSISTENT,
        "twin: RMS difference from the power law",
        58.31,
        "force of the linear law",
        unit="%",
    ),
    Statement(
        "IV",
        "body acceleration of the linear law 30 % below the power law",
        CONSISTENT,
        "twin: ratio of the RMS values",
        0.68,
        "linear over power law",
        0.7,
        tolerance=0.05,
    ),
    Statement(
        "IV",
        "30 %, with other power laws",
        CONTRADICTED,
        "the ratio depends on the law: the least of four",
        0.544,
        "least ratio",
        0.7,
        tolerance=0.05,
    ),
    Statement(
        "IV",
        "power law and polynomial within 1 %",
        CONSISTENT,
        "twin: difference of the RMS accelerations",
        0.8,
        "polynomial and power law",
        unit="%",
        repeat=0.05,
    ),
    Statement(
        "V",
        "a lag should be added",
        CONSISTENT,
        "twin, which has a lag: error at 30 mm, 15 Hz with `Lag`; the noise is 15 N",
        22.0,
        "15 Hz with lag",
        unit="N",
        repeat=0.05,
    ),
)
