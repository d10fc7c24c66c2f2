"""Damper laws: force from stroke, velocity and states, one law a file, all under one contract.

Velocity is positive in extension (rebound), force is positive when it resists extension. Laws compose:
`law + law`, `2.0 * law`, `SeriesSpring(law, ...)`, `Lag(law, ...)`, `MotionRatio(law, ...)`, `Linkage(law, ...)`.
"""

from jaxdamp._guesses import answer_guesses
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers.acceleration_surface import AccelerationSurface
from jaxdamp.dampers.base import (
    AbstractDamper,
    AbstractMemoryless,
    AbstractStateful,
    AbstractStateless,
)
from jaxdamp.dampers.besinger import Besinger
from jaxdamp.dampers.bilinear import Bilinear
from jaxdamp.dampers.bouc_wen import BoucWen
from jaxdamp.dampers.bump_stop import BumpStop
from jaxdamp.dampers.bushing import Bushing
from jaxdamp.dampers.command import (
    at_command as at_command,
    check_commands as check_commands,
    takes_command as takes_command,
    with_command,
)
from jaxdamp.dampers.contract import Condition as Condition, Reach as Reach, Traits, from_samples as from_samples
from jaxdamp.dampers.coulomb_friction import CoulombFriction
from jaxdamp.dampers.creeping_visco_plastic import CreepingViscoPlastic
from jaxdamp.dampers.dahl import Dahl
from jaxdamp.dampers.degressive import Degressive
from jaxdamp.dampers.digressive_progressive import DigressiveProgressive
from jaxdamp.dampers.fitted_range import (
    UNITS as UNITS,
    FittedRange,
    Motion as Motion,
    OutsideFittedRangeWarning,
    StandardError as StandardError,
    has_fitted_range as has_fitted_range,
    has_standard_errors as has_standard_errors,
    without_fitted_ranges as without_fitted_ranges,
    without_standard_errors as without_standard_errors,
)
from jaxdamp.dampers.force_surface import ForceSurface
from jaxdamp.dampers.frequency_selective import FrequencySelective
from jaxdamp.dampers.gas_spring import GasSpring
from jaxdamp.dampers.heated import Heated
from jaxdamp.dampers.hybrid import Hybrid
from jaxdamp.dampers.hyperbolic_tangent import HyperbolicTangent
from jaxdamp.dampers.inside import (
    command_paths as command_paths,
    coverage as coverage,
    keeps_conditions as keeps_conditions,
    laws_inside as laws_inside,
    margins as margins,
    require_finite_force as require_finite_force,
    values_at_start as values_at_start,
)
from jaxdamp.dampers.karadayi_masada import KaradayiMasada
from jaxdamp.dampers.lag import Lag
from jaxdamp.dampers.linear import Linear
from jaxdamp.dampers.linkage import Linkage
from jaxdamp.dampers.lugre import LuGre
from jaxdamp.dampers.modified_bouc_wen import ModifiedBoucWen
from jaxdamp.dampers.mono_tube import MonoTube
from jaxdamp.dampers.motion_ratio import MotionRatio
from jaxdamp.dampers.neural_hysteresis import NeuralHysteresis
from jaxdamp.dampers.piecewise_linear import PiecewiseLinear
from jaxdamp.dampers.piston_flow import PistonFlow
from jaxdamp.dampers.play import Play
from jaxdamp.dampers.polynomial import Polynomial
from jaxdamp.dampers.power_law import PowerLaw
from jaxdamp.dampers.range_use import (
    RangeUse as RangeUse,
    extrapolated as extrapolated,
    not_identified as not_identified,
    range_use as range_use,
    sentence as sentence,
    warn_outside as warn_outside,
    with_fitted_range,
    with_standard_errors as with_standard_errors,
)
from jaxdamp.dampers.saturating import Saturating
from jaxdamp.dampers.scheduled import Scheduled, command_words as command_words
from jaxdamp.dampers.segmented_polynomial import SegmentedPolynomial
from jaxdamp.dampers.series_spring import SeriesSpring
from jaxdamp.dampers.spline_table import SplineTable
from jaxdamp.dampers.spring import Spring
from jaxdamp.dampers.stribeck_friction import StribeckFriction
from jaxdamp.dampers.stroke_dependent import StrokeDependent
from jaxdamp.dampers.stroke_scaled import StrokeScaled
from jaxdamp.dampers.sum import Scaled as Scaled, Sum as Sum, law_name as law_name
from jaxdamp.dampers.table import Table, drives_motion as drives_motion
from jaxdamp.dampers.temperature_scaled import TemperatureScaled
from jaxdamp.dampers.thinned import Thinned
from jaxdamp.dampers.twin_tube import TwinTube
from jaxdamp.dampers.visco_plastic import ViscoPlastic
from jaxdamp.dampers.wrapper import AbstractWrapper


__all__ = [
    "AbstractDamper",
    "AbstractMemoryless",
    "AbstractStateful",
    "AbstractStateless",
    "AbstractWrapper",
    "AccelerationSurface",
    "Besinger",
    "Bilinear",
    "BoucWen",
    "BumpStop",
    "Bushing",
    "CoulombFriction",
    "CreepingViscoPlastic",
    "Dahl",
    "Degressive",
    "DigressiveProgressive",
    "FittedRange",
    "ForceSurface",
    "FrequencySelective",
    "GasSpring",
    "Heated",
    "Hybrid",
    "HyperbolicTangent",
    "KaradayiMasada",
    "Lag",
    "Linear",
    "Linkage",
    "LuGre",
    "ModifiedBoucWen",
    "MonoTube",
    "MotionRatio",
    "NeuralHysteresis",
    "OutsideFittedRangeWarning",
    "PiecewiseLinear",
    "PistonFlow",
    "Play",
    "Polynomial",
    "PowerLaw",
    "Saturating",
    "Scheduled",
    "SegmentedPolynomial",
    "SeriesSpring",
    "SplineTable",
    "Spring",
    "StribeckFriction",
    "StrokeDependent",
    "StrokeScaled",
    "Table",
    "TemperatureScaled",
    "Thinned",
    "Traits",
    "TwinTube",
    "ViscoPlastic",
    "own_states",
    "with_command",
    "with_fitted_range",
]

answer_guesses(__name__, __all__)
