"""Damper laws: force from stroke, velocity and states, one law a file, all under one contract.

Velocity is positive in extension (rebound), force is positive when it resists extension. Laws compose:
`law + law`, `2.0 * law`, `SeriesSpring(law, ...)`, `Lag(law, ...)`, `MotionRatio(law, ...)`.
"""

from jaxdamp.dampers.base import AbstractDamper, AbstractMemoryless, AbstractStateful, Scaled, Sum
from jaxdamp.dampers.besinger import Besinger
from jaxdamp.dampers.bilinear import Bilinear
from jaxdamp.dampers.coulomb_friction import CoulombFriction
from jaxdamp.dampers.lag import Lag
from jaxdamp.dampers.linear import Linear
from jaxdamp.dampers.motion_ratio import MotionRatio
from jaxdamp.dampers.piecewise_linear import PiecewiseLinear
from jaxdamp.dampers.polynomial import Polynomial
from jaxdamp.dampers.power_law import PowerLaw
from jaxdamp.dampers.segmented_polynomial import SegmentedPolynomial
from jaxdamp.dampers.series_spring import SeriesSpring
from jaxdamp.dampers.table import Table


__all__ = [
    "AbstractDamper",
    "AbstractMemoryless",
    "AbstractStateful",
    "Besinger",
    "Bilinear",
    "CoulombFriction",
    "Lag",
    "Linear",
    "MotionRatio",
    "PiecewiseLinear",
    "Polynomial",
    "PowerLaw",
    "Scaled",
    "SegmentedPolynomial",
    "SeriesSpring",
    "Sum",
    "Table",
]
