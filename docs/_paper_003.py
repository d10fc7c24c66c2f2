"""Paper 003: shock absorber of the M113: its equations, tables, figures and claims."""

import numpy as np
from _statement import CONSISTENT, CONTRADICTED, CORRECTED, NOT_TREATED, REPRODUCED, Statement

from jaxdamp import vehicles


hull = vehicles.presets.m113_003()


def _peak(frequency: float) -> float:
    return 2.0 * np.pi * 0.05 * frequency


STATEMENTS = (
    Statement(
        "eq. 1 to 13",
        "pitch of the hull, decay",
        REPRODUCED,
        "`TrackedHull`; natural frequency with Chrono's wheel positions",
        None,
        lambda: float(hull.pitch_frequency()),
        unit="rad/s",
    ),
    Statement(
        "eq. 14",
        "required damping for δ = 12",
        REPRODUCED,
        "positions of the wheels are missing; the rest is a centre of gravity 5 to 8 cm further ahead",
        15.5,
        lambda: float(hull.required_damping(12.0)) / 1e3,
        0.03,
        "kN s/m",
    ),
    Statement(
        "eq. 14",
        "required damping for δ = 15",
        REPRODUCED,
        "as above",
        16.5,
        lambda: float(hull.required_damping(15.0)) / 1e3,
        0.03,
        "kN s/m",
    ),
    Statement(
        "eq. 15, 16",
        "rebound coefficient for r = 0.5",
        REPRODUCED,
        "from the upper end of the range",
        23.0,
        lambda: float(hull.split_damping(16.5e3, 0.5)[1]) / 1e3,
        0.01,
        "kN s/m",
    ),
    Statement(
        "eq. 15",
        "δ = 12 to 15 with 11.5 and 23 kN s/m",
        CORRECTED,
        "equation 15 holds for the half cycle nose down; that of the whole one is larger (17.1 with free heave)",
        None,
        lambda: float(hull.pitch_decay(11.5e3, 23e3).whole),
    ),
    Statement(
        "text",
        "r between 0.4 and 0.5, mean 0.5",
        CORRECTED,
        "the mean of that range is 0.45; measured in Table 1, at 0.5 Hz",
        None,
        lambda: 11.9 / 19.8,
    ),
    Statement(
        "Table 1",
        "peak velocity at 0.5 Hz",
        REPRODUCED,
        "50 mm zero to peak; the paper prints none",
        None,
        lambda: _peak(0.5),
        unit="m/s",
    ),
    Statement(
        "Table 1",
        "coefficients from two sines",
        CONSISTENT,
        "a virtual bench that has them gives them back (`m113_tracked_vehicle`)",
    ),
    Statement(
        "conclusion",
        "mean compression 12.5 kN s/m",
        CORRECTED,
        "from Table 1",
        12.5,
        lambda: (11.9 + 13.6) / 2,
        unit="kN s/m",
    ),
    Statement(
        "conclusion",
        "mean rebound 20.5 kN s/m",
        CORRECTED,
        "from Table 1",
        20.5,
        lambda: (19.8 + 20.9) / 2,
        1e-3,
        "kN s/m",
    ),
    Statement(
        "Fig. 5 to 7",
        "force and velocity of the bench",
        NOT_TREATED,
        "no numbers besides Table 1; the caption of Fig. 7 and its text disagree",
    ),
    Statement(
        "text",
        "the force rises with the frequency because more elastic energy is stored",
        CONTRADICTED,
        "the force of Table 1 is one of velocity: without elasticity its factor between 0.5 and 0.7 Hz is this",
        None,
        lambda: 20.9 * _peak(0.7) / (19.8 * _peak(0.5)),
    ),
    Statement(
        "text",
        "the damping force at the largest velocity decreases with the frequency",
        CONTRADICTED,
        "Table 1 says that it rises, in rebound by this factor, in compression more",
        None,
        lambda: 20.9 * _peak(0.7) / (19.8 * _peak(0.5)),
    ),
    Statement("text", "F/v at each instant", CORRECTED, "singular where v = 0; `identify.fit` uses the whole record"),
    Statement(
        "eq. 17",
        "frequency of the road at 12 km/h",
        REPRODUCED,
        "waves of 6 m",
        0.55,
        lambda: 12 / 3.6 / 6.0,
        0.02,
        "Hz",
    ),
    Statement("Fig. 9", "amplitude 50 mm for h = 0.1 to 0.2 m", CORRECTED, "the amplitude is h/2"),
    Statement(
        "text",
        "coefficient at the wheel",
        CORRECTED,
        "with the motion ratio of Chrono's model, 0.87, the bench coefficient acts by this factor",
        None,
        lambda: 0.87**2,
    ),
    Statement("Fig. 12, 13", "agreement with ADAMS", NOT_TREATED, "the parameters of the ADAMS model are not given"),
)
