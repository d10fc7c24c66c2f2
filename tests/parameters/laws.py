"""A composition of laws with several parameters."""

from jaxdamp.dampers import (
    CoulombFriction,
    Lag,
    PiecewiseLinear,
)


def composed():
    return Lag(PiecewiseLinear([-0.1, 0.2], [500.0, 2000.0, 800.0]) + 0.5 * CoulombFriction(40.0, 0.01), 0.004)


PATHS = [
    "law.terms.0.knots",
    "law.terms.0.slopes",
    "law.terms.1.law.friction_force",
    "law.terms.1.law.friction_velocity",
    "law.terms.1.factor",
    "lag_time",
]
